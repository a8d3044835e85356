"""What points that are led do to the nodes of a grid.

They give mass to it as others do. The nodes that are nearer to them than to others of their body have the velocity of
theirs, whatever else acts.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.stepping.led_bodies import LedBodies, Slopes
from gasp_core.stepping.led_points import LedPoints

__all__ = ["HEAVY", "LedGrid", "LedNodes"]

Array = NDArray[Any]

HEAVY = 2.0**100
"""Mass of a led node, in mean masses of points: what meets it gives way, and it does not, to the last bit. A power of
two times a velocity is exact, and this one is a float32."""
_TOUCH = 1e-3
"""In cells: a node on the boundary itself is led, whichever way its place was rounded."""
_SPARSE = 8
"""Times as many possible keys as keys: up to that a table of all of them is sooner made than a sorted list."""
_AROUND = np.array(list(itertools.product(range(3), repeat=3)))


@dataclass(frozen=True, slots=True, kw_only=True)
class LedNodes:
    """Nodes that led points take along.

    Parameters
    ----------
    nodes : (G, 3)
        In cells.
    bodies : (G,)
    weights
        (G, K), sparse, of the points at each node; of sum 1.
    slopes : (G, 3) [m/s]
        What their velocities change by on the way to the node.
    """

    nodes: Array
    bodies: Array
    weights: Any
    slopes: Array

    def velocities(self, of_points: Array) -> Array:
        """Of the nodes, (G, 3) [m/s], where those of the points are (K, 3) [m/s]."""
        return self.weights @ of_points + self.slopes


@dataclass(frozen=True, slots=True, kw_only=True)
class LedGrid:
    """The led points of a problem and a grid.

    Parameters
    ----------
    led
        Those that are led, among the others.
    spacing
        Of the grid [m].
    origin : (3,) [m]
        Where node (0, 0, 0) is.
    """

    led: LedBodies
    spacing: float
    origin: Array

    @classmethod
    def of(cls, problem: PointProblem, points: LedPoints, spacing: float, origin: Array) -> Self:
        """Of those of a problem."""
        return cls(led=LedBodies.of(problem, points), spacing=spacing, origin=origin)

    @property
    def points(self) -> LedPoints:
        """Those that are led."""
        return self.led.points

    def around(self, positions: Array, velocities: Array) -> LedNodes:
        """The nodes that are led while the points are at positions (K, 3) [m] with velocities (K, 3) [m/s].

        They are those that were nearer to led points than to others of their body at the start, had they gone with the
        points around them.
        """
        points = self.points
        slopes = Slopes.of(positions, self.led.neighbours, np.arange(len(positions)))
        nodes, bodies, weights = self._spread((positions - self.origin) / self.spacing)
        # About a corner of their own: coordinates may be large.
        low = nodes.min(axis=0)
        corner = self.origin + self.spacing * low
        local, places = positions - corner, self.spacing * (nodes - low)
        moved = slopes.of_displacements(positions - points.start)
        gone = weights @ (positions - points.start) + _along(weights, moved, local, places)
        near = self.led.nearer(places + corner - gone, bodies, 2 * _TOUCH * self.spacing)
        weights = weights[near]
        along = _along(weights, slopes.of_velocities(velocities), local, places[near])
        return LedNodes(nodes=nodes[near], bodies=bodies[near], weights=weights, slopes=along)

    def _spread(self, cells: Array) -> tuple[Array, Array, Any]:
        """Nodes (G, 3) around points at `cells` (K, 3), bodies (G,), and weights (G, K), sparse: those of the quadratic
        B-splines times the masses, of sum 1."""
        from scipy import sparse

        base = np.floor(cells - 0.5).astype(np.int64)
        offset = cells - base
        along = np.stack([0.5 * (1.5 - offset) ** 2, 0.75 - (offset - 1) ** 2, 0.5 * (offset - 0.5) ** 2], axis=1)
        i, j, k = _AROUND.T
        weights = (along[:, i, 0] * along[:, j, 1] * along[:, k, 2] * self.points.masses[:, None]).ravel()
        low, shape = base.min(axis=0), np.ptp(base, axis=0) + 3
        sides = np.array([shape[1] * shape[2], shape[2], 1])
        first = self.points.bodies.astype(np.int64) * int(np.prod(shape)) + (base - low) @ sides
        keys = (first[:, None] + _AROUND @ sides).ravel()
        found, rows = _numbered(keys, weights > 0)
        bodies, flat = np.divmod(found, int(np.prod(shape)))
        nodes = np.stack(np.unravel_index(flat, tuple(shape)), axis=1) + low
        columns = np.repeat(np.arange(len(cells)), 27)
        some = np.flatnonzero(rows >= 0)
        shape_of = (len(found), len(cells))
        spread = sparse.coo_array((weights[some], (rows[some], columns[some])), shape=shape_of).tocsr()
        total = np.asarray(spread.sum(axis=1)).reshape(-1)
        spread.data /= np.repeat(total, np.diff(spread.indptr))
        return nodes, bodies, spread


def _numbered(keys: Array, counted: Array) -> tuple[Array, Array]:
    """The different keys (N,) among those that are counted, rising, and the place of each key there, -1 for none."""
    count = int(keys.max()) + 1
    if count > _SPARSE * len(keys):
        found, rows = np.unique(keys[counted], return_inverse=True)
        numbers = np.full(len(keys), -1)
        numbers[counted] = rows.reshape(-1)
        return found, numbers
    there = np.zeros(count, dtype=np.bool_)
    there[keys[counted]] = True
    found = np.flatnonzero(there)
    numbers = np.full(count, -1)
    numbers[found] = np.arange(len(found))
    return found, numbers[keys]


def _along(weights: Any, slopes: Array, points: Array, nodes: Array) -> Array:
    """What the points' values change by on the way to the nodes (G, 3), by their slopes (K, 3, 3): a mean (G, 3)."""
    mean = weights @ slopes.reshape(-1, 9)
    return np.einsum("gij,gj->gi", mean.reshape(-1, 3, 3), nodes) - weights @ np.einsum("kij,kj->ki", slopes, points)
