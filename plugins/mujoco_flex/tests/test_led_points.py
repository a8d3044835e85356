"""Points that are led, and the nodes of the cage that go with them."""

import numpy as np
import pytest

from gasp_core.contract import Elastic, Field, Rigid, Trajectories
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_matrices

RUBBER = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
TIMES = np.linspace(0.0, 0.4, 9)
MOVING = frozenset({Field.POSITIONS, Field.VELOCITIES})
STILL = (0.0, 0.0, 0.0)


def turned(places, angle):
    half = angle / 2
    return places @ rotation_matrices([[np.cos(half), 0, 0, np.sin(half)]])[0].T


def led(rows, places):
    moves = np.array([turned(places[rows], 0.5 * np.sin(4 * time)) - places[rows] for time in TIMES])
    return Trajectories(rows=rows, times=TIMES, displacements=moves)


@pytest.fixture
def bar(block):
    """Twelve cells long, its first quarter is swung about the vertical."""
    still = block(RUBBER, (24, 4, 4), gravity=STILL)
    places = still.points.reference_positions
    rows = np.flatnonzero(places[:, 0] < 0.3)
    return block(RUBBER, (24, 4, 4), gravity=STILL, trajectories=led(rows, places))


def test_led_points_are_where_they_are_led_and_the_rest_lags(bar, opened):
    """To the rounding of the table. The bar's first period is 1 s, so that its end cannot follow at once."""
    rows = bar.trajectories.rows
    places = bar.points.reference_positions
    with opened(bar) as session:
        for time in TIMES[1:]:
            session.advance_to(time)
            state = session.read(MOVING)
            along = turned(places, 0.5 * np.sin(4 * time))
            np.testing.assert_allclose(state.positions[rows], along[rows], atol=1e-7)
            if time <= 0.1:
                lag = np.linalg.norm(state.positions - along, axis=1)
                assert lag[places[:, 0] > 1.1].min() > 0.3 * np.linalg.norm(along - places, axis=1).max()
        swing = 0.5 * 4 * np.cos(4 * TIMES[-1])
        now = state.positions[rows]
        # At the last moment a parabola's slope: off by step^2 / 3 times the third derivative, 0.5 4^3 of a radius.
        np.testing.assert_allclose(
            state.velocities[rows],
            swing * np.stack([-now[:, 1], now[:, 0], 0 * now[:, 0]], axis=1),
            atol=(TIMES[1] ** 2 / 3) * 0.5 * 4**3 * 0.5 * 3,
        )


def test_a_led_bar_goes_on_from_a_checkpoint_as_it_was(bar, opened):
    with opened(bar) as session:
        session.advance_to(0.13)
        kept = session.checkpoint()
        session.advance_to(0.31)
        whole = session.read(MOVING)
    with opened(bar, restart=kept) as session:
        session.advance_to(0.31)
        again = session.read(MOVING)
    np.testing.assert_array_equal(again.positions, whole.positions)
    np.testing.assert_array_equal(again.velocities, whole.velocities)


def test_what_is_led_and_holds_no_node_is_told(block, opened):
    """A point in the middle of a cell is as near to its nodes as others are, and no nearer."""
    still = block(RUBBER, (9, 9, 9))
    places = still.points.reference_positions
    middle = np.flatnonzero((places == np.median(places, axis=0)).all(axis=1))
    scene = block(RUBBER, (9, 9, 9), trajectories=led(middle, places))
    with opened(scene, spacing=0.15) as session:
        told = session.advance_to(0.1).warnings
    assert any("holds no node" in line for line in told), told


def test_a_rigid_body_is_not_led(block, opened):
    still = block(Rigid(density=1000.0))
    scene = block(Rigid(density=1000.0), trajectories=led(np.arange(4), still.points.reference_positions))
    with pytest.raises(SceneError, match="rigid bodies cannot be led"):
        opened(scene)
