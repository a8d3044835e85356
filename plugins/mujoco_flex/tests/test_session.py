from __future__ import annotations

import math

import numpy as np
import pytest
from gasp_mujoco_flex.plugin import MujocoOptions

from gasp_core.engine.contract import EngineAccuracy, Field, Status
from gasp_core.engine.forcing import Collider, Driven, Pinned
from gasp_core.engine.materials import Elastic, Rigid
from gasp_core.engine.shapes import HalfSpace
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
    assert np.linalg.norm(state.velocities, axis=1).max() < 0.05
    # The lowest points are half their distance above the bottom.
    assert state.positions[:, 2].min() == pytest.approx(0.025, abs=5e-3)


def test_a_column_is_compressed_by_its_weight(block, opened):
    # nu = 0: the head sinks by rho g H^2 / 2 E.
    column = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.0)
    pin = Pinned(region=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    problem = block(column, (4, 4, 20), drives=(pin,))
    with opened(problem, damping=0.02) as session:
        session.advance_to(1.0)
        session.advance_to(2.0)
        sunk = problem.points.reference_positions[:, 2] - session.read(MOVING).positions[:, 2]
    z = problem.points.reference_positions[:, 2]
    expected = 1000 * 9.81 / 1e5 * (z - z**2 / 2)
    # Linear cells interpolate u = H z - z^2 / 2 between nodes: h^2 / 8 too little at most; 1 % for the finite strain.
    assert np.abs(sunk - expected).max() <= 0.01 * expected.max() + 1000 * 9.81 / 1e5 * 0.1**2 / 8


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


def test_soft_and_rigid_touch(block, opened):
    from dataclasses import replace

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
    from dataclasses import replace

    problem = block(SOFT)
    ids = np.arange(len(problem.points)) % 2
    mixed = replace(problem, materials=(SOFT, RIGID), points=replace(problem.points, material_ids=ids))
    with pytest.raises(SceneError, match="partly rigid and partly soft"):
        opened(mixed)
