from __future__ import annotations

import numpy as np
import pytest
from gasp_blender.options import BlenderOptions

from gasp_core.contract import Elastic, EngineAccuracy, PointCloud, PointProblem, Precision
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine
from gasp_core.errors import EngineEnvironmentError

RUBBER = Elastic(density=1000.0, youngs_modulus=1e4, poissons_ratio=0.25)


def block(cells, spacing, corner=(0.0, 0.0, 0.0)):
    """Points at the centres of half cells."""
    counts = 2 * np.asarray(cells)
    places = np.stack(np.meshgrid(*[np.arange(count) for count in counts], indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(corner) + (places + 0.5) * spacing / 2


def problem_of(positions, spacing, velocities=0.0, material=RUBBER, **scene):
    count = len(positions)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.broadcast_to(velocities, (count, 3)),
        reference_volumes=np.full(count, (spacing / 2) ** 3),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=points, materials=(material,), **scene)


class Kit:
    """What tests of the engine share."""

    block = staticmethod(block)
    problem = staticmethod(problem_of)
    rubber = RUBBER

    def __init__(self, engine):
        self.engine = engine

    def open(self, problem, spacing=0.1, *, restart=None, substep=None, **options):
        return self.engine.open(
            problem,
            device="cpu",
            precision=Precision.FLOAT32,
            seed=0,
            accuracy=EngineAccuracy(spacing=spacing, substep=substep),
            options=BlenderOptions(**options),
            restart=restart,
        )


@pytest.fixture
def bodies():
    return Kit(None)


@pytest.fixture(scope="session")
def kit():
    """The engine as users have it, in its own environment."""
    try:
        return Kit(open_engine(discover().offer("blender")))
    except EngineEnvironmentError as error:
        # Missing or outdated; one that is there and broken fails as a session is opened.
        pytest.skip(f"blender has no environment here: gasp engines install blender ({error})")
