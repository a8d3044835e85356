# pyright: basic
# numba's decorators carry no types.
"""Gaussians in the order of their depths."""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["front_to_back"]

_DIGIT = 11
"""Bits sorted at once: 2048 counters stay in the nearest cache."""
_PASSES = 4


@numba.njit(cache=True, error_model="numpy")
def front_to_back(depths):
    """Rows with a finite depth, nearest first; equal depths keep their order.

    A radix sort. The bits of positive floats order as the floats do. With the nearest depth's taken off, the highest 44
    of those in use are compared: for depths within a factor of a thousand, differences above 2^-40 of them. Float32
    would see one Gaussian in thirty as deep as the next and draw them in the wrong order.

    Parameters
    ----------
    depths : (N,) float64
        Positive, or inf for what is not drawn.

    Returns
    -------
    (M,) int32
    """
    bits = depths.view(np.uint64)
    infinite = np.uint64(0x7FF0000000000000)
    lowest, highest, count = infinite, np.uint64(0), 0
    for i in range(len(bits)):
        if bits[i] != infinite:
            lowest, highest = min(lowest, bits[i]), max(highest, bits[i])
            count += 1
    used = 0
    while used < 64 and (highest - lowest) >> np.uint64(used) != 0 and count > 0:
        used += 1
    dropped = np.uint64(max(0, used - _DIGIT * _PASSES))

    keys, rows = np.empty(count, np.uint64), np.empty(count, np.int32)
    other_keys, other_rows = np.empty(count, np.uint64), np.empty(count, np.int32)
    starts = np.zeros((_PASSES, 1 << _DIGIT), np.int64)
    mask = np.uint64((1 << _DIGIT) - 1)
    k = 0
    for i in range(len(bits)):
        if bits[i] != infinite:
            key = (bits[i] - lowest) >> dropped
            keys[k], rows[k] = key, i
            k += 1
            for place in range(_PASSES):
                starts[place, (key >> np.uint64(_DIGIT * place)) & mask] += 1
    for place in range(_PASSES):
        start = 0
        for digit in range(1 << _DIGIT):
            start, starts[place, digit] = start + starts[place, digit], start
        for k in range(count):
            digit = (keys[k] >> np.uint64(_DIGIT * place)) & mask
            target = starts[place, digit]
            starts[place, digit] = target + 1
            other_keys[target], other_rows[target] = keys[k], rows[k]
        keys, other_keys, rows, other_rows = other_keys, keys, other_rows, rows
    return rows
