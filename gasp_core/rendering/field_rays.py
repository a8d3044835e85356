"""Where rays meet the surface of a signed distance field: sphere tracing (Hart 1996)."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import SignedDistanceField

__all__ = ["field_distances"]

Array = NDArray[Any]

_SURE = 0.9
"""Of a distance that is gone at once: fields have a slope of about one."""
_SHORTEST = 0.1
"""Of a spacing: as far as a ray goes at least."""
_HALVINGS = 12
"""Of the step that has crossed the surface: a spacing is then known to a few thousandths."""


def field_distances(field: SignedDistanceField, origin: Array, rays: Array, *, inside: bool) -> Array:
    """Depths (...) at which rays origin + depth * ray (..., 3) [m] first go in, or first come out; inf where none does.

    Parameters
    ----------
    inside
        Whether matter is inside, and sees where rays come out.
    """
    values = field.values
    # In spacings from the first node, where depth is what it is here.
    start = (np.asarray(origin, dtype=np.float64) - np.asarray(field.origin)) / field.spacing
    flat = np.ascontiguousarray(rays, dtype=np.float64).reshape(-1, 3) / field.spacing
    found = np.empty(len(flat))
    _trace(values, 1 / field.spacing, start, flat, inside, found)
    return found.reshape(rays.shape[:-1])


@numba.njit(cache=True, inline="always")
def _at(values: Array, x: float, y: float, z: float) -> float:
    i, j, k = (
        min(max(int(x), 0), values.shape[0] - 2),
        min(max(int(y), 0), values.shape[1] - 2),
        min(max(int(z), 0), values.shape[2] - 2),
    )
    x, y, z = x - i, y - j, z - k
    low = (1 - y) * ((1 - z) * values[i, j, k] + z * values[i, j, k + 1])
    low += y * ((1 - z) * values[i, j + 1, k] + z * values[i, j + 1, k + 1])
    high = (1 - y) * ((1 - z) * values[i + 1, j, k] + z * values[i + 1, j, k + 1])
    high += y * ((1 - z) * values[i + 1, j + 1, k] + z * values[i + 1, j + 1, k + 1])
    return (1 - x) * low + x * high


@numba.njit(cache=True, parallel=True, nogil=True, error_model="numpy")
def _trace(values: Array, scale: float, start: Array, rays: Array, inside: bool, found: Array) -> None:
    for number in numba.prange(len(rays)):
        found[number] = np.inf
        # While it is within the grid, on whose rim there is nothing.
        begin, end = 0.0, np.inf
        for axis in range(3):
            way, far = rays[number, axis], values.shape[axis] - 1.0
            if way == 0.0:
                if start[axis] < 0.0 or start[axis] > far:
                    end = -1.0
                continue
            one, other = -start[axis] / way, (far - start[axis]) / way
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        if not begin < end:
            continue
        dx, dy, dz = rays[number, 0], rays[number, 1], rays[number, 2]
        speed = np.sqrt(dx * dx + dy * dy + dz * dz)
        depth, before = begin, begin
        value = scale * _at(values, start[0] + depth * dx, start[1] + depth * dy, start[2] + depth * dz)
        was = value
        while True:
            if (was < 0.0 <= value) if inside else (value <= 0.0 < was):
                for _ in range(_HALVINGS):
                    middle = 0.5 * (before + depth)
                    at = _at(values, start[0] + middle * dx, start[1] + middle * dy, start[2] + middle * dz)
                    if (at < 0.0) == (was < 0.0):
                        before = middle
                    else:
                        depth = middle
                found[number] = depth
                break
            if depth >= end:
                break
            was, before = value, depth
            depth = min(depth + max(_SURE * abs(value), _SHORTEST) / speed, end)
            value = scale * _at(values, start[0] + depth * dx, start[1] + depth * dy, start[2] + depth * dz)
