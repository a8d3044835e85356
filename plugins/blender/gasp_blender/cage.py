"""A cage of voxels around a cloud, and the trilinear weights that carry the cloud with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.enclosure import enclosed

__all__ = ["CORNERS", "Cage", "build_cage", "gather", "scatter"]

Array = NDArray[Any]

CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
"""Of a voxel, (8, 3), in the order of `Cage.voxels`."""
_MOST_VOXELS = 4_000_000
"""In the box around a cloud: a larger one is not looked through for its inside."""
_MOST_ALONG = 1_000_000
"""Voxels along one axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage:
    """Voxels, their corners, and where the points lie among them.

    Parameters
    ----------
    nodes : (V, 3) [m]
        Corners of voxels at rest.
    voxels : (C, 8) or (C, 4)
        Rows of `nodes`; corner i of a voxel is at the bits of i (x y z). The corners of a quad go round; a triangle is
        one whose last two are the same.
    parity : (C, 3)
        Of a voxel's place along each axis, 0 or 1.
    corners : (N, 8)
        Rows of `nodes` around each point.
    weights : (N, 8)
        Trilinear, >= 0, sum 1.
    coarseness
        Size of the voxels over the one asked for, >= 1; of several bodies, that of the coarsest.
    """

    nodes: Array
    voxels: Array
    parity: Array
    corners: Array
    weights: Array
    coarseness: float


def build_cage(positions: Array, margin: float, spacing: float, most_voxels: int) -> Cage:
    """The cage of one body.

    Parameters
    ----------
    positions : (N, 3) [m]
    margin
        What a point stands for beyond its place [m], half the side of its own cube: a single point has a cage, too.
    spacing
        Voxel size asked for [m]; each axis is cut into a whole number of equal parts.
    most_voxels
        The spacing is widened until there are no more.
    """
    low = positions.min(axis=0) - margin
    size = positions.max(axis=0) + margin - low
    asked, spacing = spacing, max(spacing, float(size.max()) / _MOST_ALONG)
    while True:
        counts = np.maximum(np.rint(size / spacing), 1).astype(np.int64)
        cells = np.minimum(((positions - low) / size * counts).astype(np.int64), counts - 1)
        occupied = _filled(np.unique(cells, axis=0), counts)
        if len(occupied) <= most_voxels:
            break
        spacing *= max(1.02, (len(occupied) / most_voxels) ** (1 / 3))
    spaces = size / counts
    places, voxels = np.unique((occupied[:, None] + CORNERS).reshape(-1, 3), axis=0, return_inverse=True)
    voxels = voxels.reshape(-1, 8)
    # `occupied` is sorted and holds every cell: rows of the union are its own.
    own = np.unique(np.concatenate([occupied, cells]), axis=0, return_inverse=True)[1].reshape(-1)[len(occupied) :]
    inside = (positions - low) / spaces - cells
    weights = np.where(CORNERS, inside[:, None], 1 - inside[:, None]).prod(axis=2)
    return Cage(
        nodes=low + places * spaces,
        voxels=voxels,
        parity=occupied % 2,
        corners=voxels[own],
        weights=weights,
        coarseness=spacing / asked,
    )


def gather(cage: Cage, values: Array) -> Array:
    """Values of nodes (V, k) at the points (N, k)."""
    return np.einsum("nc,nck->nk", cage.weights, values[cage.corners])


def scatter(cage: Cage, amounts: Array) -> Array:
    """Amounts at points (N,) or (N, k), shared out among nodes (V,) or (V, k): the transpose of `gather`."""
    columns = amounts.reshape(len(amounts), -1)
    rows = cage.corners.ravel()
    shared = [
        np.bincount(rows, (cage.weights * column[:, None]).ravel(), minlength=len(cage.nodes)) for column in columns.T
    ]
    return np.stack(shared, axis=1).reshape(len(cage.nodes), *amounts.shape[1:])


def _filled(occupied: Array, counts: Array) -> Array:
    """The occupied voxels (C, 3) and those inside them, sorted; a trained splat is a hollow shell."""
    if np.prod(counts, dtype=np.float64) > _MOST_VOXELS:
        return occupied
    full = np.zeros(tuple(counts), dtype=bool)
    full[tuple(occupied.T)] = True
    return np.argwhere(full | enclosed(full))
