from __future__ import annotations

import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from gasp_mujoco_flex.engine import MujocoFlex
from gasp_mujoco_flex.plugin import MujocoOptions

from gasp_core.contract import (
    Collider,
    ContactCondition,
    Driven,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    PointCloud,
    Rigid,
    SphereShape,
    Status,
    Wind,
)
from gasp_core.errors import SceneError

SOFT = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
RIGID = Rigid(density=1000.0)
FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4)
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})


@pytest.mark.parametrize("elements", ["hexahedra", "tetrahedra"])
@pytest.mark.parametrize("material", [SOFT, RIGID], ids=["soft", "rigid"])
def test_what_is_dropped_lies_on_the_floor(block, opened, elements, material):
    problem = block(material, corner=(0, 0, 0.1), colliders=(FLOOR,))
    with opened(problem, elements=elements) as session:
        deepest, step = 0.0, 0.0
        for time in np.linspace(0, 1.5, 38)[1:]:
            report = session.advance_to(float(time))
            assert report.status is Status.OK
            step = max(step, report.largest_substep)
            deepest = min(deepest, float(session.read(MOVING).positions[:, 2].min()))
        state = session.read(MOVING)
    # A wall is met within a step; 1 mm is the softness of contacts.
    assert -deepest <= math.sqrt(2 * 9.81 * 0.1) * step + 1e-3
    # What still rings would not lift it by as much.
    assert np.linalg.norm(state.velocities, axis=1).max() < math.sqrt(2 * 9.81 * 1e-3)
    # The lowest points are half their distance above the bottom.
    assert state.positions[:, 2].min() == pytest.approx(0.025, abs=5e-3)


@pytest.mark.parametrize("damping", [{}, {"stiffness_damping": 0.01}, {"mass_damping": 2.0}], ids=str)
def test_a_soft_body_keeps_the_momenta_that_damping_leaves_it_in_long_steps(block, damping):
    # Turned by a fifth of a radian and stretched by a hundredth in each of 100 steps, in which sound crosses six cells.
    problem = block(replace(SOFT, **damping), (8, 6, 4), gravity=(0, 0, 0))
    arms = problem.points.reference_positions - problem.points.reference_positions.mean(axis=0)
    velocities = np.array([3.0, -1.0, 2.0]) + np.cross([4.0, 6.0, 3.0], arms) + arms * [0.5, -0.3, 0.1]
    problem = replace(problem, points=replace(problem.points, initial_velocities=velocities))
    moments: list[np.ndarray] = []
    with MujocoFlex().open(problem, accuracy=EngineAccuracy(spacing=0.1, substep=0.02)) as session:
        for number in range(101):
            assert session.advance_to(0.02 * number).status is Status.OK
            moments.append(np.concatenate(nodal_momenta(session)))
    start, size = moments[0], np.abs(moments[0]).max()
    # Backward Euler's p1 = p0 - a dt p1 of both, also of spin about a point that stays.
    left = (1 + 0.02 * problem.materials[0].mass_damping) ** -np.arange(101.0)
    # Each step rounds some hundred sums of as many nodes; a random walk of hundred steps, and a margin of ten.
    assert np.abs(np.array(moments) - left[:, None] * start).max() <= 1e-13 * 10 * size


def test_a_body_falls_as_its_damping_lets_it(block, opened):
    damping, time = 5.0, 1.0
    with opened(block(replace(SOFT, mass_damping=damping))) as session:
        step = session.advance_to(time).largest_substep
        fallen = session.read(MOVING).velocities.mean(axis=0)
    # Backward Euler is off by a dt / 2 a t exp(-a t) of where it leads to, which is g / a.
    exact = 9.81 / damping * -math.expm1(-damping * time)
    allowed = 1.05 * 9.81 / damping * damping * step / 2 * damping * time * math.exp(-damping * time)
    assert np.linalg.norm(fallen + [0, 0, exact]) <= allowed


