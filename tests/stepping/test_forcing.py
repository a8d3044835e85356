from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Driven,
    Elastic,
    HalfSpace,
    Impulse,
    Pinned,
    PointCloud,
    PointProblem,
    Side,
    SphereShape,
    Wind,
)
from gasp_core.stepping.forcing import (
    bodies_held,
    drives_at,
    force_fields_at,
    position_at_start,
    prescribed_velocities,
    problem_fingerprint,
    rotation_matrix,
    walls_of,
)
from gasp_core.stepping.grid import GridAnchor

BALL = SphereShape(center=(0, 0, 0), radius=1)
LED = Driven(region=BALL, start=0.5, velocity=(1, 0, 2), angular_velocity=(0.3, -2, 1), center=(0.1, 0.2, 0.3))


def test_a_window_has_its_start_and_not_its_end():
    wind = Wind(start=1.0, end=2.0)
    pinned, blow = Pinned(region=BALL, start=1.0, end=2.0), Impulse(region=BALL, start=1.0)
    for time, acts in ((0.999, False), (1.0, True), (1.999, True), (2.0, False)):
        assert force_fields_at([wind], time) == ([wind] if acts else [])
        assert drives_at([blow, pinned], time) == ([pinned] if acts else [])


@given(st.lists(st.floats(-10, 10), min_size=3, max_size=3))
def test_a_rotation_is_one(vector):
    turn = rotation_matrix(np.array(vector))
    # Some thirty roundings of numbers up to one.
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(turn @ vector, vector, atol=1e-13)
    assert np.linalg.det(turn) > 0


@pytest.mark.parametrize("time", [0.5, 0.8, 2.0])
def test_a_region_moves_with_its_drive_and_matter_at_the_drives_velocity(time):
    """Against the motion itself, and its difference quotient: an error of h^2 times the third power of the spin."""
    places = np.random.default_rng(0).normal(size=(20, 3))
    spin, center = np.array(LED.angular_velocity), np.array(LED.center)

    def moved(at):
        elapsed = at - LED.start
        return (places - center) @ rotation_matrix(spin * elapsed).T + center + np.array(LED.velocity) * elapsed

    np.testing.assert_allclose(position_at_start(LED, time, moved(time)), places, atol=1e-13)
    h = 1e-4
    slopes = (moved(time + h) - moved(time - h)) / (2 * h)
    np.testing.assert_allclose(prescribed_velocities(LED, time, 0.0, moved(time)), slopes, atol=1e-6)
    for step in (1e-6, 1e-3, 0.1, 1.0):
        onward = moved(time) + step * prescribed_velocities(LED, time, step, moved(time))
        np.testing.assert_allclose(onward, moved(time + step), atol=1e-13)
    pinned = Pinned(region=BALL)
    assert position_at_start(pinned, time, places) is places
    assert not prescribed_velocities(pinned, time, 1.0, places).any()


@given(st.integers(0, 10_000))
def test_a_hollow_box_is_six_walls(seed):
    draw = np.random.default_rng(seed)
    center, half = draw.normal(size=3), draw.uniform(0.1, 2, size=3)
    hollow = Collider(
        shape=BoxShape(center=tuple(center), half_extents=tuple(half)),
        side=Side.INSIDE,
        friction=0.3,
        contact=ContactCondition.SEPARATE,
    )
    places = center + draw.uniform(-2, 2, size=(50, 3)) * half
    walls = walls_of(hollow)
    assert len(walls) == 6 and {wall.friction for wall in walls} == {0.3}
    held = np.min([wall.shape.signed_distance(places) for wall in walls], axis=0)
    # Inside, matter is as far from the box as from the nearest of its walls.
    inside = (np.abs(places - center) <= half).all(axis=1)
    np.testing.assert_allclose(held[inside], -hollow.shape.signed_distance(places)[inside], atol=1e-12)
    assert (held[~inside] < 1e-12).all()
    solid = dataclasses.replace(hollow, side=Side.OUTSIDE)
    assert walls_of(solid) == [solid]


def test_a_fingerprint_knows_all_of_a_problem_but_its_hints():
    points = PointCloud(
        reference_positions=np.arange(6.0).reshape(2, 3),
        initial_velocities=np.zeros((2, 3)),
        reference_volumes=np.ones(2),
        material_ids=np.zeros(2),
        body_ids=np.zeros(2),
    )
    problem = PointProblem(points=points, materials=(Elastic(density=1, youngs_modulus=1, poissons_ratio=0.3),))
    own = problem_fingerprint(problem)
    assert own == problem_fingerprint(dataclasses.replace(problem, hints=(GridAnchor(place=(1, 2, 3)),)))
    positions = np.array(points.reference_positions)
    positions[1, 2] = np.nextafter(positions[1, 2], 9)
    for changed in (
        {"points": dataclasses.replace(points, reference_positions=positions)},
        {"points": dataclasses.replace(points, material_columns={"density": np.array([1.0, 2.0])})},
        {"points": dataclasses.replace(points, tracer_positions=np.zeros((1, 3)))},
        {"materials": (Elastic(density=1, youngs_modulus=1 + 2e-16, poissons_ratio=0.3),)},
        {"gravity": (0.0, 0.0, 0.0)},
        {"drives": (LED,)},
        {"colliders": (Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))),)},
    ):
        assert problem_fingerprint(dataclasses.replace(problem, **changed)) != own


def test_a_drive_holds_bodies_that_are_in_its_region_and_none_that_lie_against_it():
    region = Pinned(region=BoxShape(center=(0.0, 0.0, 0.0), half_extents=(1.0, 1.0, 0.1)))
    heights = np.array([-0.05, 0.05, 0.099, 0.3, 0.2, 0.4])
    bodies = np.array([0, 0, 1, 1, 2, 2])
    positions = np.stack([np.zeros(6), np.zeros(6), heights], axis=1)
    # Half of the cell that is a tenth: the first is deep in it, the second less than contact leaves, the third beside.
    assert bodies_held([region], 0.0, positions, bodies, 3, 0.1).tolist() == [[True, False, False]]
    positions[2, 2] = 0.06
    assert bodies_held([region], 0.0, positions, bodies, 3, 0.1).tolist() == [[True, True, False]]
    # In a thin region nothing is deep: half as deep as what is deepest will do.
    thin = Pinned(region=BoxShape(center=(0.0, 0.0, 0.05), half_extents=(1.0, 1.0, 0.012)))
    positions[2, 2] = 0.0618
    assert bodies_held([thin], 0.0, positions, bodies, 3, 0.1).tolist() == [[True, False, False]]


def test_what_a_drive_finds_of_a_body_does_not_depend_on_others_elsewhere():
    # No point is inside, but nodes may be: of a body that stands in the region's plane, the lowest ones.
    under = Pinned(region=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    own, beside, far = [0.0, 0.0, 0.025], [0.3, 0.0, 0.03], [6.0, 0.0, 4.0]
    assert bodies_held([under], 0.0, np.array([own]), np.array([0]), 1, 0.1).tolist() == [[True]]
    positions = np.array([own, beside, far])
    assert bodies_held([under], 0.0, positions, np.arange(3), 3, 0.1).tolist() == [[True, True, False]]
