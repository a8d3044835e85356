"""A cage of voxels around matter, for engines that step something coarser than the points: elements, lattices, springs.

The points ride in the voxels that hold them, see `gasp_core.stepping.embedding`. A voxel that the surface of the body
cuts is matter in part only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.stepping.embedding import CORNERS, Embedding

__all__ = ["VoxelCage", "VoxelGrid", "voxel_cage", "voxel_grid_around"]

Array = NDArray[Any]

_MOST_VOXELS = 2**24
_TIE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class VoxelGrid:
    """Boxes, all alike, that fill a box.

    Parameters
    ----------
    lower : (3,) [m]
        Corner of the first one.
    sides : (3,) [m]
        Of one of them.
    shape
        Their numbers along the axes.
    """

    lower: Array
    sides: Array
    shape: tuple[int, int, int]

    @property
    def is_small(self) -> bool:
        """Whether it can be held in memory voxel by voxel: there are at most 2^24."""
        return float(np.prod(np.array(self.shape, dtype=float))) <= _MOST_VOXELS

    def locate(self, positions: Array) -> tuple[Array, Array]:
        """Voxel (N, 3) of each position (N, 3) [m], the nearest one outside of them, and place (N, 3) in it [sides]."""
        places = (positions - self.lower) / self.sides
        voxels = np.clip(np.floor(places).astype(np.int64), 0, np.array(self.shape) - 1)
        return voxels, places - voxels

    def refined(self, parts: int) -> VoxelGrid:
        """The grid that divides every voxel into `parts` along each axis."""
        x, y, z = self.shape
        return VoxelGrid(lower=self.lower, sides=self.sides / parts, shape=(x * parts, y * parts, z * parts))


def voxel_grid_around(positions: Array, margin: float, side: float) -> VoxelGrid:
    """The grid whose outermost faces are `margin` [m] off the cloud (N, 3) [m], of sides of about `side` [m].

    Raises
    ------
    SceneError
        Where the cloud is so wide that there would be more than 2^24 voxels.
    """
    lower, upper = positions.min(axis=0) - margin, positions.max(axis=0) + margin
    # What is half a voxel between two numbers of them is not left to rounding.
    counts = np.maximum(np.rint((upper - lower) / side * (1 - _TIE)), 1.0)
    if counts.prod() > _MOST_VOXELS:
        raise SceneError(
            f"points of one body are up to {float((upper - lower).max()):.3g} m apart, too far for cells of"
            f" {side:.3g} m: drop its floaters, or lower the resolution"
        )
    x, y, z = (int(count) for count in counts)
    return VoxelGrid(lower=lower, sides=(upper - lower) / counts, shape=(x, y, z))


@dataclass(frozen=True, slots=True, kw_only=True)
class VoxelCage:
    """The voxels that hold matter, and the nodes at their corners, each of which is there once.

    Parameters
    ----------
    grid
        What they are voxels of.
    voxels : (C, 3)
        Of the grid, sorted.
    nodes : (M, 3)
        Of the grid, counted from its first corner.
    embedding
        Where the points lie in it.
    """

    grid: VoxelGrid
    voxels: Array
    nodes: Array
    embedding: Embedding

    @property
    def positions(self) -> Array:
        """Of the nodes at rest, (M, 3) [m]."""
        return self.grid.lower + self.nodes * self.grid.sides

    def filled_fractions(self, volumes: Array) -> Array:
        """How much of each voxel (C,) the volumes (N,) [m^3] of the points in it fill; more than all of it is 1.

        What is cut by the surface of a body is a voxel in part only, and weighs and resists so.
        """
        held = np.bincount(self.embedding.cells, weights=volumes, minlength=len(self.voxels))
        return np.minimum(held / self.grid.sides.prod(), 1.0)


def voxel_cage(grid: VoxelGrid, positions: Array) -> VoxelCage:
    """The voxels of a grid that hold one of the positions (N, 3) [m], and where these lie in them."""
    located, places = grid.locate(positions)
    keys = np.ravel_multi_index(tuple(located.T), grid.shape)
    found, own = np.unique(keys, return_inverse=True)
    voxels = np.stack(np.unravel_index(found, grid.shape), axis=1)
    x, y, z = grid.shape
    full = (x + 1, y + 1, z + 1)
    at_corners = np.ravel_multi_index(tuple(np.moveaxis(voxels[:, None] + CORNERS, -1, 0)), full)
    node_keys, corners = np.unique(at_corners, return_inverse=True)
    return VoxelCage(
        grid=grid,
        voxels=voxels,
        nodes=np.stack(np.unravel_index(node_keys, full), axis=1),
        embedding=Embedding(
            corners=corners.reshape(-1, 8).astype(np.int32),
            cells=own.reshape(-1).astype(np.int32),
            places=places,
            nodes=len(node_keys),
        ),
    )
