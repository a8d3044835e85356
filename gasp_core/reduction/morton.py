"""An order of places in which neighbours in space are near each other in memory too."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["along_a_curve"]

Array = NDArray[Any]

_BITS = 10
"""Of a coordinate: a curve through 1024^3 cells."""


def along_a_curve(positions: Array) -> Array:
    """Rows (N,) int32 of positions (N, 3) in the order in which a Morton curve comes by them (Morton 1966)."""
    extent = float(np.ptp(positions, axis=0).max())
    if extent == 0.0:
        return np.arange(len(positions), dtype=np.int32)
    cells = ((positions - positions.min(axis=0)) * ((2**_BITS - 1) / extent)).astype(np.int64)
    codes = np.zeros(len(positions), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(codes, kind="stable").astype(np.int32)
