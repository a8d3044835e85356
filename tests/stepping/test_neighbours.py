"""Pairs of near points: those that all distances give, in an order of their own."""

import numpy as np
import pytest

from gasp_core.stepping.neighbours import neighbour_pairs, neighbour_pairs_between, point_distance


@pytest.fixture
def clouds():
    rng = np.random.default_rng(3)
    return rng.random((300, 3)), rng.random((200, 3)) + 0.4


@pytest.mark.parametrize("radius", [0.01, 0.1, 0.5])
def test_pairs_are_those_that_all_distances_give(clouds, radius):
    positions, _ = clouds
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    np.testing.assert_array_equal(neighbour_pairs(positions, radius), np.argwhere(np.triu(distances <= radius, 1)))


@pytest.mark.parametrize("radius", [0.01, 0.1, 0.5])
def test_pairs_between_bodies_are_those_that_all_distances_give(clouds, radius):
    first, second = clouds
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    np.testing.assert_array_equal(neighbour_pairs_between(first, second, radius), np.argwhere(distances <= radius))


def test_points_at_one_place_are_pairs_and_the_radius_is_itself_included():
    positions = np.array([[0.0, 0, 0], [0.0, 0, 0], [2.0, 0, 0]])
    assert neighbour_pairs(positions, 0.0).tolist() == [[0, 1]]
    assert neighbour_pairs(positions, 2.0).tolist() == [[0, 1], [0, 2], [1, 2]]


def test_where_there_is_nobody_there_are_no_pairs(clouds):
    none = np.zeros((0, 3))
    assert neighbour_pairs(none, 1.0).shape == (0, 2)
    assert neighbour_pairs_between(clouds[0], none, 1.0).shape == (0, 2)


def test_points_at_one_place_count_once():
    places = np.repeat(np.random.default_rng(2).random((50, 3)), 3, axis=0)
    assert point_distance(places, np.full(150, 1 / 150)) == pytest.approx(np.cbrt(1 / 50), rel=1e-12)
