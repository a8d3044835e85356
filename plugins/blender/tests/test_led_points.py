"""Points that are led, and the nodes of the cage that go with them."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_core.contract import Field, Rigid, Trajectories
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices

TIMES = np.linspace(0.0, 0.4, 9)
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})


def turned(places, angle):
    half = angle / 2
    return places @ rotation_matrices([[np.cos(half), 0, 0, np.sin(half)]])[0].T


def bar(kit, **scene):
    """Twelve voxels long; its first quarter is swung about the vertical."""
    places = kit.block((12, 2, 2), 0.1)
    rows = np.flatnonzero(places[:, 0] < 0.3)
    moves = np.array([turned(places[rows], 0.5 * np.sin(4 * time)) - places[rows] for time in TIMES])
    led = Trajectories(rows=rows, times=TIMES, displacements=moves)
    return kit.problem(places, 0.1, gravity=(0.0, 0.0, 0.0), trajectories=led, **scene)


def test_led_points_are_where_they_are_led_and_the_rest_lags(kit):
    """To the rounding of the table. Of rubber of 1e4 Pa, its end cannot follow at once."""
    problem = bar(kit)
    rows, places = problem.trajectories.rows, problem.points.reference_positions
    with kit.open(problem) as session:
        for time in TIMES[1:]:
            session.advance_to(time)
            positions = session.read(MOVING).positions
            along = turned(places, 0.5 * np.sin(4 * time))
            np.testing.assert_allclose(positions[rows], along[rows], atol=1e-7)
            if time <= 0.1:
                lag = np.linalg.norm(positions - along, axis=1)
                assert lag[places[:, 0] > 1.1].min() > 0.3 * np.linalg.norm(along - places, axis=1).max()
    # It has been taken along by now.
    assert np.linalg.norm(positions - places, axis=1)[places[:, 0] > 0.5].min() > 0.01


def test_a_led_bar_goes_on_from_a_checkpoint_as_it_was(kit):
    problem = bar(kit)
    with kit.open(problem) as session:
        session.advance_to(0.13)
        kept = session.checkpoint()
        session.advance_to(0.31)
        whole = session.read(MOVING)
    with kit.open(problem, restart=kept) as session:
        session.advance_to(0.31)
        again = session.read(MOVING)
    np.testing.assert_array_equal(again.positions, whole.positions)
    np.testing.assert_array_equal(again.velocities, whole.velocities)


def test_a_rigid_body_is_not_led(kit):
    with pytest.raises(SceneError, match="rigid bodies cannot be led"):
        kit.open(bar(kit, material=Rigid(density=1000.0)))
