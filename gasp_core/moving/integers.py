"""Whole numbers as bytes that a general compressor packs well.

Numbers are taken off those that foretell them, what is left is folded to 0, -1, 1, -2, ... = 0, 1, 2, 3, ..., and
written byte by byte: first the lowest bytes of all numbers, column after column, then the next ones, as many as the
largest number takes. Small numbers leave the higher bytes zero, which a compressor makes nothing of.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["LARGEST", "decoded", "encoded"]

Array = NDArray[Any]

LARGEST = 2**30
"""Of a number and of a difference."""


def encoded(numbers: Array) -> bytes:
    """How many bytes a number takes (one byte), then the numbers (N, C), each taken off the one in the row above.

    Raises
    ------
    ValueError
        Where one is not below `LARGEST`.
    """
    differences = np.diff(numbers.astype(np.int64), axis=0, prepend=0)
    if numbers.size and max(np.abs(numbers).max(), np.abs(differences).max()) >= LARGEST:
        raise ValueError("a number is too large to be written")
    folded = ((differences << 1) ^ (differences >> 63)).astype("<u4").T
    planes = np.ascontiguousarray(folded).view(np.uint8).reshape(-1, 4).T
    width = max(1, 4 - int(np.argmax(planes[::-1].any(axis=1)))) if planes.any() else 1
    return bytes([width]) + planes[:width].tobytes()


def decoded(data: memoryview, rows: int, columns: int) -> tuple[Array, memoryview]:
    """Numbers (rows, columns) int64 that `encoded` wrote, and what comes behind them.

    Raises
    ------
    ValueError
        Where there is less than that.
    """
    count = rows * columns
    width = data[0] if len(data) else 0
    if not 1 <= width <= 4 or len(data) < 1 + width * count:
        raise ValueError("numbers are cut off")
    planes = np.zeros((count, 4), dtype=np.uint8)
    planes[:, :width] = np.frombuffer(data, np.uint8, width * count, 1).reshape(width, count).T
    folded = planes.view("<u4").reshape(columns, rows).T.astype(np.int64)
    return np.cumsum((folded >> 1) ^ -(folded & 1), axis=0), data[1 + width * count :]
