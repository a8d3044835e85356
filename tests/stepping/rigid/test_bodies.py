"""Masses, moments, and motion while nothing touches a body."""

import numpy as np
import pytest
from rigid_clouds import block, problem_of

from gasp_core.contract import Elastic, Rigid
from gasp_core.errors import SceneError
from gasp_core.stepping.rigid.bodies import RigidState, moved, rigid_bodies_of

SIDE = 0.02
SPIN = np.array([9.0, 4.0, 6.0])


def tumbling(cells=(10, 6, 2)):
    points = block(cells, SIDE, (0.3, -0.2, 5.0))
    velocity = np.array([0.3, 0.1, -0.2]) + np.cross(SPIN, points - points.mean(axis=0))
    problem = problem_of([points], SIDE, [velocity])
    bodies = rigid_bodies_of(problem)
    return problem, bodies, RigidState.at_rest(bodies, problem.points.initial_velocities)


def test_a_block_of_cubes_has_the_moments_of_a_block():
    _, bodies, _ = tumbling()
    a, b, c = (count * SIDE for count in (10, 6, 2))
    mass = 500.0 * a * b * c
    closed = np.sort(mass / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b]))
    np.testing.assert_allclose(bodies.masses, [mass], rtol=1e-13)
    np.testing.assert_allclose(np.sort(bodies.moments[0]), closed, rtol=1e-12)
    assert np.linalg.det(bodies.axes[0]) == pytest.approx(1.0)


def test_it_starts_as_its_points_do():
    problem, bodies, state = tumbling()
    np.testing.assert_allclose(state.positions(bodies), problem.points.reference_positions, atol=1e-14)
    np.testing.assert_allclose(state.point_velocities(bodies), problem.points.initial_velocities, atol=1e-12)
    np.testing.assert_allclose(state.angular_velocities(bodies), [SPIN], rtol=1e-12)


def test_one_point_alone_has_a_velocity_and_no_spin():
    problem = problem_of([np.array([[1.0, 2.0, 3.0]])], SIDE, [np.array([1.0, 0.0, 0.0])])
    bodies = rigid_bodies_of(problem)
    state = RigidState.at_rest(bodies, problem.points.initial_velocities)
    np.testing.assert_allclose(state.velocities, [[1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(state.spins, 0.0)
    assert (bodies.moments > 0).all()


@pytest.mark.thorough
def test_a_hundred_turns_leave_it_rigid_and_keep_its_momenta():
    problem, bodies, state = tumbling()
    start, spins, energy = problem.points.reference_positions, state.spins, state.kinetic_energies(bodies)
    time = 100 * 2 * np.pi / np.linalg.norm(SPIN)
    for _ in range(20_000):
        state = moved(bodies, state, time / 20_000)
    found = state.positions(bodies)
    before, after = (np.linalg.norm(places - places[0], axis=1)[1:] for places in (start, found))
    # The rotation is made from a unit quaternion: a rounding or two of each place.
    assert np.abs(after / before - 1).max() < 1e-12
    # Every step rounds them once, at random: sqrt(2e4) ulp, times a few for the two ways through the rotation.
    assert np.abs(state.spins - spins).max() < 1e-12 * np.abs(spins).max()
    assert np.abs(state.kinetic_energies(bodies) / energy - 1).max() < 1e-4
    np.testing.assert_allclose(state.places, bodies.centers + time * state.velocities, atol=1e-9)


def test_the_error_of_a_turn_is_of_the_second_order():
    _, bodies, start = tumbling()

    def after(steps):
        state = start
        for _ in range(steps):
            state = moved(bodies, state, 0.5 / steps)
        return state.rotations

    exact = after(8192)
    errors = [np.abs(after(steps) - exact).max() for steps in (32, 64, 128)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.9).all()


def test_what_is_rigid_in_part_is_refused():
    parts = [block((2, 2, 2), SIDE), block((2, 2, 2), SIDE, (1.0, 0.0, 0.0))]
    soft = Elastic(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3)
    problem = problem_of(parts, SIDE, materials=[Rigid(density=500.0), soft])
    object.__setattr__(problem.points, "body_ids", np.zeros(16, dtype=np.int32))
    with pytest.raises(SceneError, match="body 0 has points that are rigid and points that are not"):
        rigid_bodies_of(problem)


def test_without_anything_rigid_there_is_nothing():
    soft = Elastic(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3)
    assert rigid_bodies_of(problem_of([block((2, 2, 2), SIDE)], SIDE, materials=[soft])) is None
