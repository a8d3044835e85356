from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import flying_points
import numpy as np
import pytest

from gasp_core import Elastic, EngineChoice, Gaussians, RecordingChoice, Scene, SplatObject, simulate
from gasp_core.cli import rehearsing

HERE = Path(__file__).parent
FAKES = HERE / "fake_plugins"


@pytest.fixture(autouse=True)
def no_flush(monkeypatch):
    # A flush shows only when the power fails, and a busy disk takes seconds for the thousands of them here. What a
    # killed process leaves behind is tested in processes of their own, flushes and all.
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """Solids are kept for these tests alone, whatever the user's cache has; processes that they start see it too."""
    before = os.environ.get("GASP_CACHE")
    os.environ["GASP_CACHE"] = str(tmp_path_factory.mktemp("cache"))
    # Processes beside a run that compile what is compiled already would only be in the way.
    for part in rehearsing.PARTS:
        rehearsing.leave_mark(part)
    yield
    if before is None:
        del os.environ["GASP_CACHE"]
    else:
        os.environ["GASP_CACHE"] = before


@pytest.fixture(scope="session")
def data() -> Path:
    folder = Path(os.environ.get("GASP_DATA", HERE.parents[1] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real splats at {folder} (set GASP_DATA)")
    return folder


@pytest.fixture(scope="session")
def cloud():
    """Makes a small cloud of Gaussians in a unit ball, a different one for every seed."""

    def make(count: int = 40, seed: int = 0, degree: int = 0) -> Gaussians:
        rng = np.random.default_rng(seed)
        return Gaussians(
            means=rng.normal(size=(count, 3)) / 3,
            quaternions=rng.normal(size=(count, 4)),
            scales=np.exp(rng.uniform(-6, -2, size=(count, 3))),
            opacities=rng.uniform(0.2, 1, size=count),
            harmonics=rng.normal(size=(count, (degree + 1) ** 2, 3)).astype(np.float32),
        )

    return make


@pytest.fixture(scope="session")
def scene_of(cloud):
    """Makes a scene of one falling object; options go to the engine of the tests."""

    def make(splat=None, *, duration=0.4, frame_rate=25.0, options=None, recording=None, **others) -> Scene:
        item = {
            "name": "thing",
            "splat": cloud() if splat is None else splat,
            "material": Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3),
        }
        scene = {key: others.pop(key) for key in list(others) if key in Scene.__dataclass_fields__}
        return Scene(
            duration=duration,
            frame_rate=frame_rate,
            objects=(SplatObject(**(item | others)),),
            engine=EngineChoice(name="ballistic", options=options or {}),
            recording=recording or RecordingChoice(checkpoint_frames=2),
            **scene,
        )

    return make


@pytest.fixture(scope="session")
def run():
    """Runs a scene with the engine of the tests."""

    def go(scene, out, *, checkpoints=True, fields=None, **options):
        engine = (flying_points.descriptor(checkpoints=checkpoints, fields=fields), flying_points.Ballistic())
        return simulate(scene, engine=engine, out=out, progress=False, **options)

    return go


@pytest.fixture
def fake_module():
    """Import one module of a distribution of the tests, without installing the distribution."""

    def load(folder, name):
        spec = importlib.util.spec_from_file_location(name, FAKES / folder / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load
