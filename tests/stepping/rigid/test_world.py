"""Rigid bodies among walls, drives, wind, impulses, and beside other matter."""

import dataclasses

import numpy as np
import pytest
from rigid_clouds import FLOOR, block, problem_of

from gasp_core.contract import (
    BoxShape,
    Domain,
    DomainPolicy,
    Driven,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    PointState,
    Rigid,
    SignedDistanceField,
    SphereShape,
    Status,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.body_shape import BodyShape
from gasp_core.stepping.rigid.bodies import RigidState, rigid_bodies_of
from gasp_core.stepping.rigid.contacts import NO_BODY, contacts_of
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.rigid.surfaces import rigid_surfaces_of
from gasp_core.stepping.rigid.world import RigidWorld
from gasp_core.stepping.rigid_motion import rotation_matrix

SIDE = 0.02
HERE = BoxShape(center=(0.0, 0.0, 0.5), half_extents=(0.2, 0.2, 0.2))


def session_of(problem, restart=None, **accuracy):
    side = RigidSide.of(problem, restart, "tested")
    accuracy = EngineAccuracy(spacing=2 * SIDE, **accuracy)
    return RigidSession(side, engine="tested", accuracy=accuracy, restart=restart)


def read(session):
    return session.read(frozenset(Field))


def cube(place=(0.0, 0.0, 0.5), cells=4):
    return block((cells,) * 3, SIDE, place)


def test_it_falls_and_comes_to_rest_on_the_floor():
    problem = problem_of([cube()], SIDE, colliders=(FLOOR,))
    with session_of(problem) as session:
        assert session.advance_to(1.0).status is Status.OK
        state = read(session)
    assert np.abs(state.velocities).max() < 1e-3
    # Half a point's cube, and the overlap that is left alone.
    assert state.positions[:, 2].min() == pytest.approx(SIDE / 2, abs=1e-4)


def test_a_ball_touches_a_plane_below_its_centre_and_a_ball_between_the_centres():
    radius = 0.1
    places = [(0.0, 0.0, radius), (0.13, 0.1, radius + 0.115)]
    balls = [SphereShape(center=place, radius=radius) for place in places]
    fields = [
        SignedDistanceField.sampled(ball, tuple(np.subtract(place, radius)), tuple(np.add(place, radius)), radius / 16)
        for ball, place in zip(balls, places)
    ]
    points = [cube(place) for place in places]
    hints = tuple(BodyShape(body=number, shape=field) for number, field in enumerate(fields))
    problem = problem_of(points, SIDE, hints=hints, colliders=(FLOOR,))
    bodies = rigid_bodies_of(problem)
    world = RigidWorld.of(problem, bodies, None, "tested")
    still = np.zeros((2, 3))
    found = contacts_of(problem, [FLOOR], bodies, rigid_surfaces_of(problem, bodies), world.state, still, 0.0, 1e-3)
    walls, others = found.second == NO_BODY, found.second != NO_BODY
    assert walls.any() and others.any()
    inward = (radius / 16) ** 2 / (4 * radius)
    best = found.gaps[walls].argmin()
    np.testing.assert_allclose(found.places[walls][best][:2], 0.0, atol=1e-4)
    assert found.gaps[walls][best] == pytest.approx(inward, rel=0.1)
    between = np.subtract(places[0], places[1])
    axis = between / np.linalg.norm(between)
    for first, normal in zip(found.first[others], found.normals[others]):
        np.testing.assert_allclose(normal, axis if first == 0 else -axis, atol=1e-3)
    apart = np.linalg.norm(between) - 2 * radius + 2 * inward
    np.testing.assert_allclose(found.gaps[others], apart, atol=1e-6)


def ball_on_a_slope(radius, slope, spacing):
    """A rigid ball on the floor, gravity being that of a slope [rad], and its acceleration [m/s^2] as it rolls."""
    ball = SphereShape(center=(0.0, 0.0, radius), radius=radius)
    field = SignedDistanceField.sampled(ball, (-radius, -radius, 0.0), (radius, radius, 2 * radius), radius / 16)
    points = block((4,) * 3, spacing, ball.center)
    points = points[ball.signed_distance(points) <= 0]
    gravity = (9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope))
    hints = (BodyShape(body=0, shape=field),)
    problem = problem_of([points], spacing, gravity=gravity, hints=hints, colliders=(FLOOR,))
    bodies = rigid_bodies_of(problem)
    share = float(bodies.moments.mean() / (bodies.masses[0] * radius**2))
    return problem, gravity[0] / (1 + share)