def nodal_momenta(session):
    """Momentum, and angular momentum about the origin, of a session's nodes."""
    motion = session.held()
    state, model = motion._state, motion._model
    masses = model.nodal_masses[:, None] * model.units.mass
    return (masses * state.velocities).sum(axis=0), np.cross(state.places, masses * state.velocities).sum(axis=0)


def test_a_light_body_leaves_a_heavy_one_as_it_was_hit(block, opened):
    light, heavy = (block(Elastic(density=d, youngs_modulus=1e5, poissons_ratio=0.3), (4, 4, 4)) for d in (1.0, 1e3))
    places = light.points.reference_positions
    both = PointCloud(
        reference_positions=np.concatenate([places, places + [0, 0, 0.21]]),
        initial_velocities=np.repeat([(0.0, 0.0, 0.0), (0.0, 0.0, -1.0)], len(places), axis=0),
        reference_volumes=np.tile(light.points.reference_volumes, 2),
        material_ids=np.repeat([0, 1], len(places)),
        body_ids=np.repeat([0, 1], len(places)),
    )
    problem = replace(light, points=both, materials=light.materials + heavy.materials, gravity=(0, 0, 0))
    with opened(problem) as session:
        for frame in range(1, 6):
            session.advance_to(0.02 * frame)
        velocities = session.read(MOVING).velocities
    # (1 + e) M / (M + m) of the heavy one's speed, with a restitution from 0 to 1, and 2 % for swaying.
    assert 0.98 <= -velocities[: len(places), 2].mean() <= 2.02
    assert -velocities[len(places) :, 2].mean() == pytest.approx(1.0, abs=2.02e-3)


@pytest.mark.parametrize("order", ["turned about z", "another order"])
def test_contact_is_what_it_is_to_rounding(block, order):
    problem = block(SOFT, (6, 8, 4), corner=(0.05, 0.02, 0.001), velocity=(1.2, 0.5, -1.5), colliders=(FLOOR,))
    points, turn = problem.points, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rows, matrix = np.arange(len(points)), turn
    if order == "another order":
        rows, matrix = np.random.default_rng(3).permutation(len(points)), np.eye(3)
    changed = replace(
        points,
        reference_positions=points.reference_positions[rows] @ matrix.T,
        initial_velocities=points.initial_velocities[rows] @ matrix.T,
    )
    ends: list[np.ndarray] = []
    for cloud in (points, changed):
        accuracy = EngineAccuracy(spacing=0.1, substep=2e-3)
        with MujocoFlex().open(replace(problem, points=cloud), accuracy=accuracy) as session:
            session.advance_to(0.2)
            ends.append(session.read(MOVING).positions)
    plain, other = ends[0][rows], ends[1] @ matrix
    # MuJoCo finds the turn of a cell to 1e-9, and rounding decides in which iteration: that much of a step's strain.
    assert np.abs(plain - other).max() <= 100 * 1e-9 * 0.1 * 0.3


def test_matter_that_is_turned_inside_out_is_told_of(block, opened):
    problem = block(SOFT, (6, 6, 6), gravity=(0, 0, 0))
    arms = problem.points.reference_positions - 0.15
    crushed = replace(problem, points=replace(problem.points, initial_velocities=-1000 * arms * [1, 0, 0]))
    with opened(crushed) as session:
        told = [warning for frame in range(1, 11) for warning in session.advance_to(1e-3 * frame).warnings]
    assert any(re.search(r"\d+ of \d+ cells are turned inside out", each) for each in told)
    with opened(problem) as session:
        assert not session.advance_to(0.01).warnings


