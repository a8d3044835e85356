"""The led points of bodies among the others, and how they move about each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.moments import known_inverses
from gasp_core.stepping.led_points import LedPoints
from gasp_core.stepping.threads import processors

__all__ = ["LedBodies", "Slopes"]

Array = NDArray[Any]

_NEIGHBOURS = 12
"""Of a led point, by which it knows the slope of what it and they have: in a lattice those along its axes and half of
those across."""
_FLAT = 1e-2
"""Share of the longest axis squared of such a neighbourhood below which it does not extend along another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LedBodies:
    """The led points of a problem, body by body.

    Parameters
    ----------
    points
        Those that are led.
    neighbours : (K, N)
        Of each, those of its body nearest to it when they begin; itself where it has fewer.
    trees
        Of each body: k-d trees of where its led points begin, and its others, if it has others.
    """

    points: LedPoints
    neighbours: Array
    trees: Mapping[int, tuple[Any, Any]]

    @classmethod
    def of(cls, problem: PointProblem, points: LedPoints) -> Self:
        """Of those of a problem."""
        from scipy.spatial import KDTree

        cloud = problem.points
        others = np.ones(len(cloud), dtype=np.bool_)
        others[points.rows] = False
        neighbours = np.tile(np.arange(len(points.rows))[:, None], (1, _NEIGHBOURS))
        trees: dict[int, tuple[Any, Any]] = {}
        for body in map(int, np.unique(points.bodies)):
            own = np.flatnonzero(points.bodies == body)
            loose = cloud.reference_positions[others & (cloud.body_ids == body)]
            tree: Any = KDTree(points.start[own])
            trees[body] = tree, KDTree(loose) if len(loose) else None
            count = min(_NEIGHBOURS, len(own) - 1)
            if count:
                # The nearest is the point itself, or one that is where it is.
                nearest = tree.query(points.start[own], k=[*range(2, count + 2)], workers=processors())[1]
                neighbours[own, :count] = own[nearest]
        return cls(points=points, neighbours=neighbours, trees=trees)

    def nearer(self, places: Array, bodies: Array, room: float) -> Array:
        """Rows (L,), rising, of the places (G, 3) [m], at the start, of bodies (G,), that are nearer to led points of
        theirs than to others of theirs, or as near to within `room` [m]."""
        found: list[Array] = [np.zeros(0, dtype=np.intp)]
        for body, (own, loose) in self.trees.items():
            rows = np.flatnonzero(bodies == body)
            if loose is not None:
                to_own, to_loose = (tree.query(places[rows], workers=processors())[0] for tree in (own, loose))
                rows = rows[to_own <= to_loose + room]
            found.append(rows)
        return np.sort(np.concatenate(found))


@dataclass(frozen=True, slots=True, kw_only=True)
class Slopes:
    """Fits over the neighbours of some points, in the sense of least squares.

    Parameters
    ----------
    rows : (R,)
        Of K points.
    neighbours : (R, N)
        Of each.
    arms : (R, N, 3) [m]
        To them.
    inverses : (R, 3, 3) [1/m^2]
        Of the sums of their squares, as far as they extend.
    tangents : (F, 2, 3)
        Of those that lie in a plane.
    flat : (F,)
        Which of the R these are.
    """

    rows: Array
    neighbours: Array
    arms: Array
    inverses: Array
    tangents: Array
    flat: Array

    @classmethod
    def of(cls, positions: Array, neighbours: Array, rows: Array) -> Self:
        """Of the points `rows` (R,) of those at positions (K, 3) [m] with neighbours (K, N)."""
        neighbours = neighbours[rows]
        arms = positions[neighbours] - positions[rows][:, None]
        inverses, axes, known = known_inverses(arms.transpose(0, 2, 1) @ arms, _FLAT)
        flat = np.flatnonzero(known.sum(axis=1) == 2)
        tangents = axes[flat][:, :, 1:].transpose(0, 2, 1)
        return cls(rows=rows, neighbours=neighbours, arms=arms, inverses=inverses, tangents=tangents, flat=flat)

    def _fitted(self, values: Array) -> Array:
        """Slopes (R, 3, 3) of values (K, 3)."""
        changes = values[self.neighbours] - values[self.rows][:, None]
        return changes.transpose(0, 2, 1) @ self.arms @ self.inverses

    @property
    def normals(self) -> Array:
        """(F, 3)"""
        return np.cross(self.tangents[:, 0], self.tangents[:, 1])

    def of_velocities(self, velocities: Array) -> Array:
        """(R, 3, 3) [1/s]; where points lie in a plane its normal turns as the plane does."""
        slopes, normals = self._fitted(velocities), self.normals
        turning = -np.einsum("fij,fi->fj", slopes[self.flat], normals)
        slopes[self.flat] += turning[:, :, None] * normals[:, None]
        return slopes

    def of_displacements(self, displacements: Array) -> Array:
        """(R, 3, 3), by places now; where points lie in a plane its normal was normal to it before."""
        slopes = self._fitted(displacements)
        slopes[self.flat] -= self._tilts(-slopes[self.flat])[:, :, None] * self.normals[:, None]
        return slopes

    def tilts(self, displacements: Array) -> Array:
        """What normals of those in a plane change by, (F, 3), where displacements lead from there."""
        return self._tilts(self._fitted(displacements)[self.flat])

    def _tilts(self, slopes: Array) -> Array:
        """By their slopes (F, 3, 3)."""
        others = self.tangents + np.einsum("fij,ftj->fti", slopes, self.tangents)
        other = np.cross(others[:, 0], others[:, 1])
        other /= np.maximum(np.linalg.norm(other, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        return other - self.normals