@pytest.mark.parametrize("radius", [0.1, 0.01, 0.001, 1e-4])
def test_a_ball_of_any_size_rolls_as_far_as_the_closed_form_says(radius):
    problem, pull = ball_on_a_slope(radius, 0.3, radius / 2)
    way = 10 * radius
    time = float(np.sqrt(2 * way / pull))
    accuracy = EngineAccuracy(spacing=radius / 2)
    side = RigidSide.of(problem, None, "tested")
    with RigidSession(side, engine="tested", accuracy=accuracy, restart=None) as session:
        steps = session.advance_to(time).substep_count
        gone = (read(session).positions - problem.points.reference_positions)[:, 0].mean()
    # Euler's rule adds a step to the time. The place of contact is off by 6e-4 of the radius at the most (see below),
    # by which weight acts with g cos beside g sin, and the surface is everywhere a thousandth too far in.
    assert gone / way == pytest.approx(1 + 1 / steps, abs=6e-4 / np.tan(0.3) + 1e-3)


def test_of_a_ball_that_rolls_fast_the_floor_meets_what_is_below_its_centre_however_it_is_turned():
    problem, _ = ball_on_a_slope(0.1, 0.0, 0.05)
    bodies = rigid_bodies_of(problem)
    surfaces = rigid_surfaces_of(problem, bodies)
    state = RigidState.at_rest(bodies, problem.points.initial_velocities)
    state = dataclasses.replace(state, velocities=np.array([[4.0, 0.0, 0.0]]))
    spins, step = np.array([[0.0, 40.0, 0.0]]), 5e-3
    turns = np.random.default_rng(5).normal(size=(100, 1, 4))
    for turn in turns / np.linalg.norm(turns, axis=2, keepdims=True):
        turned = dataclasses.replace(state, quaternions=turn)
        found = contacts_of(problem, [FLOOR], bodies, surfaces, turned, spins, 0.0, step)
        assert len(found)
        # In the step the ball turns by a fifth: what comes down then is that far ahead. The lowest place is a fifth of
        # the radius from a sample at the most, which is gone twice with a bend that is known to a twentieth.
        np.testing.assert_allclose(found.places[:, :2], np.tile(state.places[0, :2], (len(found), 1)), atol=6e-4 * 0.1)


def test_two_balls_that_touch_have_a_contact_however_they_are_turned():
    radius = 0.1
    balls = [SphereShape(center=(x, 0.0, 0.0), radius=radius) for x in (0.0, 2 * radius)]
    fields = [
        SignedDistanceField.sampled(
            ball, tuple(np.subtract(ball.center, radius)), tuple(np.add(ball.center, radius)), radius / 16
        )
        for ball in balls
    ]
    hints = tuple(BodyShape(body=number, shape=field) for number, field in enumerate(fields))
    problem = problem_of([cube(ball.center) for ball in balls], SIDE, hints=hints)
    bodies = rigid_bodies_of(problem)
    surfaces = rigid_surfaces_of(problem, bodies)
    state = RigidState.at_rest(bodies, problem.points.initial_velocities)
    turns = np.random.default_rng(5).normal(size=(100, 2, 4))
    for turn in turns / np.linalg.norm(turns, axis=2, keepdims=True):
        turned = dataclasses.replace(state, quaternions=turn)
        assert len(contacts_of(problem, [], bodies, surfaces, turned, np.zeros((2, 3)), 0.0, 5e-4))