@pytest.mark.parametrize("elements", ["hexahedra", "tetrahedra"])
def test_a_column_is_compressed_by_its_weight(block, opened, elements):
    # nu = 0: the head sinks by rho g H^2 / 2 E. Stiff enough to stand: below E = 12 rho g H^3 / 7.84 b^2 = 3.8e5 Pa a
    # column of side b buckles (Greenhill 1881), as those of tetrahedra do, which are not symmetric.
    column = Elastic(density=1000.0, youngs_modulus=1e6, poissons_ratio=0.0)
    pin = Pinned(region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    problem = block(column, (4, 4, 20), drives=(pin,))
    with opened(problem, damping=0.02, elements=elements) as session:
        session.advance_to(1.0)
        sunk = problem.points.reference_positions[:, 2] - session.read(MOVING).positions[:, 2]
    z = problem.points.reference_positions[:, 2]
    expected = 1000 * 9.81 / 1e6 * (z - z**2 / 2)
    # Linear cells interpolate u = H z - z^2 / 2 between nodes: h^2 / 8 too little at most; 1 % for the finite strain.
    assert np.abs(sunk - expected).max() <= 0.01 * expected.max() + 1000 * 9.81 / 1e6 * 0.1**2 / 8


def test_a_driven_rigid_body_is_where_it_is_driven(block, opened):
    drive = Driven(
        region=HalfSpace(point=(0, 0, 9), normal=(0, 0, 1)),
        velocity=(0.1, 0.0, 0.2),
        angular_velocity=(0.0, 0.0, 1.0),
        center=(0.2, 0.2, 0.2),
    )
    problem = block(RIGID, drives=(drive,))
    with opened(problem) as session:
        session.advance_to(0.5)
        found = session.read(MOVING).positions
    c, s = math.cos(0.5), math.sin(0.5)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    expected = (problem.points.reference_positions - 0.2) @ turn.T + [0.25, 0.2, 0.3]
    # Rotations of some dozen steps, each exact.
    assert np.abs(found - expected).max() < 1e-12


def momenta(problem, state):
    """Of points of equal mass, over it: their mean velocity, and their spin about their centre."""
    arms = state.positions - state.positions.mean(axis=0)
    speeds = state.velocities - state.velocities.mean(axis=0)
    return state.velocities.mean(axis=0), np.cross(arms, speeds).mean(axis=0)


def test_an_impulse_off_the_centre_pushes_and_turns_a_rigid_body(block, opened):
    upper = HalfSpace(point=(0, 0, 0.2), normal=(0, 0, -1))
    blow = Impulse(region=upper, impulse=(3.0, 0.0, 0.0), start=0.1)
    problem = block(RIGID, drives=(blow,), gravity=(0, 0, 0))
    mass = 1000 * 0.4**3
    with opened(problem) as session:
        session.advance_to(0.1)
        assert not session.read(MOVING).velocities.any()
        # One step of no length to speak of: it has been struck, and has not turned yet.
        session.advance_to(0.1 + 1e-9)
        pushed, spun = momenta(problem, session.read(MOVING))
    assert pushed == pytest.approx([3.0 / mass, 0, 0], rel=1e-9, abs=1e-12)
    # It acts on average in the middle of the upper half, 0.1 m above the centre. Each point is a cube that turns too:
    # that part of the spin, (d/a)^2 = 1/64 of it for points d apart in a body of side a, does not show in places.
    assert spun == pytest.approx([0, 0.1 * 3.0 / mass * (1 - 1 / 64), 0], rel=1e-6, abs=1e-12)


def test_a_rigid_body_takes_on_the_speed_of_the_wind(block, opened):
    wind = Wind(velocity=(2.0, 0.0, 1.0), drag=3.0)
    problem = block(RIGID, force_fields=(wind,), gravity=(0, 0, 0), velocity=(0.0, 1.0, 0.0))
    with opened(problem) as session:
        step = session.advance_to(0.5).largest_substep
        velocities = session.read(MOVING).velocities
    left = math.exp(-3.0 * 0.5)
    # Implicit Euler: (1 + k dt)^(-t/dt) = exp(-k t) (1 + k^2 t dt / 2 + ...).
    assert velocities == pytest.approx(
        np.tile([2.0 * (1 - left), left, 1 - left], (len(velocities), 1)), abs=2.0 * left * 3.0**2 * 0.5 * step
    )


def test_a_rigid_body_stays_where_it_met_a_sticky_floor(block, opened):
    floor = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), contact=ContactCondition.STICK)
    problem = block(RIGID, corner=(0, 0, 0.1), velocity=(1.0, 0.0, 0.0), colliders=(floor,))
    with opened(problem) as session:
        step = session.advance_to(0.3).largest_substep
        met = session.read(MOVING)
        session.advance_to(0.6)
        after = session.read(MOVING)
    assert np.array_equal(met.positions, after.positions)
    assert not after.velocities.any()
    # Its lowest points met the floor as they fell through it, within a step.
    assert abs(met.positions[:, 2].min()) <= math.sqrt(2 * 9.81 * 0.125) * step + 1e-3
    way = met.positions[:, 0].mean() - 0.2
    assert way == pytest.approx(math.sqrt(2 * 0.125 / 9.81), abs=2 * step)


