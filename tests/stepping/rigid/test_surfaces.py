"""Smooth distances, and the surface of what is known by its points alone."""

import numpy as np
import pytest
from rigid_clouds import block, problem_of

from gasp_core.contract import BoxShape, SignedDistanceField, SphereShape
from gasp_core.stepping.body_shape import BodyShape
from gasp_core.stepping.rigid.bodies import rigid_bodies_of
from gasp_core.stepping.rigid.surfaces import RigidSurfaces, cubes_field, distances, rigid_surfaces_of

RADIUS = 0.1


def ball_field(nodes):
    shape = SphereShape(center=(0.0, 0.0, 0.0), radius=RADIUS)
    return SignedDistanceField.sampled(shape, (-RADIUS,) * 3, (RADIUS,) * 3, RADIUS / nodes)


def at(field, places):
    values = field.values.astype(np.float64).reshape(-1)
    shape, origin = np.array(field.values.shape), np.array(field.origin)
    return distances(values, 0, shape, origin, field.spacing, np.asarray(places, dtype=np.float64))


@pytest.mark.parametrize("nodes", [8, 16, 32])
def test_a_ball_is_round_and_a_quarter_of_a_spacing_squared_over_its_radius_too_small(nodes):
    surfaces = RigidSurfaces.of([ball_field(nodes)], np.zeros((1, 3)))
    radii = np.linalg.norm(surfaces.samples, axis=1)
    # Splines smooth f by h^2/8 times its second derivatives, whose sum is 2/R for the distance to a ball. The field is
    # in single precision, and the next term is h^4.
    inward = (RADIUS / nodes) ** 2 / (4 * RADIUS)
    assert np.abs(radii + inward - RADIUS).max() < 2.0 / nodes**4 * RADIUS + 1e-7
    outward = np.sum(surfaces.normals * surfaces.samples, axis=1) / radii
    assert outward.min() > 1 - 1 / nodes**4


def test_bends_are_those_of_the_surface():
    ball = RigidSurfaces.of([ball_field(16)], np.zeros((1, 3)))
    assert np.abs(ball.bends / RADIUS - 1).max() < 0.05
    box = SignedDistanceField.sampled(
        BoxShape(center=(0.0, 0.0, 0.0), half_extents=(0.2, 0.2, 0.2)), (-0.2,) * 3, (0.2,) * 3, 0.02
    )
    found = RigidSurfaces.of([box], np.zeros((1, 3)))
    middle = np.sort(np.abs(found.samples), axis=1)[:, 1] < 0.1
    assert found.bends[middle].min() > 100 * found.reaches.max()


def test_the_gradient_is_continuous_across_cells_and_that_of_the_distance():
    rng = np.random.default_rng(0)
    field = ball_field(8)
    places = rng.normal(size=(200, 3))
    places *= RADIUS / np.linalg.norm(places, axis=1, keepdims=True)
    found = at(field, places)
    step = 1e-6
    for axis in range(3):
        ahead, behind = (at(field, places + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        slope = (ahead[:, 0] - behind[:, 0]) / (2 * step)
        # Second derivatives jump by 1/R from cell to cell: half a step of that.
        np.testing.assert_allclose(slope, found[:, 1 + axis], atol=2 * step / RADIUS + 1e-8)
        assert np.abs(ahead[:, 1:] - found[:, 1:]).max() < 4 * step / RADIUS


def test_beyond_the_field_it_is_the_way_there():
    field = ball_field(8)
    found = at(field, [[3.0, 0.0, 0.0], [0.0, -2.0, 0.0]])
    np.testing.assert_allclose(found[:, 0], [2.9, 1.9], atol=1e-2)
    np.testing.assert_allclose(found[:, 1:], [[1, 0, 0], [0, -1, 0]], atol=1e-9)


@pytest.mark.parametrize("cells", [(10, 6, 4), (7, 5, 3), (16, 5, 3)])
def test_cubes_make_a_block(cells):
    side = 0.02
    points = block(cells, side, (0.1, 0.2, 0.3))
    problem = problem_of([points], side)
    field = cubes_field(problem.points, np.arange(len(points)))
    half = side * np.array(cells) / 2
    for axis in range(3):
        out = np.eye(3)[axis]
        places = [np.array([0.1, 0.2, 0.3]) + (half[axis] + off) * out for off in (-0.01, 0.0, 0.01)]
        np.testing.assert_allclose(at(field, places)[:, 0], [-0.01, 0.0, 0.01], atol=1e-7)


def test_cubes_that_are_not_quite_beside_each_other_are_one_body_without_gaps():
    side, rng = 0.02, np.random.default_rng(0)
    points = block((8, 8, 8), side)
    points = points + rng.uniform(-0.2, 0.2, points.shape) * side
    problem = problem_of([points], side)
    field = cubes_field(problem.points, np.arange(len(points)))
    found = at(field, rng.uniform(-0.07, 0.07, (500, 3)))
    assert found[:, 0].max() < 0
    surfaces = rigid_surfaces_of(problem, rigid_bodies_of(problem))
    assert np.abs(surfaces.samples).max(axis=1).min() > 0.07


def test_points_far_from_each_other_are_still_there():
    """Cubes that are smaller than a cell of the field."""
    points = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    problem = problem_of([points], 0.01)
    object.__setattr__(problem.points, "body_ids", np.zeros(2, dtype=np.int32))
    field = cubes_field(problem.points, np.arange(2))
    assert (field.values < 0).sum() >= 2


def test_a_known_shape_is_taken_before_the_points():
    points = block((4, 4, 4), 0.02)
    problem = problem_of([points], 0.02, hints=(BodyShape(body=0, shape=ball_field(8)),))
    surfaces = rigid_surfaces_of(problem, rigid_bodies_of(problem))
    assert np.linalg.norm(surfaces.samples, axis=1).min() > 0.9 * RADIUS


def underside(points, side):
    """Places (K, 2) [m] on the face of a block below, about its middle, and how far apart they are."""
    problem = problem_of([points], side)
    bodies = rigid_bodies_of(problem)
    surfaces = rigid_surfaces_of(problem, bodies)
    places = surfaces.samples - bodies.centers[0]
    return places[places[:, 2] < places[:, 2].min() + 0.02 * side, :2], float(surfaces.reaches[0])


@pytest.mark.parametrize("cells", [(4, 4, 4), (5, 4, 3), (16, 9, 4)])
@pytest.mark.parametrize("away", [(0.0, 0.0), (5.0, -3.0), (1000.0, 0.0), (0.31, 0.77)])
def test_a_block_stands_on_all_of_its_base_to_both_sides_wherever_it_is(cells, away):
    side = 0.025
    found, apart = underside(block(cells, side, (away[0] * side, away[1] * side, 0.0)), side)
    half = np.array(cells[:2]) * side / 2
    # Edges are rounded by three quarters of a cell of the field, which is half a point's.
    assert (found.max(axis=0) > half - 0.375 * side - apart).all()
    # Rounding of where it is, and what is as far as that.
    np.testing.assert_allclose(found.min(axis=0), -found.max(axis=0), rtol=0, atol=1e-5 * side)
    here, _ = underside(block(cells, side), side)
    assert len(found) == len(here)
    np.testing.assert_allclose(found, here, rtol=0, atol=1e-5 * side)
