"""What it takes to cut a cloud into voxels: how many nodes a cage would have."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.enclosure import enclosed
from gasp_core.stepping.voxel_cage import VoxelGrid

__all__ = ["node_count"]

Array = NDArray[Any]


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
