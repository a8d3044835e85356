"""How fast what the grid does not see fades, and how full a grid looks beside walls."""

import numpy as np
import pytest

from gasp_core.contract import Elastic, Fluid, PointCloud, PointProblem, Sand
from gasp_core.stepping.flow import (
    CROWDING_DECAY,
    FLUID_SUBGRID_DECAY,
    SUBGRID_DECAY,
    WALL_REACH,
    crowding_decay,
    is_flowing,
    subgrid_decay,
    wall_share,
)
from gasp_core.stepping.time_step import rest_bound

WATER = Fluid(density=1000, bulk_modulus=1e5)
SAND = Sand(density=1600, youngs_modulus=1e6, poissons_ratio=0.2)
JELLY = Elastic(density=1000, youngs_modulus=1e4, poissons_ratio=0.3)


def test_rates_are_per_stable_step():
    for material, share in ((WATER, FLUID_SUBGRID_DECAY), (SAND, SUBGRID_DECAY)):
        assert is_flowing(material)
        assert subgrid_decay(material, 0.1) * rest_bound(material, 0.1) == pytest.approx(share)
    assert not is_flowing(JELLY)
    assert subgrid_decay(JELLY, 0.1) == 0


def problem(body_ids):
    count = len(body_ids)
    cloud = PointCloud(
        reference_positions=np.random.default_rng(0).random((count, 3)),
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.ones(count),
        material_ids=np.arange(count) % 2,
        body_ids=np.array(body_ids),
    )
    return PointProblem(points=cloud, materials=(WATER, JELLY))


def test_only_water_that_is_alone_in_its_body_is_kept_from_crowding():
    alone = problem([0, 1, 0, 1])
    assert crowding_decay(alone, 0, 0.1) * rest_bound(WATER, 0.1) == pytest.approx(CROWDING_DECAY)
    assert crowding_decay(alone, 1, 0.1) == 0
    assert crowding_decay(problem([0, 0, 0, 0]), 0, 0.1) == 0


def seen_of_a_half_space(distance, phase):
    """What points at a distance from its face see of matter that fills a half space, by way of nodes [cells]."""
    spline = lambda r: np.where(r < 0.5, 0.75 - r * r, 0.5 * np.maximum(1.5 - r, 0.0) ** 2)  # noqa: E731
    matter = -(np.arange(20000) + 0.5) / 2000
    nodes = np.arange(-12, 4) + phase
    masses = spline(np.abs(nodes[:, None] - matter)).sum(axis=1) / 2000
    return float(spline(np.abs(nodes + distance)) @ masses)


@pytest.mark.parametrize("distance", [0.0, 0.25, 0.5, 1.0, 1.5, 2.5])
def test_the_share_seen_beside_a_wall(distance):
    found = np.mean([seen_of_a_half_space(distance, phase) for phase in np.arange(8) / 8])
    assert found == pytest.approx(float(wall_share(np.array(distance))), abs=0.03)


def test_behind_a_wall_as_on_it_and_all_from_its_reach_on():
    np.testing.assert_array_equal(wall_share(np.array([-1.0, 0.0, WALL_REACH, 9.0])), [0.5, 0.5, 1.0, 1.0])


def test_what_is_viscous_loses_no_more_than_what_is_not() -> None:
    # Its steps are shorter, and what fades does so by the second.
    water = Fluid(density=1000.0, bulk_modulus=1e5)
    honey = Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1e3)
    assert rest_bound(honey, 0.01) < 0.1 * rest_bound(water, 0.01)
    assert subgrid_decay(honey, 0.01) == subgrid_decay(water, 0.01) == 1 / rest_bound(water, 0.01)
