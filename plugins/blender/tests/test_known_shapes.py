"""Rigid bodies whose surface is known, and colliders without a formula: compounds of convex pieces in Bullet."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core.contract import (
    Collider,
    Field,
    HalfSpace,
    PointCloud,
    PointProblem,
    Rigid,
    Side,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.stepping.body_shape import BodyShape

EVERYTHING = frozenset({Field.POSITIONS, Field.VELOCITIES})
PLANE = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
RIGID = Rigid(density=1000.0)
H = 0.02


class Torus:
    """Lying, about (0, 0, 0.06)."""

    def signed_distance(self, places):
        return np.hypot(np.linalg.norm(places[:, :2], axis=1) - 0.2, places[:, 2] - 0.06) - 0.06


class Bowl:
    """Half a shell, open above."""

    def signed_distance(self, places):
        radius = np.linalg.norm(places - [0, 0, 0.6], axis=1)
        return np.max([radius - 0.6, 0.5 - radius, places[:, 2] - 0.6], axis=0)


def ball(center, radius=0.1):
    low, high = (tuple(np.array(center) + sign * radius) for sign in (-1, 1))
    return SphereShape(center=center, radius=radius), low, high


TORUS = Torus(), (-0.26, -0.26, 0.0), (0.26, 0.26, 0.12)


def problem_of(*solids, distance=0.02, lift=0.0, **scene):
    """Rigid bodies of shapes and the boxes around them, all lifted."""
    clouds, hints = [], []
    for number, (shape, lower, upper) in enumerate(solids):
        field = SignedDistanceField.sampled(shape, lower, upper, H)
        counts = np.ceil((np.array(upper) - lower) / distance).astype(int)
        places = (np.array(upper) + lower) / 2 + distance * (np.indices(counts).reshape(3, -1).T - (counts - 1) / 2)
        clouds.append(places[shape.signed_distance(places) < 0] + [0, 0, lift])
        x, y, z = field.origin
        lifted = SignedDistanceField(origin=(x, y, z + lift), spacing=field.spacing, values=field.values)
        hints.append(BodyShape(body=number, shape=lifted))
    places = np.concatenate(clouds)
    count = len(places)
    cloud = PointCloud(
        reference_positions=places,
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.full(count, distance**3),
        material_ids=np.zeros(count),
        body_ids=np.repeat(np.arange(len(clouds)), [len(own) for own in clouds]),
    )
    return PointProblem(points=cloud, materials=(RIGID,), hints=tuple(hints), **scene)


def test_a_body_of_known_shape_rests_on_its_surface(kit):
    problem = problem_of(TORUS, lift=0.05, colliders=(Collider(shape=PLANE, friction=0.4),))
    with kit.open(problem) as session:
        session.advance_to(1.0)
        state = session.read(EVERYTHING)
    gap = (state.positions - problem.points.reference_positions)[:, 2].mean() + 0.05
    # A third of a voxel is what was asked for. The surface is found on the edges of the grid, and may go lower between
    # them by H^2 / 4 R: a tenth of a voxel. Bullet leaves what it may leave, a few tenths of a millimetre.
    assert abs(gap) <= H / 3
    assert np.abs(state.velocities).max() < 1e-2


def test_what_is_smaller_than_a_hole_falls_through_it(kit):
    floor = Collider(shape=PLANE, friction=0.4)
    problem = problem_of(TORUS, ball((0.0, 0.0, 0.35)), colliders=(floor,))
    with kit.open(problem) as session:
        warnings = session.advance_to(0.01).warnings
        session.advance_to(1.0)
        state = session.read(EVERYTHING)
    assert not warnings
    of_ball = problem.points.body_ids == 1
    # It rests on the floor in the middle, where a hull would have been closed at 0.12.
    assert state.positions[of_ball, 2].mean() == pytest.approx(0.1, abs=H / 3)
    moved = (state.positions - problem.points.reference_positions)[~of_ball]
    assert np.abs(moved).max() < H / 3


def test_a_block_slides_on_a_field_as_coulomb_says(kit):
    field = SignedDistanceField.sampled(PLANE, (-1, -1, -0.5), (2, 2, 0.5), 0.05)
    points = kit.block((1, 1, 1), 0.1)
    speed, friction, step = 1.0, 0.4, 1 / 240
    problem = kit.problem(
        points, 0.1, (speed, 0, 0), material=RIGID, colliders=(Collider(shape=field, friction=friction),)
    )
    with kit.open(problem, substep=step) as session:
        session.advance_to(0.6)
        state = session.read(EVERYTHING)
    way = (state.positions - points)[:, 0].mean()
    # Symplectic Euler is v dt / 2 off; the first contact is found a step late, or two.
    assert way == pytest.approx(speed**2 / (2 * friction * 9.81), abs=2.5 * speed * step)
    assert state.positions[:, 2].min() == pytest.approx(0.025, abs=1e-3)


def test_a_ball_that_falls_into_a_bowl_stays_in_it(kit):
    bowl = SignedDistanceField.sampled(Bowl(), (-0.6, -0.6, 0.0), (0.6, 0.6, 0.6), 0.05)
    problem = problem_of(ball((0.1, 0.05, 0.5), 0.15), distance=0.03, colliders=(Collider(shape=bowl),))
    with kit.open(problem) as session:
        for time in np.linspace(0, 1.0, 11)[1:]:
            session.advance_to(float(time))
            places = session.read(EVERYTHING).positions
            # Never through the wall, by more than a spacing of its field.
            assert bowl.signed_distance(places).min() > -0.05
    # Down in the hollow, which a hull around the bowl would have closed.
    assert 0.1 - 0.05 < places[:, 2].min() < 0.3


def test_the_inside_of_a_field_holds_a_rigid_body_in(kit):
    room, low, high = ball((0.0, 0.0, 0.5), 0.4)
    field = SignedDistanceField.sampled(room, low, high, 0.05)
    problem = problem_of(ball((0.0, 0.0, 0.5)), colliders=(Collider(shape=field, side=Side.INSIDE),))
    with kit.open(problem) as session:
        session.advance_to(0.01)
        early = session.read(EVERYTHING).positions
        for time in np.linspace(0, 1.0, 11)[1:]:
            session.advance_to(float(time))
            assert field.signed_distance(session.read(EVERYTHING).positions).max() < 0.0
    # It falls from the start: walls are no nearer than a spacing to where they are.
    fallen = (problem.points.reference_positions - early)[:, 2].mean()
    assert fallen == pytest.approx(9.81 * 0.01**2 / 2, abs=9.81 * 0.01 / 240)
