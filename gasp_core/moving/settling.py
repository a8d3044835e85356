# pyright: basic
# numba's decorators carry no types; `near_enough` has them.
"""Whole numbers near enough to those that are meant, which take the least room once they are foretold."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["near_enough"]

Array = NDArray[Any]

_FARTHEST = 2**15
"""Up to here a number takes two bytes in memory: where any will do, it goes no farther."""


def near_enough(foretold: Array, wanted: Array, slack: Array) -> Array:
    """Numbers (N, C) that are off what is wanted, (N, C), by no more than `slack` (N,), or by rounding.

    A row has changed by as much as the one above it where that will do, else not at all, else it is rounded: only
    differences from row to row of the changes take room. Where any number will do `slack` is infinite.

    Parameters
    ----------
    foretold : (N, C) int64
    wanted : (N, C)
    slack : (N,)
        Of the distance.
    """
    numbers = np.empty(foretold.shape, dtype=np.int64)
    _settle(foretold, wanted, slack, numbers)
    return numbers


@numba.njit(cache=True, error_model="numpy")
def _settle(foretold, wanted, slack, numbers):
    count, columns = foretold.shape
    change = np.zeros(columns, dtype=np.int64)
    for row in range(count):
        as_above = as_foretold = 0.0
        farthest = 0
        for k in range(columns):
            as_above += (foretold[row, k] + change[k] - wanted[row, k]) ** 2
            as_foretold += (foretold[row, k] - wanted[row, k]) ** 2
            farthest = max(farthest, abs(foretold[row, k] + change[k]), abs(foretold[row, k]))
        bound = slack[row] ** 2 if farthest < _FARTHEST or slack[row] < np.inf else -1.0
        if as_above > bound:
            for k in range(columns):
                change[k] = 0 if as_foretold <= bound else np.int64(np.rint(wanted[row, k])) - foretold[row, k]
        for k in range(columns):
            numbers[row, k] = foretold[row, k] + change[k]