def test_a_pinned_body_stands_and_a_driven_one_goes_where_it_is_told():
    drives = (
        Pinned(region=HERE, end=0.2),
        Driven(region=HERE, start=0.2, end=0.4, velocity=(1.0, 0, 0), angular_velocity=(0, 0, 2.0), center=(7, 1, 0.5)),
    )
    problem = problem_of([cube()], SIDE, drives=drives)
    start = problem.points.reference_positions
    with session_of(problem) as session:
        session.advance_to(0.2)
        np.testing.assert_allclose(read(session).positions, start, atol=1e-12)
        session.advance_to(0.4)
        found = read(session).positions
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    expected = (start - [7, 1, 0.5]) @ turn.T + [7.2, 1, 0.5]
    # Its centre goes along the chord of every step: there is rounding, and that the first step may begin a hair late.
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_what_comes_into_a_pinned_region_later_stands_still_there_until_the_drive_ends():
    region = BoxShape(center=(0.0, 0.0, 0.1), half_extents=(0.2, 0.2, 0.1))
    problem = problem_of([cube()], SIDE, drives=(Pinned(region=region, end=0.6),))
    fall = problem.points.reference_positions[:, 2].min() - 0.2
    speed, step = np.sqrt(2 * 9.81 * fall), 5e-4
    with session_of(problem, substep=step) as session:
        session.advance_to(0.2)
        np.testing.assert_allclose(read(session).velocities[:, 2], -9.81 * 0.2, rtol=1e-9)
        session.advance_to(0.4)
        state = read(session)
        # It is held from the step on that begins with a point in the region.
        assert 0.2 - 1.01 * speed * step <= state.positions[:, 2].min() <= 0.2
        assert not state.velocities.any()
        session.advance_to(0.6)
        np.testing.assert_allclose(read(session).positions, state.positions, atol=1e-12)
        session.advance_to(0.7)
        assert read(session).positions[:, 2].min() < 0.2 - 0.04


def test_a_driven_region_takes_along_what_it_runs_into():
    region = BoxShape(center=(-0.5, 0.0, 0.5), half_extents=(0.1, 0.2, 0.2))
    drive = Driven(region=region, velocity=(2.0, 0.0, 0.0))
    problem = problem_of([cube()], SIDE, drives=(drive,), gravity=(0, 0, 0))
    start = problem.points.reference_positions
    apart = start[:, 0].min() + 0.4
    step = 5e-4
    with session_of(problem, substep=step) as session:
        session.advance_to(0.4)
        state = read(session)
    np.testing.assert_allclose(state.velocities, np.tile([2.0, 0.0, 0.0], (len(start), 1)), atol=1e-12)
    # Within a step of when the region's face is where its nearest points are.
    gone = (state.positions - start)[:, 0]
    assert 0.8 - apart - 2.0 * step <= gone.min() <= gone.max() <= 0.8 - apart + 1e-12


def test_an_impulse_gives_what_it_says_and_turns_what_it_strikes_aside():
    points = cube()
    corner = BoxShape(center=(0.0, 0.04, 0.5), half_extents=(0.1, 0.02, 0.1))
    problem = problem_of([points], SIDE, drives=(Impulse(region=corner, impulse=(0.3, 0, 0)),), gravity=(0, 0, 0))
    with session_of(problem) as session:
        session.advance_to(1e-3)
        state = read(session)
    masses = problem.masses[:, None]
    np.testing.assert_allclose((masses * state.velocities).sum(axis=0), [0.3, 0, 0], atol=1e-12)
    arms = state.positions - state.positions.mean(axis=0)
    assert np.cross(arms, masses * state.velocities).sum(axis=0)[2] < 0


def test_wind_takes_it_along():
    problem = problem_of([cube()], SIDE, gravity=(0, 0, 0), force_fields=(Wind(velocity=(2.0, 0, 0), drag=3.0),))
    with session_of(problem, substep_fraction=0.1) as session:
        session.advance_to(0.2)
        speed = read(session).velocities[:, 0].mean()
    assert speed == pytest.approx(2 * (1 - np.exp(-0.6)), rel=1e-3)


