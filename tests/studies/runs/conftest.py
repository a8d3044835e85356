import sys
import time
from pathlib import Path

import psutil
import pytest

from gasp_core import Elastic, EngineChoice, RecordingChoice, Sand, Scene, SplatObject
from gasp_core.discovery.registry import discover
from gasp_core.studies.runs import Run
from gasp_core.toy import make_toy

FAKES = Path(__file__).parents[2] / "fake_plugins"


@pytest.fixture(autouse=True)
def installed(monkeypatch, tmp_path):
    """The engines of the tests, found by the processes that are started here too."""
    for name in ("frail", "ballistic"):
        monkeypatch.syspath_prepend(FAKES / name)
    discover.cache_clear()
    logs = tmp_path / "logs"
    logs.mkdir()
    monkeypatch.setenv("TMPDIR", str(logs))
    yield
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture(scope="session")
def toy():
    return make_toy(64)


@pytest.fixture
def run_of(toy, tmp_path):
    """Makes a run of five frames of a small falling toy; options go to the engine."""

    def make(key, engine="frail", *, frames=None, sand=False, isolate=False, **options):
        material = (
            Sand(density=1500, youngs_modulus=1e5, poissons_ratio=0.3, friction_angle=35)
            if sand
            else Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3)
        )
        scene = Scene(
            duration=0.16,
            frame_rate=25,
            objects=(SplatObject(name="toy", splat=toy, height=0.3, material=material),),
            engine=EngineChoice(name=engine, options=options, isolate=isolate),
            recording=RecordingChoice(checkpoint_seconds=1e9),
        )
        return Run(key=key, scene=scene, out=tmp_path / f"{key}.gasp", frames=frames)

    return make


@pytest.fixture
def left_behind():
    """Commands of processes that, after a few seconds, are left that have been told of this folder."""

    def wait(folder):
        deadline = time.monotonic() + 5.0
        while (left := _told_of(folder)) and time.monotonic() < deadline:
            time.sleep(0.05)
        return left

    return wait


def _told_of(folder):
    found = []
    for process in psutil.process_iter(["cmdline", "environ", "status"]):
        known = process.info
        command = " ".join(known["cmdline"] or [])
        # joblib keeps its own processes for later.
        if known["status"] == psutil.STATUS_ZOMBIE or "loky" in command or "resource_tracker" in command:
            continue
        if str(folder) in command or str(folder) in (known["environ"] or {}).get("TMPDIR", ""):
            found.append(command)
    return found
