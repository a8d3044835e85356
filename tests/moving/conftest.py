import dataclasses
import functools
import shutil
import zipfile

import flying_points
import pytest
from splat_shells import SHAPES, shell

from gasp_core import EngineAccuracy, Recording, Reduction, simulate

WAYS = {
    "all": ("free", Reduction(mode="all")),
    "cores": ("cores", Reduction(mode="cores", count=30)),
    "levels": ("cores", Reduction(mode="cores", count=60, levels=2)),
    "frames": ("cores", Reduction(mode="cores", count=30, transfer="frame")),
    "volume": ("volume", Reduction(mode="volume")),
}


@pytest.fixture(scope="session")
def ways():
    """How points may carry Gaussians: what a moving splat calls it, and what a scene says."""
    return WAYS


@pytest.fixture(scope="session")
def ball():
    return shell(SHAPES["sphere"], count=1_500)


@pytest.fixture(scope="session")
def flowing(scene_of, ball, tmp_path_factory):
    """flowing(material) -> a run of a ball of it that flies apart as it spins, which all tests share: to read."""

    @functools.cache
    def make(material):
        scene = scene_of(
            ball,
            reduction=Reduction(mode="volume"),
            material=material,
            angular_velocity=(1.0, 2.0, 3.0),
            velocity=(0.3, 0.0, 1.0),
            height=0.4,
            accuracy=EngineAccuracy(resolution=8),
        )
        engine = flying_points.descriptor()
        can = dataclasses.replace(engine.capabilities, materials=engine.capabilities.materials | {type(material)})
        engine = dataclasses.replace(engine, capabilities=can)
        out = tmp_path_factory.mktemp("flows") / "a.gasp"
        return simulate(scene, engine=(engine, flying_points.Ballistic()), out=out, progress=False)

    return make


@pytest.fixture(scope="session")
def flight(scene_of, run, ball):
    """flight(reduction, out) -> a run of a ball that flies apart as it spins: its points go on straight ahead."""

    def make(reduction, out, splat=None, *, frames=None, resume=False, **others):
        scene = scene_of(
            ball if splat is None else splat,
            reduction=reduction,
            angular_velocity=(1.0, 2.0, 3.0),
            velocity=(0.3, 0.0, 1.0),
            height=0.4,
            accuracy=EngineAccuracy(resolution=8),
            **others,
        )
        return run(scene, out, frames=frames, resume=resume)

    return make


@pytest.fixture(scope="session")
def flown(flight, tmp_path_factory):
    """flown(reduction) -> where such a run of the ball lies, which all tests share: to read and to copy."""

    @functools.cache
    def make(reduction):
        return flight(reduction, tmp_path_factory.mktemp("flights") / "a.gasp").path

    return make


@pytest.fixture
def recorded(flight, flown, tmp_path):
    """recorded(reduction) -> such a run of the test's own."""

    def make(reduction, splat=None, **others):
        if splat is not None or others:
            return flight(reduction, tmp_path / "a.gasp", splat, **others)
        return Recording.open(shutil.copytree(flown(reduction), tmp_path / "a.gasp"))

    return make


@pytest.fixture
def altered_zip():
    """altered_zip(source, target, name, change) -> the target: the same zip but for one file; None: without it."""

    def write(source, target, name, change):
        with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
            for member in old.namelist():
                if member != name:
                    new.writestr(member, old.read(member))
                elif change is not None:
                    new.writestr(member, change(old.read(member)))
        return target

    return write
