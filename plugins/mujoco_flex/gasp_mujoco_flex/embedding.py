"""Points that ride along: in the cells of a cage, by trilinear weights, or on a rigid body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gasp_mujoco_flex.elements import CORNERS

__all__ = ["Embedding", "carry_rigidly"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Embedding:
    """Where points lie in a cage.

    Parameters
    ----------
    corners : (C, 8)
        Nodes of the cells.
    cells : (N,) int32
        Cell of each point.
    places : (N, 3)
        In its cell, 0 to 1 along each axis.
    nodes
        Number of them.
    """

    corners: Array
    cells: Array
    places: Array
    nodes: int

    def weights(self) -> sparse.csr_array:
        """Trilinear weights, (N, nodes); each row sums to 1."""
        along = np.where(CORNERS[None].astype(bool), self.places[:, None], 1 - self.places[:, None])
        values = along.prod(axis=2)
        count = len(self.cells)
        starts = np.arange(0, 8 * count + 1, 8)
        columns = self.corners[self.cells].reshape(-1)
        return sparse.csr_array((values.reshape(-1), columns, starts), shape=(count, self.nodes))

    def carry(self, values: Array, start: Array, rows: Array, out: Array) -> None:
        """out[rows[p]] = start[rows[p]] + the values (nodes, 3) interpolated at p, for the first points, one a row."""
        _carry(self.corners, self.cells, self.places, np.ascontiguousarray(values), start, rows, out)

    def spread(self, values: Array, rows: Array, out: Array) -> None:
        """out[rows[p]] = the values (nodes, 3) interpolated at p, for the first points, one a row."""
        _spread(self.corners, self.cells, self.places, np.ascontiguousarray(values), rows, out)


@numba.njit(inline="always")
def _interpolated(corners, cells, places, values, point):  # type: ignore[no-untyped-def]
    """Nodal values (M, 3) at a point, as three numbers."""
    cell = cells[point]
    x, y, z = places[point, 0], places[point, 1], places[point, 2]
    a = b = c = 0.0
    for corner in range(8):
        weight = (x if corner & 4 else 1 - x) * (y if corner & 2 else 1 - y) * (z if corner & 1 else 1 - z)
        node = corners[cell, corner]
        a += weight * values[node, 0]
        b += weight * values[node, 1]
        c += weight * values[node, 2]
    return a, b, c


@numba.njit(cache=True, parallel=True, nogil=True)
def _carry(corners, cells, places, values, start, rows, out):  # type: ignore[no-untyped-def]
    for point in numba.prange(len(rows)):
        a, b, c = _interpolated(corners, cells, places, values, point)
        row = rows[point]
        out[row, 0] = start[row, 0] + a
        out[row, 1] = start[row, 1] + b
        out[row, 2] = start[row, 2] + c


@numba.njit(cache=True, parallel=True, nogil=True)
def _spread(corners, cells, places, values, rows, out):  # type: ignore[no-untyped-def]
    for point in numba.prange(len(rows)):
        row = rows[point]
        out[row, 0], out[row, 1], out[row, 2] = _interpolated(corners, cells, places, values, point)


@numba.njit(cache=True, parallel=True, nogil=True)
def carry_rigidly(arms: Array, turn: Array, shift: Array, rows: Array, out: Array) -> None:
    """out[rows[p]] = turn @ arms[p] + shift, of arms (N, 3), a matrix (3, 3) and a vector (3,)."""
    for point in numba.prange(len(rows)):
        row = rows[point]
        x, y, z = arms[point, 0], arms[point, 1], arms[point, 2]
        for axis in range(3):
            out[row, axis] = turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] * z + shift[axis]
