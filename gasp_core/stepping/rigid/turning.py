# pyright: basic
# numba's decorators carry no types; the typed, documented face of this kernel is bodies.py.
"""Rotations of a few bodies: their arithmetic takes less than one call of NumPy does."""

from __future__ import annotations

import math

import numba
import numpy as np

__all__ = ["rotations_of"]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rotations_of(quaternions):
    """`gasp_core.gaussians.rotation_matrices` to the last bit, of quaternions (B, 4) that are finite and not zero."""
    found = np.empty((len(quaternions), 3, 3))
    for row in range(len(quaternions)):
        w, x, y, z = quaternions[row, 0], quaternions[row, 1], quaternions[row, 2], quaternions[row, 3]
        largest = max(max(abs(w), abs(x)), max(abs(y), abs(z)))
        w, x, y, z = w / largest, x / largest, y / largest, z / largest
        length = math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / length, x / length, y / length, z / length
        found[row, 0, 0] = 1 - 2 * (y * y + z * z)
        found[row, 0, 1] = 2 * (x * y - w * z)
        found[row, 0, 2] = 2 * (x * z + w * y)
        found[row, 1, 0] = 2 * (x * y + w * z)
        found[row, 1, 1] = 1 - 2 * (x * x + z * z)
        found[row, 1, 2] = 2 * (y * z - w * x)
        found[row, 2, 0] = 2 * (x * z - w * y)
        found[row, 2, 1] = 2 * (y * z + w * x)
        found[row, 2, 2] = 1 - 2 * (x * x + y * y)
    return found
