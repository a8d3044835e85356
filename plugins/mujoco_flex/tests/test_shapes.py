from __future__ import annotations

import numpy as np
import pytest
from gasp_mujoco_flex.colliders import HOLLOW_DIRECTIONS
from gasp_mujoco_flex.rigid import merged_boxes
from gasp_mujoco_flex.voxel_grid import node_count

from gasp_core.errors import SceneError
from gasp_core.stepping.enclosure import enclosed
from gasp_core.stepping.voxel_cage import voxel_grid_around


def sphere(count: int = 20_000) -> np.ndarray:
    places = np.random.default_rng(0).normal(size=(count, 3))
    return places / np.linalg.norm(places, axis=1, keepdims=True)


def test_a_hollow_ball_is_filled_and_its_outside_is_not():
    shell = sphere()
    grid = voxel_grid_around(shell, 0.0, 0.1)
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[tuple(grid.locate(shell)[0].T)] = True
    middles = grid.lower + (np.argwhere(enclosed(occupied)) + 0.5) * grid.sides
    distances = np.linalg.norm(middles, axis=1)
    assert distances.max() < 1.0
    # What is deeper than a cell's diagonal is inside, and no cell of the shell.
    diagonal = float(np.linalg.norm(grid.sides))
    inside = 4 / 3 * np.pi * (1 - diagonal) ** 3
    assert len(middles) * grid.sides.prod() > inside


def test_nodes_are_those_of_occupied_cells():
    grid = voxel_grid_around(np.array([[0.0, 0, 0], [1.0, 1, 1]]), 0.0, 0.5)
    two = np.array([[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]])
    assert node_count(grid, two, filled=False) == 15


def test_rounding_does_not_decide_how_many_cells_there_are():
    # Two and a half cells.
    for size in (0.25 * (1 - 1e-15), 0.25, 0.25 * (1 + 1e-15)):
        assert voxel_grid_around(np.array([[0.0, 0, 0], [size, size, size]]), 0.0, 0.1).shape == (2, 2, 2)


def test_a_cloud_too_wide_is_refused():
    with pytest.raises(SceneError, match="too far for cells"):
        voxel_grid_around(np.array([[0.0, 0, 0], [100.0, 100, 100]]), 0.0, 0.01)


def test_merged_boxes_fill_cells_once():
    occupied = np.random.default_rng(3).random((5, 6, 7)) < 0.6
    filled = np.zeros(occupied.shape, dtype=int)
    for low, high in merged_boxes(occupied):
        filled[tuple(slice(a, b) for a, b in zip(low, high))] += 1
    assert np.array_equal(filled, occupied.astype(int))


def test_tangent_planes_lie_close_to_the_ball():
    # They are pi / 8 apart along two great circles, so no direction is further than sqrt(2) pi / 16 from one of them.
    nearest = (sphere(5000) @ HOLLOW_DIRECTIONS.T).max(axis=1)
    assert 1 / nearest.min() <= 1 / np.cos(np.sqrt(2) * np.pi / 16)
