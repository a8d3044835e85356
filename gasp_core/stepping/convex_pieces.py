"""Convex pieces that fill a body: what engines touch with that know contact of convex shapes alone.

A piece is the hull of what a box of the field's grid holds. The box of the piece that goes beyond the body the most is
cut in two, by the plane of nodes that leaves the least beyond it, until none goes beyond by more than a spacing. So
decomposes VHACD (Mamou and Ghorbel 2009), where the measure is volume; here it is the distance that the field tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import SignedDistanceField

__all__ = ["convex_pieces", "convex_walls"]

Array = NDArray[Any]

_LATITUDES = 13
_EXACT = 20_000
"""Nodes of a box that are asked how far outside they are, at most."""
_GUESSED = 1_000
"""Nodes that are asked where a box is to be cut."""
_CUTS = 8
"""Planes across each axis of which one cuts a box."""
_COARSER = 4
"""Of so many directions one is enough for where to cut."""
_PARTS = 16
"""Of the directions, one after the other, for fewer and fewer nodes."""


def convex_pieces(field: SignedDistanceField, most: int) -> list[Array]:
    """Convex bodies in which the body lies, and which go beyond it by a spacing, or by more where they are `most`.

    The hull of all of them is that of the body, where its surface crosses the edges of the grid: to the last digit.

    Parameters
    ----------
    field
        The body.
    most
        How many pieces there are at most, >= 1.

    Returns
    -------
    list of (V, 3) [m]
        Points that span each.
    """
    return _pieces(field.values.astype(np.float64), _axes(field), field.spacing, most)


def convex_walls(field: SignedDistanceField, thickness: float, most: int) -> list[Array]:
    """As `convex_pieces`, of what is around the body: a hollow of its shape in walls of this thickness [m] or more."""
    axes = _axes(field)
    for axis in axes:
        # Outermost nodes are in the walls: these may as well be farther out.
        axis[0] -= thickness
        axis[-1] += thickness
    return _pieces(-field.values.astype(np.float64), axes, field.spacing, most)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Piece:
    """What nodes `low` to `high` (3,) hold, both included.

    Parameters
    ----------
    points : (V, 3) [m]
        That span it.
    depth
        How far it goes beyond the body [m].
    """

    low: Array
    high: Array
    points: Array
    depth: float

    @property
    def nodes(self) -> tuple[slice, ...]:
        """Of the grid."""
        return tuple(slice(low, high + 1) for low, high in zip(self.low, self.high))


def _axes(field: SignedDistanceField) -> list[Array]:
    return [start + field.spacing * np.arange(count) for start, count in zip(field.origin, field.values.shape)]


def _pieces(values: Array, axes: list[Array], tolerance: float, most: int) -> list[Array]:
    found = [_piece(values, axes, np.zeros(3, dtype=int), np.array(values.shape) - 1)]
    done: list[_Piece] = []
    while found and len(found) + len(done) < most:
        deepest = max(range(len(found)), key=lambda number: found[number].depth)
        piece = found.pop(deepest)
        cut = _cut(values, axes, piece) if piece.depth > tolerance else None
        if cut is None:
            done.append(piece)
            if piece.depth <= tolerance:
                break
            continue
        axis, at = cut
        for low, high in ((piece.low[axis], at), (at, piece.high[axis])):
            lower, upper = piece.low.copy(), piece.high.copy()
            lower[axis], upper[axis] = low, high
            part = _piece(values, axes, lower, upper)
            if len(part.points):
                found.append(part)
    return [piece.points for piece in (*done, *found)]


def _piece(values: Array, axes: list[Array], low: Array, high: Array) -> _Piece:
    """The piece within a box of nodes, which is made as small as it can be."""
    within = np.argwhere(values[tuple(slice(a, b + 1) for a, b in zip(low, high))] < 0)
    if not len(within):
        return _Piece(low=low, high=high, points=np.zeros((0, 3)), depth=0.0)
    low, high = np.maximum(low, low + within.min(axis=0) - 1), np.minimum(high, low + within.max(axis=0) + 1)
    box = tuple(slice(a, b + 1) for a, b in zip(low, high))
    own = [axis[part] for axis, part in zip(axes, box)]
    points = _spanning(values[box], own)
    outside = _some(np.argwhere(values[box] > 0), _EXACT)
    held = _within(points, _at(own, outside))
    depth = float(values[box][tuple(outside[held].T)].max(initial=0.0))
    return _Piece(low=low, high=high, points=points, depth=depth)


def _at(axes: list[Array], nodes: Array) -> Array:
    """Where nodes (N, 3) are, (N, 3) [m]."""
    return np.stack([axis[column] for axis, column in zip(axes, nodes.T)], axis=1)


def _spanning(values: Array, axes: list[Array]) -> Array:
    """Where the surface crosses edges of the grid, and the nodes inside on the faces of the box, (V, 3) [m]."""
    inside = values < 0
    faces = np.ones(values.shape, dtype=bool)
    faces[1:-1, 1:-1, 1:-1] = False
    found = [_at(axes, np.argwhere(inside & faces))]
    for axis in range(3):
        ahead = np.moveaxis(inside, axis, 0)
        crossed = np.moveaxis(ahead[1:] != ahead[:-1], 0, axis)
        first = np.argwhere(crossed)
        second = first + np.eye(3, dtype=int)[axis]
        before, after = values[tuple(first.T)], values[tuple(second.T)]
        share = (before / (before - after))[:, None]
        found.append((1 - share) * _at(axes, first) + share * _at(axes, second))
    return np.concatenate(found)


def _cut(values: Array, axes: list[Array], piece: _Piece) -> tuple[int, int] | None:
    """Axis and node by which the two parts go beyond the body the least; None where the box is as thin as can be."""
    sub = values[piece.nodes]
    own = [axis[part] for axis, part in zip(axes, piece.nodes)]
    directions = _HALF_BALL[::_COARSER]
    solid, empty = (_some(np.argwhere(side), _GUESSED) for side in (sub < 0, sub > 0))
    of_solid, of_empty = (_heights(directions, _at(own, nodes)) for nodes in (solid, empty))
    best: tuple[int, int] | None = None
    least = np.inf
    for axis in range(3):
        last = sub.shape[axis] - 1
        if last < 2:
            continue
        cuts = np.unique(np.linspace(1, last - 1, _CUTS).astype(int))
        ahead = _held_before(cuts, solid[:, axis], empty[:, axis], of_solid, of_empty)
        beyond = ahead + _held_before(-cuts, -solid[:, axis], -empty[:, axis], of_solid, of_empty)
        if beyond.min() < least:
            best, least = (axis, int(piece.low[axis] + cuts[np.argmin(beyond)])), beyond.min()
    return best


def _held_before(cuts: Array, solid: Array, empty: Array, of_solid: Array, of_empty: Array) -> Array:
    """How many empty nodes are in the hull of what is solid, up to each of some planes, (C,).

    Parameters
    ----------
    cuts : (C,)
        The planes.
    solid, empty : (S,), (E,)
        Where nodes are across them.
    of_solid, of_empty : (D, S), (D, E)
        Their heights.
    """
    inner, outer = np.argsort(solid), np.argsort(empty)
    highest = np.maximum.accumulate(of_solid[:, inner], axis=1)
    lowest = np.minimum.accumulate(of_solid[:, inner], axis=1)
    heights = of_empty[:, outer]
    counts = np.searchsorted(solid[inner], cuts, side="right")
    others = np.searchsorted(empty[outer], cuts, side="right")
    found = np.zeros(len(cuts), dtype=int)
    for number, (count, other) in enumerate(zip(counts, others)):
        if count:
            asked = heights[:, :other]
            held = (asked <= highest[:, count - 1, None]) & (asked >= lowest[:, count - 1, None])
            found[number] = held.all(axis=0).sum()
    return found


def _some(nodes: Array, most: int) -> Array:
    """Of nodes (N, 3) at most so many, drawn: every so many-th would lie in planes."""
    if len(nodes) <= most:
        return nodes
    return nodes[np.random.default_rng(0).choice(len(nodes), most, replace=False)]


def _within(points: Array, places: Array) -> Array:
    """Which places (N, 3) are in the hull of points (V, 3), as far as some hundred directions tell."""
    held = np.ones(len(places), dtype=bool)
    for first in range(_PARTS):
        # A few that go everywhere leave little for the others.
        part = _HALF_BALL[first::_PARTS]
        left = np.flatnonzero(held)
        reach, heights = _heights(part, points), _heights(part, places[left])
        within = (heights <= reach.max(axis=1)[:, None]) & (heights >= reach.min(axis=1)[:, None])
        held[left] = within.all(axis=0)
    return held


def _heights(directions: Array, places: Array) -> Array:
    """Of places (N, 3) along directions (D, 3), (D, N): rounded alike by every processor, which `@` is not."""
    x, y, z = (directions[:, None, axis] * places[:, axis] for axis in range(3))
    return x + y + z


def _half_ball() -> Array:
    """Unit vectors about pi / 24 apart."""
    found = [np.array([[0.0, 0.0, 1.0]])]
    for polar in np.linspace(0, np.pi / 2, _LATITUDES)[1:]:
        count = max(1, round(2 * np.pi * np.sin(polar) / (np.pi / 2 / (_LATITUDES - 1)) / 4)) * 4
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        if polar == np.pi / 2:
            turn = turn[turn < np.pi]
        ring = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
        found.append(np.sin(polar) * ring + np.cos(polar) * np.array([0.0, 0.0, 1.0]))
    return np.concatenate(found)


_HALF_BALL = _half_ball()
