"""A cage holds every point, gives back what is linear, and knows how much of a voxel is matter."""

import numpy as np
import pytest

from gasp_core.errors import SceneError
from gasp_core.stepping.embedding import CORNERS, carry_rigidly
from gasp_core.stepping.voxel_cage import voxel_cage, voxel_grid_around


@pytest.fixture
def points():
    return np.random.default_rng(1).normal(size=(800, 3))


@pytest.fixture
def cage(points):
    return voxel_cage(voxel_grid_around(points, 0.01, 0.4), points)


def test_there_is_a_voxel_around_every_point_and_none_without(points, cage):
    held = cage.embedding.cells
    lower = cage.grid.lower + cage.voxels * cage.grid.sides
    offset = (points - lower[held]) / cage.grid.sides
    # A place is a difference of numbers of about ten sides, rounded.
    assert offset.min() > -1e-13 and offset.max() < 1 + 1e-13
    np.testing.assert_array_equal(np.unique(held), np.arange(len(cage.voxels)))


def test_every_node_is_there_once_and_at_the_corners_of_its_voxels(cage):
    assert len(np.unique(cage.nodes, axis=0)) == len(cage.nodes) == cage.embedding.nodes
    np.testing.assert_array_equal(cage.nodes[cage.embedding.corners], cage.voxels[:, None] + CORNERS)


def test_what_is_affine_is_carried_exactly(points, cage):
    rng = np.random.default_rng(2)
    gradient, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    weights = cage.embedding.weights()
    moved = cage.positions @ gradient.T + shift
    # Eight weights of at most 1 of values of about 10.
    np.testing.assert_allclose(weights @ moved, points @ gradient.T + shift, atol=1e-13)
    rows, out = np.arange(len(points), dtype=np.int32), np.empty_like(points)
    cage.embedding.spread(moved, rows, out)
    np.testing.assert_allclose(out, points @ gradient.T + shift, atol=1e-13)
    cage.embedding.carry(moved - cage.positions, points, rows, out)
    np.testing.assert_allclose(out, points @ gradient.T + shift, atol=1e-13)


def test_what_is_spread_to_nodes_keeps_its_sum_and_its_middle(points, cage):
    masses = np.random.default_rng(3).random(len(points))
    nodal = cage.embedding.weights().T @ masses
    np.testing.assert_allclose(nodal.sum(), masses.sum(), rtol=1e-13)
    np.testing.assert_allclose(nodal @ cage.positions, masses @ points, atol=1e-10)


def test_a_body_that_cuts_voxels_fills_a_part_of_them():
    # Cubes of 1/40 on a grid of voxels of 1/10, filled up to x = 0.25: a column of voxels is cut in half.
    middles = (np.indices((10, 12, 12)).reshape(3, -1).T + 0.5) / 40
    corners = np.array([[0.0, 0, 0], [0.3, 0.3, 0.3]])
    cage = voxel_cage(voxel_grid_around(corners, 0.0, 0.1), middles)
    fractions = cage.filled_fractions(np.full(len(middles), 1 / 40**3))
    # Sums of 64 equal numbers.
    np.testing.assert_allclose(fractions[cage.voxels[:, 0] < 2], 1.0, rtol=1e-13)
    np.testing.assert_allclose(fractions[cage.voxels[:, 0] == 2], 0.5, rtol=1e-13)


def test_no_voxel_is_more_than_full():
    positions = np.zeros((5, 3))
    cage = voxel_cage(voxel_grid_around(positions, 0.5, 1.0), positions)
    assert cage.filled_fractions(np.ones(5)).tolist() == [1.0]


def test_a_cloud_too_wide_is_refused_with_what_to_do():
    with pytest.raises(SceneError, match=r"too far for cells of 0\.01 m: drop its floaters, or lower the resolution"):
        voxel_grid_around(np.array([[0.0, 0, 0], [100.0, 100, 100]]), 0.0, 0.01)


def test_what_is_rigid_carries_its_points(points):
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    rows, out = np.random.default_rng(5).permutation(len(points)), np.empty_like(points)
    carry_rigidly(points, turn, np.array([1.0, 2.0, 3.0]), rows, out)
    np.testing.assert_allclose(out[rows], points @ turn.T + [1.0, 2.0, 3.0], atol=1e-13)
