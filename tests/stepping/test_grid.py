"""Where the grid's nodes lie: by planes where there are any, by the cloud elsewhere."""

import numpy as np
import pytest

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Elastic,
    Fluid,
    HalfSpace,
    PointCloud,
    PointProblem,
    Side,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.grid import GridAnchor, grid_node

SPACING = 0.1


def problem_with(*colliders, anchor=None, material=None):
    positions = np.array([[0.0, 0.0, 1.0], [0.4, 0.2, 1.6]])
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.zeros((2, 3)),
            reference_volumes=np.ones(2),
            material_ids=np.zeros(2),
            body_ids=np.zeros(2),
        ),
        materials=(material or Elastic(density=1, youngs_modulus=1, poissons_ratio=0.3),),
        colliders=colliders,
        hints=() if anchor is None else (GridAnchor(place=anchor),),
    )


def plane(normal, contact):
    return Collider(shape=HalfSpace(point=(0.03, 0.03, 0.03), normal=normal), contact=contact)


def test_without_planes_the_middle_of_the_cloud():
    np.testing.assert_allclose(grid_node(problem_with(), SPACING), [0.2, 0.1, 1.3])


@pytest.mark.parametrize("contact", [ContactCondition.STICK, ContactCondition.SLIP])
def test_on_a_plane_that_holds_both_ways(contact):
    np.testing.assert_allclose(grid_node(problem_with(plane((0, 0, -1), contact)), SPACING), [0.2, 0.1, 0.03])


def test_half_a_cell_off_a_plane_that_matter_may_leave():
    first = plane((1, 0, 0), ContactCondition.SEPARATE)
    second = plane((-1, 0, 0), ContactCondition.STICK)
    slanted = plane((0, 1, 1), ContactCondition.STICK)
    np.testing.assert_allclose(grid_node(problem_with(first, second, slanted), SPACING), [0.08, 0.1, 1.3])


def test_on_a_plane_that_a_fluid_fills_up_to():
    water = problem_with(plane((0, 0, 1), ContactCondition.SEPARATE), material=Fluid(density=1, bulk_modulus=1))
    np.testing.assert_allclose(grid_node(water, SPACING), [0.2, 0.1, 0.03])


def test_a_box_around_the_scene_is_planes_and_one_within_it_is_none():
    box = BoxShape(center=(0.2, 0.2, 1.2), half_extents=(0.33, 0.33, 0.64))
    around, within = (Collider(shape=box, side=side) for side in (Side.INSIDE, Side.OUTSIDE))
    np.testing.assert_allclose(grid_node(problem_with(around), SPACING), [-0.08, -0.08, 0.61])
    np.testing.assert_allclose(grid_node(problem_with(within), SPACING), [0.2, 0.1, 1.3])


def test_from_the_anchor_where_there_is_one_but_for_planes():
    floor = plane((0, 0, 1), ContactCondition.STICK)
    np.testing.assert_allclose(grid_node(problem_with(floor, anchor=(0.1, 0.7, 0.9)), SPACING), [0.1, 0.7, 0.03])


def test_an_anchor_that_is_no_place():
    with pytest.raises(SceneError, match=r"GridAnchor\.place"):
        problem_with(anchor=(0.0, float("nan"), 0.0))
