"""Points that are near each other, for engines whose matter interacts in pairs: contact, springs, SPH, peridynamics.

SciPy's k-d trees find them; what is added is an order that does not depend on how the trees were built.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

__all__ = ["neighbour_pairs", "neighbour_pairs_between", "point_distance"]

Array = NDArray[Any]


def neighbour_pairs(positions: Array, radius: float) -> Array:
    """Pairs of points that are no farther from each other than a radius.

    Parameters
    ----------
    positions : (N, 3) [m]
    radius
        Largest distance [m], itself included.

    Returns
    -------
    (P, 2) int64: rows of `positions`, the smaller first, sorted; every pair once.
    """
    pairs = KDTree(positions).query_pairs(radius, output_type="ndarray").astype(np.int64, copy=False)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def neighbour_pairs_between(first: Array, second: Array, radius: float) -> Array:
    """Pairs of a point of one body and a point of another that are no farther from each other than a radius.

    Parameters
    ----------
    first, second : (N, 3), (M, 3) [m]
    radius
        Largest distance [m], itself included.

    Returns
    -------
    (P, 2) int64: rows of `first` and of `second`, sorted.
    """
    if not len(first) or not len(second):
        return np.zeros((0, 2), dtype=np.int64)
    found = KDTree(first).sparse_distance_matrix(KDTree(second), radius, output_type="ndarray")
    pairs = np.stack([found["i"], found["j"]], axis=1).astype(np.int64, copy=False)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def point_distance(positions: Array, volumes: Array) -> float:
    """How far the points of a body are apart: the side of the cube that each place of them stands for.

    Half of it is how far matter reaches beyond the outermost points. The volume of a point alone does not say that:
    where two are at one place each has half of what is there.

    Parameters
    ----------
    positions : (N, 3) [m]
        Points at one place count once.
    volumes : (N,) [m^3]

    Returns
    -------
    float [m]
    """
    span = np.ptp(positions, axis=0)
    # A millionth of the size is one place.
    keys = ((positions - positions.min(axis=0)) / max(float(span.max()), 1e-300) * 2**20).astype(np.int64)
    places = len(np.unique((keys[:, 0] << 42) | (keys[:, 1] << 21) | keys[:, 2]))
    return float(np.cbrt(volumes.sum() / places))
