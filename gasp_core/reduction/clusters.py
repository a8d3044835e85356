"""Clusters of Gaussians, as many as asked: the cells of a lattice, then Lloyd's algorithm.

The paper clusters by BIRCH (Zhang, Ramakrishnan, Livny 1996, 10.1145/233269.233324). These clusters are as narrow, and
carry Gaussians as well, after a tenth of the time: benchmarks/clusters.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.reduction.occupancy import occupied_cells
from gasp_core.stepping.threads import processors

__all__ = ["averages", "cluster", "cluster_apart", "scatter"]

Array = NDArray[Any]

_PASSES = 4
"""After none, clusters are a quarter wider than BIRCH's, after one a tenth, after two a twentieth."""


def cluster(positions: Array, count: int) -> Array:
    """Labels 0 .. count - 1, (N,), of positions (N, 3); fewer only where there are fewer different places.

    They begin as the cells of a lattice, of which that many are occupied, or a few less; the last few come of halving
    those that scatter most.
    """
    if count >= len(positions):
        return np.arange(len(positions))
    extent = float(np.ptp(positions, axis=0).max())
    if extent == 0.0:
        return np.zeros(len(positions), dtype=np.int64)
    scaled = (positions - positions.mean(axis=0)) / extent
    labels = occupied_cells(scaled, _cell_side(scaled, count))
    return _halved(scaled, _settled(scaled, labels), count)


def cluster_apart(positions: Array, kinds: Array, count: int) -> Array:
    """As `cluster`, none of the clusters having positions of different kinds (N,); one at least of each kind."""
    _, kinds = np.unique(kinds, return_inverse=True)
    kinds = kinds.reshape(-1)
    sizes = np.bincount(kinds)
    if len(sizes) == 1:
        return cluster(positions, count)
    counts = np.maximum(count * sizes // len(kinds), 1)
    largest = int(np.argmax(sizes))
    counts[largest] = max(1, count - (int(counts.sum()) - int(counts[largest])))
    labels = np.empty(len(positions), dtype=np.int64)
    start = 0
    for kind, own in enumerate(counts):
        rows = np.flatnonzero(kinds == kind)
        labels[rows] = start + cluster(positions[rows], int(own))
        start = int(labels[rows].max()) + 1
    return labels


def scatter(positions: Array, labels: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Weights (C,), means (C, 3) and covariances (C, 3, 3) of the members of each cluster.

    Parameters
    ----------
    positions : (N, 3)
    labels : (N,)
        0 .. C - 1, none of them empty.
    weights : (N,)
        > 0.
    """
    total = np.bincount(labels, weights)
    means = np.stack([np.bincount(labels, weights * positions[:, i]) / total for i in range(3)], axis=1)
    offsets = positions - means[labels]
    covariances = np.empty((len(total), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            covariances[:, i, j] = np.bincount(labels, weights * offsets[:, i] * offsets[:, j]) / total
            covariances[:, j, i] = covariances[:, i, j]
    return total, means, covariances


def averages(matrices: Array, labels: Array, weights: Array) -> Array:
    """Weighted means (C, 3, 3) of matrices (N, 3, 3) by cluster."""
    columns = (np.bincount(labels, weights * column) for column in matrices.reshape(-1, 9).T)
    return np.stack(list(columns), axis=1).reshape(-1, 3, 3) / np.bincount(labels, weights)[:, None, None]


def _settled(positions: Array, labels: Array) -> Array:
    """Clusters whose means take what is nearest to them, a few times over (Lloyd 1982, 10.1109/TIT.1982.1056489)."""
    from scipy.spatial import KDTree  # takes long to import

    for _ in range(_PASSES):
        counts = np.bincount(labels)
        means = np.stack([np.bincount(labels, column) / counts for column in positions.T], axis=1)
        _, nearest = KDTree(means).query(positions, workers=processors())
        labels = np.unique(nearest, return_inverse=True)[1].reshape(-1)
    return labels


def _cell_side(positions: Array, count: int) -> float:
    """Side of the cubes of a lattice that these positions, of extent 1, occupy `count` of or fewer."""
    low, high = 0.0, float(np.log(2.0 * len(positions)))
    for _ in range(12):
        middle = (low + high) / 2
        if occupied_cells(positions, float(np.exp(-middle))).max() + 1 > count:
            high = middle
        else:
            low = middle
    return float(np.exp(-low))


def _halved(positions: Array, labels: Array, count: int) -> Array:
    """Clusters that scatter most are cut in two at their mean, across their longest axis, until there are `count`."""
    labels = labels.copy()
    ones = np.ones(len(positions))
    while (clusters := int(labels.max()) + 1) < count:
        sizes, means, covariances = scatter(positions, labels, ones)
        spread = sizes * np.trace(covariances, axis1=1, axis2=2)
        chosen = np.argsort(-spread, kind="stable")[: min(count - clusters, (clusters + 3) // 4)]
        axes = np.zeros((clusters, 3))
        axes[chosen] = np.linalg.eigh(covariances[chosen])[1][:, :, 2]
        above = np.einsum("ni,ni->n", positions - means[labels], axes[labels]) > 0
        cut = np.unique(labels[above])
        if len(cut) == 0:
            break
        fresh = np.full(clusters, -1)
        fresh[cut] = clusters + np.arange(len(cut))
        labels[above] = fresh[labels[above]]
    return labels
