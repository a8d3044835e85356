"""What it takes to cut a cloud into voxels: how far its points are apart, and how many nodes a cage would have."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.enclosure import enclosed
from gasp_core.stepping.voxel_cage import VoxelGrid

__all__ = ["node_count", "point_distance"]

Array = NDArray[Any]


def point_distance(positions: Array, volumes: Array) -> float:
    """Side [m] of the cube that a point (N, 3) [m] of this cloud stands for; points at one place count once."""
    span = np.ptp(positions, axis=0)
    # A millionth of the size is one place.
    keys = ((positions - positions.min(axis=0)) / max(float(span.max()), 1e-300) * 2**20).astype(np.int64)
    places = len(np.unique((keys[:, 0] << 42) | (keys[:, 1] << 21) | keys[:, 2]))
    return float(np.cbrt(volumes.sum() / places))


def node_count(grid: VoxelGrid, positions: Array, *, filled: bool) -> int:
    """Nodes of the cells that hold positions (N, 3) [m], and of those that they enclose if these are `filled`."""
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[tuple(grid.locate(positions)[0].T)] = True
    if filled:
        occupied |= enclosed(occupied)
    nodes = np.zeros(tuple(side + 1 for side in grid.shape), dtype=bool)
    for x, y, z in np.ndindex(2, 2, 2):
        nodes[x : x + occupied.shape[0], y : y + occupied.shape[1], z : z + occupied.shape[2]] |= occupied
    return int(nodes.sum())
