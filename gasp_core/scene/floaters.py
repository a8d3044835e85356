"""Connected components of a capture, and which Gaussians float: those outside the large ones."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.scene.placement import robust_box

__all__ = ["LARGE", "component_sizes", "components", "floating"]

Array = NDArray[Any]

_CELLS = (32, 16, 8)
"""Voxels along the longest side of the robust box, finest first; a sparse cloud hangs together in coarse ones only."""
LARGE = 0.005
"""A component is large from this share of all Gaussians on; letters of a word and fruit in a bowl are well above."""
_TOGETHER = 0.9
"""Share of the Gaussians that must be in large components, or the spacing is too fine to say anything."""
_FARTHEST = 2**20
"""Voxels from the box at which positions are clipped, so that a key of three indices fits into 64 bits."""
# Half of the 26 neighbours; the other half are their mirror images.
_NEIGHBOURS = [offset for offset in product((-1, 0, 1), repeat=3) if offset > (0, 0, 0)]


def floating(means: Array) -> Array:
    """Mask (N,) of the Gaussians, given by their means (N, 3), that float: those in no large component.

    Where nothing is connected at any spacing, as in a cloud of single points, nothing floats.
    """
    found = _connected(means)
    return np.zeros(len(means), dtype=bool) if found is None else _small(found)


def components(means: Array) -> Array:
    """Numbers 1, 2, ... (N,) of the connected components of Gaussians, given by their means (N, 3), the largest first.

    Voxels that touch (26 neighbours) are connected. The spacing is the finest of a 32nd, 16th and 8th of the size at
    which the large components, those of a 200th of all Gaussians or more, hold nine tenths of them. Where there is no
    such spacing, as in a cloud of single points, all are one.
    """
    found = _connected(means)
    if found is None:
        return np.ones(len(means), dtype=np.int64)
    # Equally large ones in the order of the file.
    _, first, counts = np.unique(found, return_index=True, return_counts=True)
    numbers = np.empty(len(counts), dtype=np.int64)
    numbers[np.lexsort((first, -counts))] = np.arange(1, len(counts) + 1)
    return numbers[found]


def _connected(means: Array) -> Array | None:
    """Labels 0, 1, ... (N,) of the components at the finest spacing that says something; None where none does."""
    means = np.asarray(means, dtype=np.float64)
    if len(means) == 0:
        return None
    lower, upper = robust_box(means)
    longest = float((upper - lower).max())
    if longest > 0:
        for cells in _CELLS:
            labels = _component_labels(means - lower, longest / cells)
            if _small(labels).sum() <= (1 - _TOGETHER) * len(means):
                return labels
    return None


def _small(labels: Array) -> Array:
    """Which (N,) are in no large component."""
    return np.bincount(labels)[labels] < LARGE * len(labels)


def component_sizes(positions: Array, spacing: float) -> Array:
    """Number of positions (N, 3) in the connected component of occupied voxels that each is in, (N,)."""
    labels = _component_labels(positions, spacing)
    return np.bincount(labels)[labels]


def _component_labels(positions: Array, spacing: float) -> Array:
    """Component 0, 1, ... of occupied voxels that each of the positions (N, 3) is in, (N,)."""
    # Slow to import, and who looks at a finished run does not need it.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

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
    return component[voxel_of.reshape(-1)].astype(np.int64)