def test_what_a_domain_holds_within_stays_within():
    domain = Domain(lower=(-0.1, -0.1, 0.0), upper=(0.1, 0.1, 1.0), policy=DomainPolicy.CLAMP)
    spinning = np.array([3.0, 1.0, 0.0]) + np.cross([0.0, 5.0, 9.0], cube() - cube().mean(axis=0))
    problem = problem_of([cube()], SIDE, [spinning], domain=domain)
    with session_of(problem) as session:
        for time in np.linspace(0.05, 1.0, 20):
            session.advance_to(float(time))
            places = read(session).positions
            assert (places >= np.array(domain.lower) - 1e-12).all()
            assert (places <= np.array(domain.upper) + 1e-12).all()


def test_it_goes_on_from_a_checkpoint_as_if_it_had_not_stopped():
    spinning = np.cross([3.0, 5.0, 9.0], cube() - cube().mean(axis=0))
    problem = problem_of([cube(), cube((0.05, 0.0, 0.62))], SIDE, [spinning, np.zeros(3)], colliders=(FLOOR,))
    with session_of(problem) as session:
        session.advance_to(0.3)
        kept = session.checkpoint()
        session.advance_to(0.6)
        whole = read(session)
    with session_of(problem, kept) as session:
        session.advance_to(0.6)
        again = read(session)
    np.testing.assert_array_equal(whole.positions, again.positions)
    np.testing.assert_array_equal(whole.velocities, again.velocities)


def test_a_checkpoint_of_other_bodies_is_refused():
    problem = problem_of([cube()], SIDE)
    with session_of(problem) as session:
        kept = session.checkpoint()
    with pytest.raises(SceneError):
        RigidSide.of(problem_of([cube(), cube((1.0, 0, 0))], SIDE), kept, "tested")


