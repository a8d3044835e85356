"""Second moments of points, and their inverses along the axes that the points extend along."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["known_inverses", "spread_along"]

Array = NDArray[Any]


def known_inverses(moments: Array, thin: float) -> tuple[Array, Array, Array]:
    """Inverses of symmetric matrices on the axes whose values are more than `thin` of the largest, zero across them.

    Parameters
    ----------
    moments : (N, 3, 3)
        Second moments.
    thin
        Share of the largest value.

    Returns
    -------
    inverses : (N, 3, 3)
    axes : (N, 3, 3)
        Principal ones, columns, the shortest first.
    known : (N, 3) bool
        Those that count.
    """
    values, axes = np.linalg.eigh(moments)
    known = values > np.maximum(thin * values[:, 2:], np.finfo(np.float64).tiny)
    return spread_along(axes, np.where(known, 1 / np.where(known, values, 1.0), 0.0)), axes, known


def spread_along(axes: Array, values: Array) -> Array:
    """Symmetric matrices (N, 3, 3) of these principal axes (N, 3, 3), columns, and values (N, 3)."""
    return (axes * values[:, None]) @ axes.transpose(0, 2, 1)
