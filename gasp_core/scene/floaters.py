"""Which Gaussians float: those outside the large connected components of a capture."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gasp_core.scene.placement import robust_box

__all__ = ["component_sizes", "floating"]

Array = NDArray[Any]

_CELLS = (32, 64)
"""Voxels along the longest side of the robust box. Two, because one alone splits what a seam happens to part."""
_SHARE = 0.01
"""A component is large from this share of the largest on; letters of a word and fruit in a bowl are well above."""
_FARTHEST = 2**20
"""Voxels from the box at which positions are clipped, so that a key of three indices fits into 64 bits."""
# Half of the 26 neighbours; the other half are their mirror images.
_NEIGHBOURS = [offset for offset in product((-1, 0, 1), repeat=3) if offset > (0, 0, 0)]


def floating(means: Array) -> Array:
    """Mask (N,) of the Gaussians, given by their means (N, 3), that float.

    A Gaussian floats if at every spacing its connected component of occupied voxels (26 neighbours) holds fewer than
    a hundredth of the Gaussians of the largest one. Relative to the largest, so that a sparse cloud, where every
    component is small, has no floaters.
    """
    means = np.asarray(means, dtype=np.float64)
    if len(means) == 0:
        return np.zeros(0, dtype=bool)
    lower, upper = robust_box(means)
    longest = float((upper - lower).max())
    if not longest > 0:
        return np.zeros(len(means), dtype=bool)
    floats = np.ones(len(means), dtype=bool)
    for cells in _CELLS:
        sizes = component_sizes(means - lower, longest / cells)
        floats &= sizes < _SHARE * sizes.max()
    return floats


def component_sizes(positions: Array, spacing: float) -> Array:
    """Number of positions (N, 3) in the connected component of occupied voxels that each is in, (N,)."""
    index = np.floor(positions / spacing)
    index = np.clip(index, -_FARTHEST + 2, _FARTHEST - 2).astype(np.int64) + _FARTHEST
    stride = 2 * _FARTHEST
    keys = (index[:, 0] * stride + index[:, 1]) * stride + index[:, 2]
    voxels, voxel_of = np.unique(keys, return_inverse=True)
    rows: list[Array] = []
    columns: list[Array] = []
    for i, j, k in _NEIGHBOURS:
        wanted = voxels + (i * stride + j) * stride + k
        place = np.minimum(np.searchsorted(voxels, wanted), len(voxels) - 1)
        found = np.flatnonzero(voxels[place] == wanted)
        rows.append(found)
        columns.append(place[found])
    row, column = np.concatenate(rows), np.concatenate(columns)
    graph = coo_array((np.ones(len(row), dtype=bool), (row, column)), shape=(len(voxels), len(voxels)))
    _, component = connected_components(graph, directed=False)
    owner = component[voxel_of.reshape(-1)]
    return np.bincount(owner)[owner]
