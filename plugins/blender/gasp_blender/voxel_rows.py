"""Things at places of a lattice, and the straight rows of neighbours in which they lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["ranks"]

Array = NDArray[Any]


def ranks(places: Array, axis: int) -> tuple[Array, Array]:
    """How many neighbours are before each of the places (P, 3), and how many after it, along an axis: (P,) each."""
    others = [other for other in range(3) if other != axis]
    order = np.lexsort((places[:, axis], places[:, others[1]], places[:, others[0]]))
    steps = np.diff(places[order], axis=0)
    goes_on = (steps[:, axis] == 1) & (steps[:, others] == 0).all(axis=1)
    row = np.concatenate([[0], np.cumsum(~goes_on)])
    first = np.searchsorted(row, np.arange(row[-1] + 1))
    before, after = np.empty(len(places), np.int64), np.empty(len(places), np.int64)
    before[order] = np.arange(len(places)) - first[row]
    after[order] = np.bincount(row)[row] - 1 - before[order]
    return before, after
