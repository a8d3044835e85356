"""Material points on a lattice inside a surface."""

import numpy as np
import pytest

from gasp_core.reduction.lattice import lattice_inside, without_light

STEP = 0.05


def ball(points):
    return np.linalg.norm(points - [0.01, 0.02, 0.03], axis=1) - 0.5


def box(points, centre, half):
    beyond = np.abs(points - np.asarray(centre)) - np.asarray(half)
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def found_in(distance_at, wall=np.inf):
    lower, upper = np.full(3, -0.7), np.full(3, 0.7)
    return without_light(distance_at, *lattice_inside(distance_at, lower, upper, STEP, wall), STEP, wall)


def test_no_point_of_a_thick_body_is_light_and_none_of_its_volume_is_lost():
    points, shares = found_in(ball)
    assert shares.min() >= 0.5
    volumes = shares * STEP**3
    # A cube that is cut is asked at eight places: of a ball of 20 cubes across, a quarter of a percent at the most.
    assert volumes.sum() == pytest.approx(np.pi / 6, rel=2.5e-3)
    assert np.allclose(volumes @ points / volumes.sum(), [0.01, 0.02, 0.03], atol=0.01 * STEP)
    # A whole cube has a moment of its own, STEP^2 / 12, that its middle has not, and one that took a neighbour over no
    # more than twice that: all lack something between that and nothing.
    offsets = points - [0.01, 0.02, 0.03]
    second = (volumes[:, None, None] * offsets[:, :, None] * offsets[:, None, :]).sum(axis=0) / volumes.sum()
    lacking = np.linalg.eigvalsh(0.05 * np.eye(3) - second)
    assert lacking.min() > 0 and lacking.max() < STEP**2 / 6


def test_a_plate_of_two_layers_stays_one_of_two():
    """However it lies on the lattice: points of one plane do not tell how it turns."""
    for shift in np.linspace(0, STEP, 9):
        half = [0.5, 0.5, 0.8 * STEP]
        points, _ = found_in(lambda places, shift=shift, half=half: box(places, [0, 0, shift], half))
        middle = points[(np.abs(points[:, :2]) < 0.3).all(axis=1)]
        assert len(np.unique(np.round(middle[:, 2] / STEP, 3))) >= 2


def test_a_flake_above_a_block_stays_where_it_is():
    """A gap between two pieces is no matter, however near the next point is on its other side."""

    def flake_above(places):
        block = box(places, [0, 0, -0.2], [0.3, 0.3, 0.2])
        return np.minimum(block, box(places, [0, 0, 0.85 * STEP], [0.2, 0.2, 0.15 * STEP]))

    points, shares = found_in(flake_above)
    above = points[:, 2] > 0
    assert shares[above].sum() * STEP**3 == pytest.approx(0.4**2 * 0.3 * STEP, rel=0.05)
    assert np.allclose(points[above, 2], 0.85 * STEP, atol=0.2 * STEP)
