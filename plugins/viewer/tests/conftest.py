from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gasp_core import (
    Collider,
    Elastic,
    EngineChoice,
    Gaussians,
    HalfSpace,
    RecordingChoice,
    Scene,
    SplatObject,
    simulate,
)
from gasp_core.contract import BoxShape, Side, SphereShape
from gasp_core.rendering.footage import open_footage
from gasp_core.toy import make_toy

HERE = Path(__file__).parent


def _load_falling():
    # Test folders are no packages (importlib mode): the engine is found by its file.
    spec = importlib.util.spec_from_file_location("falling", HERE / "falling.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["falling"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def no_flush(monkeypatch):
    # A flush shows only when the power fails, and a busy disk takes seconds for the many of them here.
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture(scope="session")
def falling():
    return _load_falling()


@pytest.fixture(scope="session")
def data() -> Path:
    folder = Path(os.environ.get("GASP_DATA", HERE.parents[2].parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real splats at {folder} (set GASP_DATA)")
    return folder


@pytest.fixture(scope="session")
def toy() -> Gaussians:
    return make_toy(2000)


@pytest.fixture
def cloud():
    """Makes a small cloud of Gaussians of every shape, a different one for every seed."""

    def make(count: int = 60, seed: int = 0, degree: int = 0) -> Gaussians:
        rng = np.random.default_rng(seed)
        return Gaussians(
            means=rng.normal(size=(count, 3)) / 3,
            quaternions=rng.normal(size=(count, 4)),
            scales=np.exp(rng.uniform(-6, -2, size=(count, 3))),
            opacities=rng.uniform(0.2, 1, size=count),
            harmonics=rng.normal(size=(count, (degree + 1) ** 2, 3)).astype(np.float32) / 4,
        )

    return make


@pytest.fixture(scope="session")
def scene_of(falling):
    """Makes a scene of one object that falls and turns, by frames."""

    def make(splat, *, frames=6, velocities=False, **others) -> Scene:
        keys = Scene.__dataclass_fields__
        item = {"name": "toy", "splat": splat, "material": Elastic(density=500, youngs_modulus=1e5, poissons_ratio=0.3)}
        item |= {"angular_velocity": (0.0, 0.0, falling.TURN)}
        item |= {key: value for key, value in others.items() if key not in keys}
        scene = {"objects": (SplatObject(**item),)} | {key: value for key, value in others.items() if key in keys}
        return Scene(
            duration=(frames - 1) / 25,
            frame_rate=25,
            engine=EngineChoice(name="falling"),
            recording=RecordingChoice(velocities=velocities, checkpoint_frames=2),
            **scene,
        )

    return make


@pytest.fixture(scope="session")
def record(falling):
    """Runs a scene with the engine of the tests."""

    def go(scene, out, **options):
        return simulate(scene, engine=(falling.descriptor(), falling.Falling()), out=out, progress=False, **options)

    return go


@pytest.fixture(scope="session")
def toy_run(tmp_path_factory, toy, scene_of, record) -> Path:
    """A toy that falls towards a floor beside a ball, in a box, for six frames."""
    colliders = (
        Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),
        Collider(shape=SphereShape(center=(0.6, 0.4, 0.2), radius=0.2)),
        Collider(shape=BoxShape(center=(0, 0, 1), half_extents=(2, 2, 1)), side=Side.INSIDE),
    )
    out = tmp_path_factory.mktemp("runs") / "toy.gasp"
    record(scene_of(toy, position=(0, 0, 0.3), colliders=colliders), out)
    return out


class GatedRun:
    """A run in a process of its own, whose frames come when they are let."""

    def __init__(self, folder: Path) -> None:
        self.path, self._gate = folder / "run.gasp", folder / "gate"
        self._gate.mkdir()
        self.process = subprocess.Popen([sys.executable, HERE / "falling.py", self.path, self._gate])

    def let(self, last: int) -> None:
        """Let it go on to a frame, and wait until that is there."""
        for frame in range(1, last + 1):
            (self._gate / str(frame)).touch()
        deadline = time.monotonic() + 60
        while not (self.path / "commits" / f"{last:08d}" / "zarr.json").exists():
            assert self.process.poll() in (None, 0), "the run died"
            assert time.monotonic() < deadline, f"frame {last} does not come"
            time.sleep(0.02)

    def kill(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait()


@pytest.fixture
def gated_run(tmp_path):
    run = GatedRun(tmp_path)
    yield run
    run.kill()


@pytest.fixture
def toy_footage(toy_run):
    return open_footage(toy_run)
