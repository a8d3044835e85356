# pyright: basic
# numba's decorators carry no types.
"""Which Gaussians touch which tile, nearest first.

Every thread owns a band of rows of tiles and goes through all Gaussians in order: so each list keeps that order without
a sort of pairs, without atomics, and is the same for any number of threads.
"""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["count_pairs", "list_pairs"]

_parallel = numba.njit(cache=True, error_model="numpy", parallel=True)


@_parallel
def count_pairs(order, boxes, columns, rows, bands):
    """How many Gaussians each tile has.

    Parameters
    ----------
    order : (M,) int32
        Gaussians that are drawn.
    boxes : (N, 4) int16
        Tiles of each: first column, end, first row, end.
    columns, rows
        Tiles of the picture.
    bands
        Rows are shared out in so many bands.

    Returns
    -------
    (rows * columns,) int64
    """
    counts = np.zeros(rows * columns, np.int64)
    for band in numba.prange(bands):
        top, bottom = band * rows // bands, (band + 1) * rows // bands
        for i in order:
            for row in range(max(boxes[i, 2], top), min(boxes[i, 3], bottom)):
                for column in range(boxes[i, 0], boxes[i, 1]):
                    counts[row * columns + column] += 1
    return counts


@_parallel
def list_pairs(order, boxes, columns, rows, bands, starts, lists):
    """Fill `lists` with the Gaussians of each tile, in the given order.

    Parameters
    ----------
    order, boxes, columns, rows, bands
        As in `count_pairs`.
    starts : (rows * columns + 1,) int64
        Where the list of each tile begins, and the number of pairs.
    lists : (pairs,) int32
    """
    ends = starts.copy()
    for band in numba.prange(bands):
        top, bottom = band * rows // bands, (band + 1) * rows // bands
        for i in order:
            for row in range(max(boxes[i, 2], top), min(boxes[i, 3], bottom)):
                for column in range(boxes[i, 0], boxes[i, 1]):
                    tile = row * columns + column
                    lists[ends[tile]] = i
                    ends[tile] += 1
