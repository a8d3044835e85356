"""What bounces: it has no more energy afterwards, whatever friction does to it meanwhile."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigid_clouds import block, problem_of

from gasp_core.contract import BodyContact, Collider, EngineAccuracy, HalfSpace, Rigid
from gasp_core.stepping.rigid.bodies import rigid_bodies_of
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.rigid.world import RigidWorld

SIDE, GRAVITY = 0.05, 9.81
LEAPING = Rigid(density=1000.0, restitution=1.0)


def energies(world):
    """Kinetic and potential energy [J] of everything."""
    heights = world.state.places[:, 2]
    return float(world.state.kinetic_energies(world.bodies).sum() + GRAVITY * (world.bodies.masses @ heights))


@pytest.mark.parametrize("friction", [pytest.param(0.0, marks=pytest.mark.thorough), 0.5])
@pytest.mark.parametrize("spin", [pytest.param((0.0, 0.0, 0.0), marks=pytest.mark.thorough), (3.0, 4.0, 0.0)])
def test_a_block_that_bounces_for_three_seconds_gains_nothing(friction, spin):
    points = block((4, 3, 2), SIDE, (0.0, 0.0, 0.35))
    start = np.cross(spin, points - points.mean(axis=0))
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=friction)
    problem = problem_of([points], SIDE, [start], [LEAPING], gravity=(0.0, 0.0, -GRAVITY), colliders=(floor,))
    side = RigidSide.of(problem, None, "tested")
    first = energies(side.world)
    weight = GRAVITY * float(side.world.bodies.masses.sum())
    speed = np.sqrt(2 * first / side.world.bodies.masses.sum())
    found = []
    step = 5e-4
    accuracy = EngineAccuracy(spacing=SIDE, substep=step)
    with RigidSession(side, engine="tested", accuracy=accuracy, restart=None) as session:
        for time in np.linspace(0.05, 3.0, 60):
            session.advance_to(float(time))
            found.append(energies(side.world) - first)
    # Symplectic Euler keeps E - m g v dt / 2, so that E goes up and down by half of that of the greatest speed.
    swing = 0.5 * weight * speed * step
    assert max(found) <= 2 * swing
    if not friction and not any(spin):
        assert min(found) >= -2 * swing


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), friction=st.floats(0.0, 1.5))
def test_two_blocks_that_meet_keep_their_momenta_and_gain_no_energy(seed, friction):
    rng = np.random.default_rng(seed)
    parts = [block((3, 3, 3), SIDE), block((2, 4, 3), SIDE, (2.5 * SIDE, *rng.uniform(-0.05, 0.05, 2)))]
    speeds = [np.array(way) + rng.normal(0.0, 0.3, 3) for way in ((1.0, 0, 0), (-1.0, 0, 0))]
    starts = [v + np.cross(rng.normal(0.0, 8.0, 3), part - part.mean(axis=0)) for v, part in zip(speeds, parts)]
    touching = BodyContact(friction=friction)
    problem = problem_of(parts, SIDE, starts, [LEAPING] * 2, gravity=(0.0, 0.0, 0.0), body_contact=touching)
    world = RigidWorld.of(problem, rigid_bodies_of(problem), None, "tested")
    # Where they are pushed: in the end what overlaps is moved apart, which turns what is measured about one place.
    places = world.state.places

    def moving():
        straight = world.bodies.masses[:, None] * world.state.velocities
        return straight.sum(axis=0), (world.state.spins + np.cross(places, straight)).sum(axis=0)

    energy, (momentum, turning) = world.state.kinetic_energies(world.bodies).sum(), moving()
    world.step(0.0, 1e-5)
    after, (straight, turned) = world.state.kinetic_energies(world.bodies).sum(), moving()
    # What turns freely keeps its energy but for the square of the angle of a step, some 1e-4.
    assert after <= energy * (1 + 1e-8)
    # Each push is given and taken at one place.
    scale = float(world.bodies.masses.sum()) * 10
    np.testing.assert_allclose(straight, momentum, atol=1e-12 * scale)
    np.testing.assert_allclose(turned, turning, atol=1e-12 * scale)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("cells", [(4, 4, 4), (5, 4, 2)])
@pytest.mark.parametrize("away", [(0.0, 0.0), (5.0, -3.0), (1000.0, 0.0)])
def test_friction_takes_its_share_of_what_stops_and_throws_back_a_block_wherever_it_lands(restitution, cells, away):
    friction, step = 0.4, 5e-4
    center = (away[0] * SIDE, away[1] * SIDE, 0.5 * cells[2] * SIDE + 1e-5)
    points = block(cells, SIDE, center)
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=friction)
    bouncing = Rigid(density=800.0, restitution=restitution)
    start = np.array([1.0, 0.3, -1.0])
    gravity = (0.0, 0.0, -GRAVITY)
    problem = problem_of([points], SIDE, [start], [bouncing], gravity=gravity, colliders=(floor,))
    world = RigidWorld.of(problem, rigid_bodies_of(problem), None, "tested")
    world.step(0.0, step)
    given = world.state.velocities[0] - start - step * np.array(gravity)
    assert given[2] > 0.9 * (1 + restitution)
    # Every contact is found to a hundred thousandth of what gravity gives in a step, some tens of them.
    tolerance = 50 * 1e-5 * GRAVITY * step
    np.testing.assert_allclose(given[:2], -friction * given[2] * start[:2] / np.linalg.norm(start[:2]), atol=tolerance)
    # It stands on all of its base, and so goes on without a turn.
    np.testing.assert_allclose(world.state.angular_velocities(world.bodies), 0.0, atol=tolerance / SIDE)