def test_tracers_ride_along():
    tracers = cube()[:5] + [0.0, 0.0, 0.03]
    spinning = np.cross([0.0, 0.0, 9.0], cube() - cube().mean(axis=0))
    problem = problem_of([cube()], SIDE, [spinning], tracers=tracers)
    with session_of(problem) as session:
        session.advance_to(0.1)
        state = read(session)
    before = np.linalg.norm(tracers[:, None] - problem.points.reference_positions, axis=2)
    after = np.linalg.norm(state.tracer_positions[:, None] - state.positions, axis=2)
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_other_matter_is_a_problem_of_its_own_and_is_put_back_where_it_was():
    soft = Elastic(density=300.0, youngs_modulus=1e5, poissons_ratio=0.3)
    parts = [cube(), cube((0.5, 0, 0.5), 3), cube((1.0, 0, 0.5), 2)]
    rigid = Rigid(density=500.0)
    problem = problem_of(parts, SIDE, materials=[soft, rigid, soft], tracers=np.array([[0.5, 0, 0.5], [0.0, 0, 0.5]]))
    side = RigidSide.of(problem, None, "tested")
    assert len(side.soft.points) == 64 + 8
    assert side.soft.materials == (soft, soft)
    np.testing.assert_array_equal(np.unique(side.soft.points.body_ids), [0, 1])
    np.testing.assert_array_equal(side.soft_bodies, [0, 2])
    np.testing.assert_allclose(side.soft.points.tracer_positions, [[0.0, 0, 0.5]])
    aside = PointState(
        time=0.0,
        positions=side.soft.points.reference_positions + 1.0,
        velocities=np.ones((72, 3)),
        deformation_gradients=np.tile(2 * np.eye(3), (72, 1, 1)),
        tracer_positions=np.array([[7.0, 7.0, 7.0]]),
    )
    whole = side.state(0.0, frozenset(Field), aside)
    rows = problem.points.body_ids == 1
    np.testing.assert_allclose(whole.positions[~rows], problem.points.reference_positions[~rows] + 1.0)
    np.testing.assert_allclose(whole.positions[rows], problem.points.reference_positions[rows], atol=1e-14)
    np.testing.assert_allclose(whole.deformation_gradients[rows], np.tile(np.eye(3), (27, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(whole.tracer_positions, [[0.5, 0, 0.5], [7.0, 7.0, 7.0]], atol=1e-14)


def test_what_begins_deep_in_a_floor_comes_out_of_it_without_a_leap():
    problem = problem_of([cube((0.0, 0.0, -0.01))], SIDE, colliders=(FLOOR,))
    with session_of(problem) as session:
        session.advance_to(0.02)
        moved = (read(session).positions - problem.points.reference_positions)[:, 2].mean()
        assert 0 < moved < 0.01
        session.advance_to(2.0)
        state = read(session)
    assert state.positions[:, 2].min() > SIDE / 2 - 1e-3
    assert np.abs(state.velocities).max() < 1e-2


def test_twice_is_the_same_to_the_last_bit():
    problem = problem_of(
        [cube((0.0, 0.0, 0.1)), cube((0.03, 0.01, 0.2)), cube((-0.02, 0.02, 0.3))],
        SIDE,
        colliders=(FLOOR, dataclasses.replace(FLOOR, shape=HalfSpace(point=(-0.1, 0, 0), normal=(1.0, 0, 0)))),
    )
    found = []
    for _ in range(2):
        with session_of(problem) as session:
            session.advance_to(0.25)
            found.append(read(session).positions)
    np.testing.assert_array_equal(*found)


def test_what_is_driven_is_turned_as_far_as_it_is_told_about_any_axis():
    """What turns freely about no principal axis would tumble."""
    slab = block((4, 10, 20), SIDE)
    spin, middle = np.array([3.0, 4.0, 5.0]), (1.0, 0.0, 0.0)
    everywhere = BoxShape(center=(0.0, 0.0, 0.0), half_extents=(9.0, 9.0, 9.0))
    drive = Driven(region=everywhere, angular_velocity=tuple(spin), center=middle)
    with session_of(problem_of([slab], SIDE, drives=(drive,), gravity=(0.0, 0.0, 0.0))) as session:
        assert session.advance_to(1.0).status is Status.OK
        state = read(session)
    wanted = (slab - middle) @ rotation_matrix(spin).T + middle
    np.testing.assert_allclose(state.positions, wanted, atol=1e-12)
    # Its middle goes along the chord of the step.
    turning = state.velocities - state.velocities.mean(axis=0)
    np.testing.assert_allclose(turning, np.cross(spin, wanted - wanted.mean(axis=0)), atol=1e-10)


@pytest.mark.parametrize(("speed", "drag"), [(20.0, 5.0), pytest.param(20.0, 50.0, marks=pytest.mark.thorough)])
def test_a_leaf_bears_a_storm(speed, drag):
    leaf = block((20, 20, 2), 5e-4)
    wind = Wind(velocity=(speed, 0.0, 0.0), drag=drag)
    problem = problem_of([leaf], 5e-4, force_fields=(wind,))
    side = RigidSide.of(problem, None, "tested")
    with RigidSession(side, engine="tested", accuracy=EngineAccuracy(resolution=64), restart=None) as session:
        assert session.advance_to(0.04).status is Status.OK
        state = read(session)
    # First order in a step, in which a body goes half a cell at most.
    np.testing.assert_allclose(state.velocities[:, 0].mean(), speed * -np.expm1(-0.04 * drag), rtol=0.02)


def test_winds_together_make_nothing_faster_than_the_air():
    wind = Wind(velocity=(1.0, 0.0, 0.0), drag=5000.0)
    with session_of(problem_of([cube()], SIDE, force_fields=(wind,) * 3, gravity=(0.0, 0.0, 0.0))) as session:
        assert session.advance_to(0.02).status is Status.OK
        np.testing.assert_allclose(read(session).velocities.mean(axis=0), [1.0, 0.0, 0.0], atol=1e-6)
