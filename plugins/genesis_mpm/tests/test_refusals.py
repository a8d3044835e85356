"""What Genesis would take without a word is refused before it sees it; none of this needs it."""

from __future__ import annotations

import importlib.util
import math

import numpy as np
import pytest
from gasp_genesis_mpm.engine import GenesisMpm, refuse_buried
from gasp_genesis_mpm.plugin import ENVIRONMENT, gasp_point_engines

from gasp_core.engine.contract import EngineAccuracy, PointCloud, PointProblem
from gasp_core.engine.forcing import Collider, Side
from gasp_core.engine.materials import Elastic, Fluid
from gasp_core.engine.shapes import BoxShape, HalfSpace
from gasp_core.errors import EngineEnvironmentError, SceneError

FLOOR = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
TANK = Collider(shape=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 1.0, 1.0)), side=Side.INSIDE)
SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)


def problem(positions, **scene) -> PointProblem:
    count = len(positions)
    points = PointCloud(
        reference_positions=positions,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, 1e-3),
        material_ids=np.zeros(count),
        body_ids=np.zeros(count),
    )
    return PointProblem(points=points, materials=(SOFT,), **scene)


@pytest.mark.parametrize(
    "attempt",
    [
        lambda: Elastic(density=1000.0, youngs_modulus=0.0, poissons_ratio=0.3),
        lambda: Elastic(density=1000.0, youngs_modulus=math.nan, poissons_ratio=0.3),
        lambda: Elastic(density=-1.0, youngs_modulus=1e5, poissons_ratio=0.3),
        lambda: Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.5),
        lambda: Fluid(density=1000.0, bulk_modulus=-1e5),
        lambda: EngineAccuracy(substep=0.0),
        lambda: EngineAccuracy(substep=math.nan),
        lambda: problem([[0.0, 0.0, 1.0]], gravity=(0.0, 0.0, math.nan)),
        lambda: problem([[0.0, 0.0, math.inf]]),
        lambda: Collider(shape=FLOOR.shape, friction=-0.1),
    ],
)
def test_numbers_that_mean_nothing_never_reach_genesis(attempt) -> None:
    with pytest.raises(SceneError):
        attempt()


def test_matter_that_starts_in_the_floor_is_refused_by_its_deepest_point() -> None:
    sunk = problem([[0.0, 0.0, 1.0], [0.0, 0.0, -0.3], [0.0, 0.0, -0.1]], colliders=(TANK, FLOOR))
    with pytest.raises(SceneError, match=r"point 1 starts 0\.3 m inside collider 2 \(plane\)"):
        refuse_buried(sunk, 0.1)


def test_matter_that_starts_outside_its_container_is_refused() -> None:
    with pytest.raises(SceneError, match=r"point 0 .* collider 1 \(box\)"):
        refuse_buried(problem([[1.2, 0.0, 0.0]], colliders=(TANK,)), 0.1)


def test_a_touch_within_half_a_cell_is_none() -> None:
    refuse_buried(problem([[0.0, 0.0, -0.049]], colliders=(FLOOR, TANK)), 0.1)


def test_without_genesis_the_engine_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(EngineEnvironmentError, match="gasp engines install genesis-mpm"):
        GenesisMpm()


def test_the_descriptor_says_what_its_environment_needs() -> None:
    (descriptor,) = gasp_point_engines()
    assert descriptor.environment is ENVIRONMENT
    assert any(package.startswith("genesis-world==") for package in ENVIRONMENT.packages)
    # Without it, an installation brings gigabytes of another one.
    assert any(package.startswith("torch==") for package in ENVIRONMENT.packages)
