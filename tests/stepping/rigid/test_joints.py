"""What sticks or slips: it keeps its distance, however long it spins, and what has not touched is free."""

import numpy as np
import pytest
from rigid_clouds import block, problem_of

from gasp_core.contract import (
    BodyContact,
    Collider,
    ContactCondition,
    EngineAccuracy,
    HalfSpace,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.stepping.body_shape import BodyShape
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.rigid.side import RigidSide

SIDE = 0.05
STICK = BodyContact(contact=ContactCondition.STICK)


def pair(gap=0.0, shift=0.0):
    """Two cubes beside each other along x, their points."""
    return [block((3, 3, 3), SIDE), block((3, 3, 3), SIDE, (3 * SIDE + gap, shift, shift / 2))]


def alone(parts, velocities=None, contact=STICK, restart=None, substep=5e-4, **rest):
    """Rigid bodies and a session of theirs, without weight where nothing else is said."""
    problem = problem_of(parts, SIDE, velocities, **{"gravity": (0.0, 0.0, 0.0), "body_contact": contact, **rest})
    side = RigidSide.of(problem, restart, "tested")
    accuracy = EngineAccuracy(spacing=2 * SIDE, substep=substep)
    return side.world, RigidSession(side, engine="tested", accuracy=accuracy, restart=restart)


def spinning(parts, spin):
    middle = np.concatenate(parts).mean(axis=0)
    return [np.cross(spin, part - middle) for part in parts]


def momenta(world):
    straight = world.bodies.masses[:, None] * world.state.velocities
    return np.concatenate([straight, world.state.spins + np.cross(world.state.places, straight)], axis=1).sum(axis=0)


@pytest.mark.parametrize(
    "spin, shift",
    [
        *(pytest.param((0, 0, 6.0), shift, marks=pytest.mark.thorough) for shift in (0.0, 0.08)),
        ((2.0, 3.0, 5.0), 0.0),
    ],
)
def test_two_that_stick_spin_as_one_for_four_seconds(spin, shift):
    parts, step = pair(shift=shift), 2e-3
    world, session = alone(parts, spinning(parts, spin), substep=step)
    start, before = world.state.places[1] - world.state.places[0], momenta(world)
    with session:
        session.advance_to(4.0)
    apart, after = world.state.places[1] - world.state.places[0], momenta(world)
    turned = np.linalg.norm(spin) * step
    # The cube of the angle of a step over twelve is what a chord of mean velocities leaves in each.
    assert np.linalg.norm(apart) / np.linalg.norm(start) == pytest.approx(1.0, abs=turned**3 / 12 * 4.0 / step)
    turns = world.state.angular_velocities(world.bodies)
    # What the solver stops at, 1e-5 of a mm/s in a step, over the arm of a cube.
    np.testing.assert_allclose(turns[0], turns[1], atol=1e-5 * 1e-3 * 200 / SIDE)
    scale = np.abs(before).max()
    np.testing.assert_allclose(after, before, atol=1e-10 * scale)


def test_what_has_not_touched_is_not_drawn_together_and_parts_freely():
    reach = float(alone(pair())[0].surfaces.reaches[0])
    for velocity in (0.0, 1.0):
        # Farther than a twentieth of a sample's reach, not farther than that and the way of a step.
        parts = pair(gap=0.06 * reach)
        assert 0.01 * reach < 5e-4
        world, session = alone(parts, [np.zeros(3), np.array([velocity, 0.0, 0.0])])
        places = world.state.places.copy()
        with session:
            session.advance_to(0.2)
        gone = (world.state.places - places)[:, 0]
        np.testing.assert_allclose(gone, [0.0, 0.2 * velocity], atol=1e-12)


def test_what_falls_onto_a_floor_that_holds_it_comes_down_to_it_and_stays():
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), contact=ContactCondition.STICK)
    world, session = alone(
        [block((3, 3, 3), SIDE, (0.0, 0.0, 0.4))],
        [np.array([1.0, 0.0, 0.0])],
        gravity=(0, 0, -9.81),
        colliders=(floor,),
    )
    with session:
        session.advance_to(0.4)
        place = world.state.places.copy()
        session.advance_to(1.0)
    # Nearer than a fiftieth of where it was going within a step, 1.2 mm: until now it was stopped that far above.
    assert place[0, 2] == pytest.approx(1.5 * SIDE, abs=1e-4)
    np.testing.assert_allclose(world.state.places, place, atol=1e-6)


def test_a_ball_that_spins_on_what_it_may_not_leave_stays_at_its_height():
    radius = 0.1
    ball = SphereShape(center=(0.0, 0.0, radius), radius=radius)
    field = SignedDistanceField.sampled(ball, (-radius, -radius, 0.0), (radius, radius, 2 * radius), radius / 16)
    points = block((4,) * 3, SIDE, ball.center)
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), contact=ContactCondition.SLIP)
    world, session = alone(
        [points],
        [np.cross([0.0, 20.0, 0.0], points - np.array(ball.center))],
        gravity=(0, 0, -9.81),
        colliders=(floor,),
        hints=(BodyShape(body=0, shape=field),),
    )
    with session:
        session.advance_to(1.0)
    # The surface is known to (radius / 16)^2 / (4 radius). As what turns with the floor it would sink by 10 mm.
    assert world.state.places[0, 2] == pytest.approx(radius, abs=2 * radius / 1024)


def test_it_goes_on_holding_after_a_checkpoint():
    parts = pair()
    velocities = spinning(parts, (0.0, 0.0, 6.0))
    world, session = alone(parts, velocities)
    with session:
        session.advance_to(0.2)
        kept = session.checkpoint()
        session.advance_to(0.3)
    again, session = alone(parts, velocities, restart=kept)
    with session:
        session.advance_to(0.3)
    np.testing.assert_array_equal(world.state.places, again.state.places)
