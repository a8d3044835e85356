"""One cloud of points laid onto another, of which no point is known to be a point of the first.

Distances count across the surface that a cloud lies on, and next to nothing along it, as in generalized ICP (Segal,
Haehnel, Thrun 2009, 10.15607/RSS.2009.V.021): two samples of one surface have no points in common.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Affine", "Cloud", "laid_onto"]

Array = NDArray[Any]

_NEIGHBOURS = 12
_FLAT = 1e-3
"""Least share of the longest axis squared of a neighbourhood in its shortest."""
_KEPT = 0.95
"""Of nearest pairs, those that count; the others may be of what came or went."""
_STEPS, _SETTLED = 40, 1e-4
_FIRM = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """Points to be laid onto.

    Parameters
    ----------
    points : (M, 3)
    metric : (M, 3, 3)
        What a difference is multiplied by before its length is taken.
    reach : (M,)
        Of the neighbourhood that this was found in.
    tree
        Of the points.
    """

    points: Array
    metric: Array
    reach: Array
    tree: Any

    @classmethod
    def of(cls, points: Array) -> Cloud:
        """A cloud (M, 3) with the surface around each of its points."""
        from scipy.spatial import KDTree

        tree: Any = KDTree(points)
        distances, rows = tree.query(points, k=min(_NEIGHBOURS, len(points)))
        around = points[rows]
        around = around - around.mean(axis=1, keepdims=True)
        values, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", around, around))
        values = values + _FLAT * values[:, 2:] + np.finfo(float).tiny
        metric = (axes * np.sqrt(values[:, :1] / values)[:, None]).transpose(0, 2, 1)
        return cls(points=points, metric=metric, reach=distances[:, -1], tree=tree)

    @property
    def spacing(self) -> float:
        """Root mean square of the distance from a place to the nearest other one."""
        from scipy.spatial import KDTree

        places = np.unique(self.points, axis=0)
        tree: Any = KDTree(places)
        return float(np.sqrt((tree.query(places, k=[2])[0] ** 2).mean()))

    def pairs(self, points: Array) -> tuple[Array, Array]:
        """Rows of points (N, 3) and of the cloud that are nearest to each other, seen from either side."""
        from scipy.spatial import KDTree

        tree: Any = KDTree(points)
        there, here = self.tree.query(points), tree.query(self.points)
        rows = np.concatenate([np.arange(len(points)), here[1]])
        others = np.concatenate([there[1], np.arange(len(self.points))])
        distances = np.concatenate([there[0], here[0]])
        near = distances <= np.quantile(distances, _KEPT)
        return rows[near], others[near]


@dataclass(frozen=True, slots=True, kw_only=True)
class Affine:
    """x -> `matrix` x + `shift`.

    Parameters
    ----------
    matrix : (3, 3)
    shift : (3,)
    """

    matrix: Array
    shift: Array

    @classmethod
    def nothing(cls) -> Affine:
        """It leaves everything where it is."""
        return cls(matrix=np.eye(3), shift=np.zeros(3))

    def __call__(self, points: Array) -> Array:
        """Of points (..., 3)."""
        return points @ self.matrix.T + self.shift


def laid_onto(points: Array, cloud: Cloud, starts: Iterable[Affine]) -> Affine:
    """The affine map that lays points (N, 3) onto a cloud best, found from the best of several starts."""
    return min((_settled(points, cloud, start) for start in starts), key=lambda found: found[1])[0]


def _settled(points: Array, cloud: Cloud, start: Affine) -> tuple[Affine, float]:
    found, off, size = start, np.inf, float(np.ptp(cloud.points, axis=0).max())
    for _ in range(_STEPS):
        moved = found(points)
        rows, others = cloud.pairs(moved)
        moved, metric = moved[rows], cloud.metric[others]
        middle = moved.mean(axis=0)
        apart = np.einsum("nij,nj->ni", metric, cloud.points[others] - moved)
        off = float(np.sqrt((apart**2).mean()))
        arms = np.concatenate([moved - middle, np.full((len(moved), 1), size)], axis=1)
        # The unknowns: a matrix, row by row, and a shift over the size.
        slopes = np.einsum("nij,nk->nikj", metric, arms).reshape(-1, 12)
        normal = slopes.T @ slopes
        normal[np.diag_indices(12)] += _FIRM * np.trace(normal) / 12
        step = np.linalg.solve(normal, slopes.T @ apart.reshape(-1)).reshape(4, 3).T
        turn = np.eye(3) + step[:, :3]
        shift = size * step[:, 3] + middle - turn @ middle
        found = Affine(matrix=turn @ found.matrix, shift=turn @ found.shift + shift)
        if np.abs(step).max() < _SETTLED:
            break
    return found, off