@pytest.mark.parametrize("touching", [False, True])
def test_a_soft_body_meets_itself_by_choice(block, opened, touching):
    # One body in two pieces: the lower one is held, and the upper one falls 0.2 m onto it, or through it.
    problem = block(SOFT, (4, 4, 12))
    z = problem.points.reference_positions[:, 2]
    kept = (z < 0.2) | (z > 0.4)
    points = problem.points
    pieces = replace(
        problem,
        points=PointCloud(
            **{
                field.name: value[kept] if isinstance(value := getattr(points, field.name), np.ndarray) else value
                for field in fields(points)
            }
        ),
        drives=(Pinned(region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))),),
    )
    upper = pieces.points.reference_positions[:, 2] > 0.4
    with opened(pieces, self_collision=touching) as session:
        assert session.advance_to(0.27).status is Status.OK
        lowest = session.read(MOVING).positions[upper, 2].min()
    fallen = 0.425 - 0.5 * 9.81 * 0.27**2
    if touching:
        # It comes at 2 m/s to a piece that is pressed in by v H sqrt(rho / E) = 0.04 m.
        assert lowest > 0.2 - 0.05 > fallen + 0.05
    else:
        assert lowest == pytest.approx(fallen, abs=9.81 * 0.27 * 0.004)


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        (Pinned(region=SphereShape(center=(0.05, 0.05, 0.05), radius=0.01)), "drive .Pinned. reaches no node"),
        (Driven(region=SphereShape(center=(9.0, 9.0, 9.0), radius=0.1)), "drive .Driven. reaches no node"),
        (Impulse(region=SphereShape(center=(9.0, 9.0, 9.0), radius=0.1), impulse=(1, 0, 0)), "impulse reaches nothing"),
    ],
)
def test_a_drive_that_reaches_nothing_is_told_of_once(block, opened, drive, said):
    problem = block(SOFT, drives=(drive,))
    with opened(problem) as session:
        (warning,) = session.advance_to(0.01).warnings
        assert re.search(said, warning)
        assert not session.advance_to(0.02).warnings


def test_soft_and_rigid_touch(block, opened):
    below = block(SOFT, colliders=(FLOOR,))
    points = below.points
    both = replace(
        below,
        materials=(SOFT, RIGID),
        points=type(points)(
            reference_positions=np.concatenate([points.reference_positions, points.reference_positions + [0, 0, 0.42]]),
            initial_velocities=np.zeros((2 * len(points), 3)),
            reference_volumes=np.tile(points.reference_volumes, 2),
            material_ids=np.repeat([0, 1], len(points)),
            body_ids=np.repeat([0, 1], len(points)),
        ),
    )
    with opened(both) as session:
        for time in np.linspace(0, 0.8, 21)[1:]:
            assert session.advance_to(float(time)).status is Status.OK
        z = session.read(MOVING).positions[:, 2]
    soft, rigid = z[: len(points)], z[len(points) :]
    # It rests on the soft block, which bears twice its weight: rho g (1.5 H) H / E = 2.4 %.
    assert rigid.min() > soft.max() - 0.05
    assert np.ptp(soft) > 0.9 * 0.35


