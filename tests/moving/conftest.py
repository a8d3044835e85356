import pytest
from splat_shells import SHAPES, shell

from gasp_core import EngineAccuracy, Reduction

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


@pytest.fixture
def recorded(scene_of, run, ball, tmp_path):
    """recorded(reduction) -> a run of a ball that flies apart as it spins: its points go on straight ahead."""

    def make(reduction, splat=None, **others):
        scene = scene_of(
            ball if splat is None else splat,
            reduction=reduction,
            angular_velocity=(1.0, 2.0, 3.0),
            velocity=(0.3, 0.0, 1.0),
            height=0.4,
            accuracy=EngineAccuracy(resolution=8),
            **others,
        )
        return run(scene, tmp_path / "a.gasp")

    return make
