import pickle
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from gasp_core import Elastic, EngineAccuracy, Precision
from gasp_core.contract import PointCloud, PointProblem
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_worker
from gasp_core.engines.worker.session import Limits

FAKES = Path(__file__).parents[1] / "fake_plugins"

SOON = 5.0
"""Seconds within which the death of a worker has to be an error."""


def forget_fakes():
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture(autouse=True)
def folders_of_their_own(monkeypatch, tmp_path):
    """Logs and environments of this test alone."""
    logs = tmp_path / "logs"
    logs.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(logs))
    monkeypatch.setenv("TMPDIR", str(logs))
    monkeypatch.setenv("GASP_ENVIRONMENTS", str(tmp_path / "environments"))


@pytest.fixture
def logs(tmp_path):
    """Logs that are there; a folder without one would be litter."""

    def found():
        folders = sorted((tmp_path / "logs").glob("gasp-worker-*"))
        return [log for folder in folders for log in (sorted(folder.glob("*.log")) or [folder])]

    return found


@pytest.fixture
def registry(monkeypatch):
    """What is installed, the frail engine included."""
    monkeypatch.syspath_prepend(FAKES / "frail")
    forget_fakes()
    yield discover()
    forget_fakes()


@pytest.fixture
def frail(registry):
    """The descriptor of the frail engine."""
    return registry.descriptor("frail")


@pytest.fixture
def problem():
    """A small cloud with a little of everything that has a direction or a default."""
    rng = np.random.default_rng(4)
    points = PointCloud(
        reference_positions=rng.normal(size=(50, 3)),
        initial_velocities=rng.normal(size=(50, 3)),
        reference_volumes=rng.uniform(1e-6, 1e-5, size=50),
        material_ids=np.zeros(50),
        body_ids=np.zeros(50),
        tracer_positions=rng.normal(size=(7, 3)),
    )
    return PointProblem(points=points, materials=(Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3),))


@pytest.fixture
def opened(frail):
    """Open a session of an engine with these of its options."""

    def open_session(engine, problem, restart=None, **options):
        return engine.open(
            problem,
            device="cpu",
            precision=Precision.FLOAT64,
            seed=5,
            accuracy=EngineAccuracy(substep_fraction=0.3),
            options=frail.options(**options),
            restart=restart,
        )

    return open_session


@pytest.fixture
def isolated(registry):
    """The frail engine in processes of its own, one frame of which may take two seconds."""
    return open_worker(registry.offer("frail"), Limits(opening=60.0, frame=2.0))


@pytest.fixture
def told(tmp_path):
    """The file an engine notes its surroundings in, and a function that reads it."""
    note = tmp_path / "note"
    return note, lambda: pickle.loads(note.read_bytes())


@pytest.fixture
def gone():
    """Wait until processes are gone; whether they are."""

    def wait(*pids):
        deadline = time.monotonic() + SOON
        while any(_lives(pid) for pid in pids) and time.monotonic() < deadline:
            time.sleep(0.02)
        return not any(_lives(pid) for pid in pids)

    return wait


def _lives(pid):
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
