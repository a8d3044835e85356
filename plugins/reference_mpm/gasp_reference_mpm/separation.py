"""How far apart two bodies are at a node, and along which normal.

The points of both around the node are looked at along a direction: the gap is from where those of the first end to
where those of the second begin. Two bodies that can be separated are so along some direction, and along every one the
gap is at most their distance. So the direction is sought along which it is largest, as a separating axis is and as a
support vector machine seeks its margin (Nairn, Hammerquist and Smith 2020 use logistic regression for the same): first
among three, the normals of the two bodies and their mean, then by turning it towards where it would be none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.mpm import BETTER_GAP, FOREMOST, TURN_BELOW, TURNS
from gasp_reference_mpm.transfer import GridMomentum, Stencil

__all__ = ["Separation", "keys_of", "separated"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """How far bodies are apart at P nodes of two bodies each.

    Parameters
    ----------
    keys : (P, 5)
        Numbers of the two bodies, the lower one first, and whole-number coordinates of the node, in cells.
    normals : (P, 3)
        Unit vectors from the first body to the second.
    gaps : (P,) [m]
        Along them; infinite where nothing has a normal.
    """

    keys: Array
    normals: Array
    gaps: Array

    def rows_of(self, keys: Array) -> Array:
        """Where nodes (K, 5) are among these, (K,); -1 for those that are not."""
        rows = {tuple(key): row for row, key in enumerate(self.keys.tolist())}
        return np.array([rows.get(tuple(key), -1) for key in keys.tolist()], dtype=np.int64)

    def closed(self, rows: Array, ways: Array) -> Self:
        """The same after the bodies have come nearer to each other by `ways` (K,) [m] at rows (K,)."""
        gaps = self.gaps.copy()
        gaps[rows] -= ways
        return replace(self, gaps=gaps)


def separated(
    stencil: Stencil, grid: GridMomentum, first: Array, second: Array, reaches: Array, spacing: float
) -> Separation:
    """Where bodies are at nodes that two of them share.

    Parameters
    ----------
    first, second : (P,)
        Rows of the grid that are one node of two bodies.
    reaches : (N, 3, 3) [m]
        Half the side of the cube that each point stands for, deformed as it is now.
    """
    one, other = (_around(stencil, grid, rows, reaches, spacing) for rows in (first, second))
    out_of_first, out_of_second = _outward(one), _outward(other)
    tried = [_unit(out_of_first - out_of_second), out_of_first, -out_of_second]
    fronts = [_front(one, other, normals, spacing) for normals in tried]
    best = fronts[0]
    for front in fronts[1:]:
        best = _farther(best, front, spacing)
    front = best
    for _ in range(TURNS):
        # Where they overlap, they would not if what is foremost stayed so.
        lever = front.lever - np.sum(front.lever * front.normals, axis=1, keepdims=True) * front.normals
        overlap = np.where((front.gaps < -TURN_BELOW * spacing) & np.isfinite(front.gaps), -front.gaps, 0.0)
        turn = overlap / np.maximum(np.sum(lever**2, axis=1), (0.5 * spacing) ** 2)
        turned = _unit(front.normals + turn[:, None] * lever)
        front = _front(one, other, turned, spacing)
        best = _farther(best, front, spacing)
    return Separation(
        keys=keys_of(stencil, grid, first, second),
        normals=best.normals,
        gaps=np.where(np.any(best.normals, axis=1), best.gaps, np.inf),
    )


def keys_of(stencil: Stencil, grid: GridMomentum, first: Array, second: Array) -> Array:
    """As in `Separation`, of rows of the grid (P,) that are one node of two bodies."""
    fields = stencil.fields
    one, other = grid.nodes[first], grid.nodes[second]
    return np.column_stack([fields.bodies_of(one), fields.bodies_of(other), fields.coordinates(one)])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Side:
    """The points of one body around the node of each of P pairs, E in all, those of a pair behind each other.

    Parameters
    ----------
    pairs : (E,)
    begins : (P,)
    places : (E, 3) [m]
        From the node.
    reaches : (E, 3, 3) [m]
    slopes : (E, 3) [m^2]
        Of the point's weight at the node, times its volume.
    """

    pairs: Array
    begins: Array
    places: Array
    reaches: Array
    slopes: Array

    def sums(self, values: Array) -> Array:
        """Of values (E, K) over each pair's points, (P, K)."""
        return np.stack([np.bincount(self.pairs, column, len(self.begins)) for column in values.T], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Front:
    """Two bodies seen along a direction.

    Parameters
    ----------
    normals : (P, 3)
        The direction; zero where there is none.
    gaps : (P,) [m]
        Negative where they overlap; -inf without a direction.
    lever : (P, 3) [m]
        From what is foremost of the first to what is foremost of the second: turning the direction towards it opens
        the gap.
    """

    normals: Array
    gaps: Array
    lever: Array


def _around(stencil: Stencil, grid: GridMomentum, rows: Array, reaches: Array, spacing: float) -> _Side:
    wanted = np.zeros(stencil.fields.size, dtype=np.bool_)
    wanted[grid.nodes[rows]] = True
    point, slot = np.nonzero(wanted[stencil.nodes] & (stencil.weights > 0))
    order = np.argsort(stencil.nodes[point, slot], kind="stable")
    point, slot = point[order], slot[order]
    node = stencil.nodes[point, slot]
    begin = np.searchsorted(node, grid.nodes[rows], side="left")
    count = np.searchsorted(node, grid.nodes[rows], side="right") - begin
    begins = np.cumsum(count) - count
    entry = np.arange(count.sum()) + np.repeat(begin - begins, count)
    point, slot = point[entry], slot[entry]
    arms = stencil.arms[point, slot]
    volumes = 8 * np.linalg.det(reaches)
    return _Side(
        pairs=np.repeat(np.arange(len(rows)), count),
        begins=begins,
        places=-arms,
        reaches=reaches[point],
        slopes=volumes[point, None] * _spline_gradients(arms / spacing),
    )


def _spline_gradients(cells: Array) -> Array:
    """Gradients (E, 3) of the B-spline with respect to the node, which is `cells` (E, 3) away from the point."""
    away = np.abs(cells)
    values = np.where(away < 0.5, 0.75 - cells**2, 0.5 * (1.5 - away) ** 2)
    slopes = np.where(away < 0.5, -2 * cells, -np.sign(cells) * (1.5 - away))
    x, y, z = values.T
    return slopes * np.stack([y * z, x * z, x * y], axis=1)


def _outward(side: _Side) -> Array:
    """Unit vectors (P, 3) out of a body: against the gradient of its volume around the node."""
    return _unit(-side.sums(side.slopes))


def _front(first: _Side, second: _Side, normals: Array, spacing: float) -> _Front:
    end, last = _extent(first, normals, spacing)
    begin, foremost = _extent(second, -normals, spacing)
    gaps = np.where(np.any(normals, axis=1), -begin - end, -np.inf)
    return _Front(normals=normals, gaps=gaps, lever=foremost - last)


def _extent(side: _Side, directions: Array, spacing: float) -> tuple[Array, Array]:
    """How far (P,) [m] the points reach along unit vectors (P, 3), and the mean place (P, 3) [m] of the foremost.

    Of a cube that lies along the direction half the width is |(s/2 F)^T n|; of any other one, that of the ellipsoid in
    it.
    """
    along = directions[side.pairs]
    depth = np.sum(along * side.places, axis=1)
    width = np.linalg.norm(np.einsum("exy,ex->ey", side.reaches, along), axis=1)
    reach = np.maximum.reduceat(depth + width, side.begins)
    shares = np.exp(FOREMOST / spacing * depth)
    means = side.sums(np.column_stack([shares, shares[:, None] * side.places]))
    return reach, means[:, 1:] / means[:, :1]


def _farther(one: _Front, other: _Front, spacing: float) -> _Front:
    """Of each pair what has the larger gap, the one where they are alike."""
    better = other.gaps > one.gaps + BETTER_GAP * spacing
    return _Front(
        normals=np.where(better[:, None], other.normals, one.normals),
        gaps=np.where(better, other.gaps, one.gaps),
        lever=np.where(better[:, None], other.lever, one.lever),
    )


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    known = lengths > np.finfo(np.float64).tiny
    return np.where(known, vectors / np.where(known, lengths, 1.0), 0.0)
