"""What Genesis would take without a word is refused before it sees it; none of this needs it."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest
from gasp_genesis_mpm.engine import GenesisMpm
from gasp_genesis_mpm.plugin import ENVIRONMENT, gasp_point_engines
from gasp_genesis_mpm.starts import starts_inside

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
    with pytest.raises(SceneError, match=r"the deepest is point 1, start up to 0\.3 m inside collider 2 \(plane\)"):
        list(starts_inside(sunk, 0.1))


def test_matter_that_starts_outside_its_container_is_refused() -> None:
    with pytest.raises(SceneError, match=r"point 0, .* collider 1 \(box\)"):
        list(starts_inside(problem([[1.2, 0.0, 0.0]], colliders=(TANK,)), 0.1))


def test_a_touch_within_half_a_cell_is_none() -> None:
    assert not list(starts_inside(problem([[0.0, 0.0, -0.049]], colliders=(FLOOR, TANK)), 0.1))


@pytest.mark.parametrize("depth", [0.06, 3.0])
def test_a_hundredth_of_a_body_may_start_in_the_floor_and_is_told_of(depth: float) -> None:
    """A trained splat has such points."""
    column = np.linspace([0.0, 0.0, 0.1], [0.0, 0.0, 1.0], 100)
    column[17, 2] = -depth
    (told,) = starts_inside(problem(column, colliders=(FLOOR,)), 0.1)
    assert told.startswith(f"1 point(s), the deepest is point 17, start up to {depth:g} m inside collider 1 (plane)")
    column[18, 2] = -depth
    with pytest.raises(SceneError, match=r"^2 point\(s\).* 0\.02 of a body's mass"):
        list(starts_inside(problem(column, colliders=(FLOOR,)), 0.1))


def test_a_small_body_in_the_floor_does_not_hide_behind_a_large_one() -> None:
    column = np.linspace([0.0, 0.0, 0.1], [0.0, 0.0, 1.0], 300)
    column[0, 2] = -0.5
    scene = problem(column, colliders=(FLOOR,))
    assert list(starts_inside(scene, 0.1))
    alone = replace(scene, points=replace(scene.points, body_ids=np.minimum(np.arange(300), 1)))
    with pytest.raises(SceneError, match="1 of a body's mass"):
        list(starts_inside(alone, 0.1))


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
