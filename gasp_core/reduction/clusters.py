"""Clusters of Gaussians, as many as asked: BIRCH (Zhang, Ramakrishnan, Livny 1996, 10.1145/233269.233324)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.reduction.occupancy import occupied_cells
from gasp_core.stepping.threads import processors

__all__ = ["cluster", "cluster_apart", "scatter"]

Array = NDArray[Any]

_BRANCHES = 100
"""Children of a node: a tree of two or three levels, which is what costs least in an interpreted language."""
_FITS = 3
_ENOUGH = 0.95
"""Share of the number asked for that BIRCH itself has to come to; the rest is won by halving."""


def cluster(positions: Array, count: int) -> Array:
    """Labels 0 .. count - 1, (N,), of positions (N, 3); fewer only where there are fewer different places.

    BIRCH is told a radius, not a number. The radius comes from the side of the cubes of a lattice that occupy as many
    cells, corrected by what BIRCH then finds; the last few clusters come of halving those that scatter most.
    """
    if count >= len(positions):
        return np.arange(len(positions))
    extent = float(np.ptp(positions, axis=0).max())
    if extent == 0.0:
        return np.zeros(len(positions), dtype=np.int64)
    scaled = (positions - positions.mean(axis=0)) / extent
    return _halved(scaled, _fewer(scaled, count), count)


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


def _fewer(positions: Array, count: int) -> Array:
    """Labels of at most `count` clusters, and not many fewer where a few fits of BIRCH find such."""
    # Each takes long to import.
    from scipy.spatial import KDTree
    from sklearn.cluster import Birch

    birch: Any = Birch
    # BIRCH bounds the root-mean-square radius; that of a square of side a is 0.41 a.
    radius = 0.42 * _cell_side(positions, count)
    best = np.zeros(len(positions), dtype=np.int64)
    found = 1
    for _ in range(_FITS):
        tree = birch(threshold=radius, branching_factor=_BRANCHES, n_clusters=None, compute_labels=False)
        centres: Array = tree.fit(positions).subcluster_centers_
        if found < len(centres) <= count:
            _, nearest = KDTree(centres).query(positions, workers=processors())
            best, found = np.unique(nearest, return_inverse=True)[1].reshape(-1), len(centres)
        if _ENOUGH * count <= len(centres) <= count:
            break
        # RenderInput are surfaces: their clusters go by the square of the radius.
        radius *= np.sqrt(len(centres) / (0.98 * count))
    return best


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
