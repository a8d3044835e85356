"""Rigid bodies in Bullet: struck, blown, held, led, and those that start inside each other."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Driven,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    PointCloud,
    PointProblem,
    Rigid,
    SphereShape,
    Wind,
)

EVERYTHING = frozenset({Field.POSITIONS, Field.VELOCITIES})

G = 9.81


def fallen(kit, problem, times, **options):
    """Mean fall [m] at each time, and how many substeps it took."""
    start = problem.points.reference_positions
    falls, count = [], 0
    with kit.open(problem, **options) as session:
        for time in times:
            count += session.advance_to(time).substep_count
            falls.append(float((start - session.read(EVERYTHING).positions)[:, 2].mean()))
    return np.array(falls), count


def rigid_run(kit, times, step=1 / 240, **scene):
    """States of a rigid block of 1.4 kg about (0.05, 0.05, 0.55) m."""
    points = kit.block((1, 1, 1), 0.1, corner=(0, 0, 0.5))
    problem = kit.problem(points, 0.1, material=Rigid(density=1400.0), **scene)
    with kit.open(problem, substep=step) as session:
        for time in times:
            session.advance_to(time)
            yield points, session.read(EVERYTHING)


def test_rigid_bodies_are_struck_on_the_way(kit):
    """Bullet has no property for a velocity."""
    upper = BoxShape(center=(0.05, 0.05, 0.6), half_extents=(0.06, 0.06, 0.05))
    impulse = Impulse(region=upper, impulse=(0.7, 0, 0), start=0.1)
    (points, before), (_, after) = rigid_run(kit, (0.1, 0.2), drives=(impulse,), gravity=(0, 0, 0))
    np.testing.assert_allclose(before.positions, points, atol=1e-6)
    np.testing.assert_allclose(after.velocities.mean(axis=0), [0.5, 0, 0], atol=1e-5)
    # The upper half, whose points are 2.5 cm above the centre, is struck: m k^2 of eight points there is 2 m 0.025^2.
    spin = 0.7 * 0.025 / (1.4 * 2 * 0.025**2)
    arms = after.positions - after.positions.mean(axis=0)
    np.testing.assert_allclose(
        after.velocities - after.velocities.mean(axis=0), np.cross([0, spin, 0], arms), atol=spin * 0.05 * 0.05
    )


def test_rigid_bodies_are_blown(kit):
    wind = Wind(velocity=(2.0, -1.0, 0.5), drag=3.0)
    ((_, state),) = rigid_run(kit, (0.4,), force_fields=(wind,), gravity=(0, 0, 0))
    expected = np.broadcast_to(np.array(wind.velocity) * -np.expm1(-1.2), state.velocities.shape)
    np.testing.assert_allclose(state.velocities, expected, atol=1e-4)


def test_rigid_bodies_are_held_and_led_and_let_go(kit):
    region = SphereShape(center=(0.05, 0.05, 0.55), radius=0.2)
    pin = Pinned(region=region, end=0.1)
    drive = Driven(
        region=region, start=0.1, end=0.2, velocity=(1.0, 0, 0), angular_velocity=(0, 0, 5.0), center=(0, 0, 0)
    )
    pinned, led, free = rigid_run(kit, (0.1, 0.2, 0.3), drives=(pin, drive))
    points = pinned[0]
    np.testing.assert_allclose(pinned[1].positions, points, atol=1e-6)
    turn = np.array([[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]])
    np.testing.assert_allclose(led[1].positions, points @ turn.T + [0.1, 0, 0], atol=1e-6)
    speed = np.array([1.0, 0, 0]) + np.cross([0, 0, 5.0], (turn @ [0.05, 0.05, 0.55]))
    # Symplectic Euler, and a velocity that Bullet is shown as two places in float32.
    fallen = np.array([0, 0, -G * 0.1 * (0.1 + 1 / 240) / 2])
    np.testing.assert_allclose(
        free[1].positions.mean(axis=0), led[1].positions.mean(axis=0) + 0.1 * speed + fallen, atol=1e-4
    )


def test_rigid_bodies_stick_where_they_touch_what_is_sticky(kit):
    sticky = Collider(shape=HalfSpace(point=(0, 0, 0.3), normal=(0, 0, 1)), contact=ContactCondition.STICK)
    (points, falling), (_, stuck), (_, later) = rigid_run(kit, (0.15, 0.4, 0.5), colliders=(sticky,))
    # It is 0.2 m above, which it has fallen after 0.2 s; found to touch at the end of a step, after v dt at most.
    assert 0.1 < (points - falling.positions)[:, 2].mean() < 0.15
    lowest = stuck.positions[:, 2].min() - 0.025
    assert 0.3 - np.sqrt(2 * G * 0.2) / 240 - 1e-3 < lowest < 0.3 + 1e-3
    np.testing.assert_allclose(later.positions, stuck.positions, atol=1e-6)
    np.testing.assert_array_equal(later.velocities, 0.0)


def test_an_impulse_is_shared_by_soft_and_rigid_bodies(kit):
    points = kit.block((1, 1, 1), 0.1)
    cloud = PointCloud(
        reference_positions=np.concatenate([points, points + [1.0, 0, 0]]),
        initial_velocities=np.zeros((16, 3)),
        reference_volumes=np.full(16, 1.25e-4),
        material_ids=np.repeat([0, 1], 8),
        body_ids=np.repeat([0, 1], 8),
    )
    impulse = Impulse(region=SphereShape(center=(0, 0, 0), radius=9.0), impulse=(0, 8.0, 0), start=0.01)
    problem = PointProblem(
        points=cloud, materials=(kit.rubber, Rigid(density=3000.0)), drives=(impulse,), gravity=(0, 0, 0)
    )
    with kit.open(problem) as session:
        session.advance_to(0.02)
        kept = session.checkpoint()
        session.advance_to(0.03)
        state = session.read(EVERYTHING)
    np.testing.assert_allclose(state.velocities, np.broadcast_to([0, 2.0, 0], (16, 3)), atol=1e-4)
    with kit.open(problem, restart=kept) as session:
        session.advance_to(0.03)
        assert np.array_equal(session.read(EVERYTHING).positions, state.positions)


def test_rigid_bodies_that_start_inside_each_other_are_told_and_not_thrown_apart(kit):
    points = kit.block((1, 1, 1), 0.1)
    starts = (0.0, 0.05, 0.3, 0.6)
    cloud = PointCloud(
        reference_positions=np.concatenate([points + [start, 0, 0] for start in starts]),
        initial_velocities=np.repeat([[0.0, 0, 0], [0, 0, 0], [0, 0, 0], [-1.0, 0, 0]], 8, axis=0),
        reference_volumes=np.full(32, 1.25e-4),
        material_ids=np.zeros(32),
        body_ids=np.repeat([0, 1, 2, 3], 8),
    )
    problem = PointProblem(points=cloud, materials=(Rigid(density=700.0),), gravity=(0, 0, 0))
    with kit.open(problem) as session:
        report = session.advance_to(0.5)
        moved = session.read(EVERYTHING).positions - cloud.reference_positions
    assert [warning for warning in report.warnings if "rigid bodies 0 and 1 start inside each other" in warning]
    means = moved[:, 0].reshape(4, 8).mean(axis=1)
    # The last one pushes the others along. Bullet keeps momentum but for float32; what is thrown apart goes both ways.
    assert means.sum() == pytest.approx(-0.5, abs=1e-3)
    assert means.max() < 1e-3 and means.min() > -0.5
    assert means[2] < -0.05 and np.abs(moved[:, 1:]).max() < 0.01
