"""Points that ride along: in the cells of a cage, by trilinear weights, or on a rigid body."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

__all__ = ["CORNERS", "Embedding", "carry_rigidly"]

Array = NDArray[Any]

CORNERS: Array = np.array(list(itertools.product((0, 1), repeat=3)))
"""Corners of a cell, (8, 3) in cells: x slowest, z fastest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Embedding:
    """Where points lie in a cage.

    Parameters
    ----------
    corners : (C, 8)
        Nodes of the cells, in the order of `CORNERS`.
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
        _carry(self._polynomials(values), self.cells, self.places, start, rows, out)

    def spread(self, values: Array, rows: Array, out: Array) -> None:
        """out[rows[p]] = the values (nodes, 3) interpolated at p, for the first points, one a row."""
        _spread(self._polynomials(values), self.cells, self.places, rows, out)

    def _polynomials(self, values: Array) -> Array:
        """Coefficients (24 C,) of what is interpolated in each cell: of 1, x, y, x y, z, ... and x y z, three each.

        That takes 6 ns a point, where weights take 11: there are fewer products, and what they need lies side by side.
        """
        found = values[self.corners].reshape(-1, 2, 2, 2, 3)
        for axis in (1, 2, 3):
            low, high = np.split(found, 2, axis=axis)
            found = np.concatenate([low, high - low], axis=axis)
        return np.ascontiguousarray(found.transpose(0, 3, 2, 1, 4)).ravel()


@numba.njit(inline="always")
def _at(table: Array, first: int, x: float, y: float, z: float) -> float:
    """One component of a cell's polynomial, whose constant is at `first`."""
    low = table[first] + z * table[first + 12] + y * (table[first + 6] + z * table[first + 18])
    high = table[first + 3] + z * table[first + 15] + y * (table[first + 9] + z * table[first + 21])
    return low + x * high


@numba.njit(cache=True, parallel=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _carry(table: Array, cells: Array, places: Array, start: Array, rows: Array, out: Array) -> None:
    for point in numba.prange(len(rows)):
        first, row = 24 * cells[point], rows[point]
        x, y, z = places[point, 0], places[point, 1], places[point, 2]
        out[row, 0] = start[row, 0] + _at(table, first, x, y, z)
        out[row, 1] = start[row, 1] + _at(table, first + 1, x, y, z)
        out[row, 2] = start[row, 2] + _at(table, first + 2, x, y, z)


@numba.njit(cache=True, parallel=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _spread(table: Array, cells: Array, places: Array, rows: Array, out: Array) -> None:
    for point in numba.prange(len(rows)):
        first, row = 24 * cells[point], rows[point]
        x, y, z = places[point, 0], places[point, 1], places[point, 2]
        out[row, 0] = _at(table, first, x, y, z)
        out[row, 1] = _at(table, first + 1, x, y, z)
        out[row, 2] = _at(table, first + 2, x, y, z)


@numba.njit(cache=True, parallel=True, nogil=True)
def carry_rigidly(arms: Array, turn: Array, shift: Array, rows: Array, out: Array) -> None:
    """out[rows[p]] = turn @ arms[p] + shift, of arms (N, 3), a matrix (3, 3) and a vector (3,)."""
    for point in numba.prange(len(rows)):
        row = rows[point]
        x, y, z = arms[point, 0], arms[point, 1], arms[point, 2]
        for axis in range(3):
            out[row, axis] = turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] * z + shift[axis]