def test_a_checkpoint_goes_on_in_contact(block, opened):
    problem = block(SOFT, corner=(0, 0, 0.01), velocity=(0.3, 0, -1.0), colliders=(FLOOR,))
    with opened(problem) as session:
        session.advance_to(0.1)
        kept = session.checkpoint()
        session.advance_to(0.2)
        whole = session.read(MOVING)
    with opened(problem, restart=kept) as resumed:
        assert resumed.time == 0.1
        resumed.advance_to(0.2)
        state = resumed.read(MOVING)
    assert np.array_equal(whole.positions, state.positions)
    assert np.array_equal(whole.velocities, state.velocities)


def test_what_begins_inside_a_floor_is_not_thrown_out(block, opened):
    problem = block(SOFT, corner=(0, 0, -0.1), colliders=(FLOOR,))
    with opened(problem) as session:
        for time in np.linspace(0, 0.4, 11)[1:]:
            session.advance_to(float(time))
            # Nothing but its weight acts: no point is faster than a fall through a cell.
            assert np.abs(session.read(MOVING).velocities).max() < math.sqrt(2 * 9.81 * 0.1)


def test_cages_keep_to_their_limit_and_say_so(block, opened):
    problem = block(SOFT, (20, 20, 20))
    with opened(problem, 0.02, node_limit=200) as session:
        (warning,) = session.advance_to(0.01).warnings
        assert "no more than 200 nodes" in warning
        assert not session.advance_to(0.02).warnings
    with pytest.raises(SceneError, match="ask for fewer cells"):
        opened(problem, cells=10, node_limit=200)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"cells": -1}, "cells must be a whole number >= 0"),
        ({"node_limit": 1}, "node_limit must be a whole number >= 8"),
        ({"elements": "quadratic"}, "elements must be"),
        ({"damping": -0.1}, "damping must be >= 0"),
        ({"damping": math.nan}, "damping must be finite"),
        ({"body_friction": -1.0}, "body_friction must be >= 0"),
        ({"filled": 1}, "filled must be true or false"),
    ],
)
def test_impossible_options_are_refused(options, named):
    with pytest.raises(SceneError, match=named):
        MujocoOptions(**options)


def test_what_mujoco_would_take_in_silence_never_reaches_it(block):
    for modulus in (0.0, -1.0, math.nan):
        with pytest.raises(SceneError, match="youngs_modulus"):
            Elastic(density=1.0, youngs_modulus=modulus, poissons_ratio=0.3)
    with pytest.raises(SceneError, match="gravity"):
        block(SOFT, gravity=(0.0, 0.0, math.nan))
    for step in (0.0, -1e-3, math.nan):
        with pytest.raises(SceneError, match="substep"):
            EngineAccuracy(substep=step)


def test_a_body_cannot_be_rigid_and_soft(block, opened):
    problem = block(SOFT)
    ids = np.arange(len(problem.points)) % 2
    mixed = replace(problem, materials=(SOFT, RIGID), points=replace(problem.points, material_ids=ids))
    with pytest.raises(SceneError, match="partly rigid and partly soft"):
        opened(mixed)


def test_what_the_solver_did_is_in_the_report_and_can_be_bounded(block, opened):
    """A block that lands: contact is solved by iteration, more of it with more allowed."""
    floor = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.5)
    problem = block(SOFT, (4, 4, 4), colliders=(floor,))
    counted = []
    for limit in (1, None):
        accuracy = EngineAccuracy(spacing=0.1, substep=0.005, iteration_limit=limit)
        with MujocoFlex().open(problem, accuracy=accuracy) as session:
            report = session.advance_to(0.5)
            assert report.solver_residual is None
            assert session.advance_to(0.5).solver_iterations == 0
        counted.append((report.solver_iterations, report.substep_count))
    (few, steps), (many, _) = counted
    assert 0 < few <= steps < many
