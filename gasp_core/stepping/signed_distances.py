"""Signed distances to shapes, compiled with Numba: for many points at once, and for kernels of one's own.

`gasp_core.contract.shapes` has the same in NumPy, and says what is meant; a test holds the two together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, HalfSpace, Shape, SphereShape

__all__ = ["ROW_WIDTH", "distance_at", "shape_rows", "signed_distances"]

Array = NDArray[Any]

ROW_WIDTH = 7
"""Numbers in the row of a shape: which kind it is, a point, and a normal, half extents, or a radius."""
_PLANE, _BOX, _SPHERE = 0.0, 1.0, 2.0


def shape_rows(shapes: Sequence[Shape]) -> Array:
    """Shapes as rows (S, `ROW_WIDTH`) that `distance_at` understands.

    Raises
    ------
    TypeError
        For a kind of shape that is not known here.
    """
    rows = np.zeros((len(shapes), ROW_WIDTH))
    for row, shape in zip(rows, shapes):
        match shape:
            case HalfSpace():
                row[:] = _PLANE, *shape.point, *shape.normal
            case BoxShape():
                row[:] = _BOX, *shape.center, *shape.half_extents
            case SphereShape():
                row[:5] = _SPHERE, *shape.center, shape.radius
            case _:
                raise TypeError(f'no compiled signed distance is known for a shape of kind "{shape.kind}"')
    return rows


@numba.njit(inline="always", error_model="numpy")
def distance_at(rows: Array, shape: int, x: float, y: float, z: float) -> float:
    """Distance [m] of a place to the surface of the shape in a row, negative inside; to be called in kernels."""
    x, y, z = x - rows[shape, 1], y - rows[shape, 2], z - rows[shape, 3]
    a, b, c = rows[shape, 4], rows[shape, 5], rows[shape, 6]
    if rows[shape, 0] == _PLANE:
        return x * a + y * b + z * c
    if rows[shape, 0] == _SPHERE:
        return math.sqrt(x * x + y * y + z * z) - a
    x, y, z = abs(x) - a, abs(y) - b, abs(z) - c
    out_x, out_y, out_z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return math.sqrt(out_x * out_x + out_y * out_y + out_z * out_z) + min(max(x, y, z), 0.0)


def signed_distances(shapes: Sequence[Shape], positions: Array) -> Array:
    """Distances (S, N) [m] of positions (N, 3) [m] to the surfaces of shapes, negative inside.

    Raises
    ------
    TypeError
        For a kind of shape that is not known here.
    """
    return _signed_distances(shape_rows(shapes), np.asarray(positions, dtype=np.float64))


@numba.njit(cache=True, parallel=True, nogil=True, error_model="numpy")
def _signed_distances(rows: Array, positions: Array) -> Array:
    found = np.empty((len(rows), len(positions)))
    for point in numba.prange(len(positions)):
        x, y, z = positions[point, 0], positions[point, 1], positions[point, 2]
        for shape in range(len(rows)):
            found[shape, point] = distance_at(rows, shape, x, y, z)
    return found
