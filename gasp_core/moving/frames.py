"""Frames of whole numbers, each foretold by the ones before it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.moving.bodies import Corrections
from gasp_core.moving.integers import decoded, encoded

__all__ = ["FrameReader", "FrameWriter", "decoded_corrections", "encoded_corrections"]

Array = NDArray[Any]

_NOTHING, _LAST, _LINE = range(3)
"""What foretells a frame: nothing, the last one, or the last two, as if all went on as it did."""


class FrameWriter:
    """Writes the numbers of one body, frame after frame."""

    def __init__(self) -> None:
        self._before: list[Array] = []

    def write(self, numbers: Array) -> bytes:
        """A frame (N, C), as short as it can be foretold.

        Raises
        ------
        ValueError
            Where a number is too large.
        """
        found = [
            bytes([kind]) + encoded(numbers - foretold)
            for kind, foretold in enumerate(_foretold(self._before, numbers))
        ]
        self._before = [*self._before[-1:], numbers]
        return min(found, key=_entropy)


class FrameReader:
    """Reads what `FrameWriter` wrote, in the same order."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._before: list[Array] = []

    def read(self, data: memoryview) -> tuple[Array, memoryview]:
        """The numbers of the next frame, and what comes behind them.

        Raises
        ------
        ValueError
            Where they are cut off.
        """
        choices = _foretold(self._before, np.zeros(self._shape, dtype=np.int64))
        if not len(data) or data[0] >= len(choices):
            raise ValueError("a frame is foretold by frames that there are not")
        differences, rest = decoded(data[1:], *self._shape)
        numbers = choices[data[0]] + differences
        self._before = [*self._before[-1:], numbers]
        return numbers, rest


def _foretold(before: Sequence[Array], like: Array) -> list[Array]:
    found: list[Array] = [np.zeros_like(like)]
    if before:
        found.append(before[-1])
    if len(before) > 1:
        found.append(2 * before[-1] - before[-2])
    return found


def _entropy(data: bytes) -> float:
    """How many bits it will take, about."""
    counts = np.bincount(np.frombuffer(data, np.uint8))
    counts = counts[counts > 0]
    return float(counts.sum() * np.log2(counts.sum()) - (counts * np.log2(counts)).sum())


_COUNT = struct.Struct("<I")


def encoded_corrections(corrections: Corrections) -> bytes:
    """How many, then rows, then numbers."""
    count = len(corrections.rows)
    if not count:
        return _COUNT.pack(0)
    return _COUNT.pack(count) + encoded(corrections.rows[:, None]) + encoded(corrections.numbers)


def decoded_corrections(data: memoryview, rows: int) -> tuple[Corrections, memoryview]:
    """What `encoded_corrections` wrote of a body of so many rows, and what comes behind it.

    Raises
    ------
    ValueError
        Where it is cut off, or of rows that there are not.
    """
    if len(data) < _COUNT.size:
        raise ValueError("corrections are cut off")
    (count,) = _COUNT.unpack_from(data)
    data = data[_COUNT.size :]
    if count > rows:
        raise ValueError("there are more corrections than Gaussians")
    if not count:
        return Corrections(rows=np.zeros(0, dtype=np.int64), numbers=np.zeros((0, 12), dtype=np.int64)), data
    which, data = decoded(data, count, 1)
    numbers, data = decoded(data, count, 12)
    which = which[:, 0]
    if which.min() < 0 or which.max() >= rows:
        raise ValueError("a correction is of a Gaussian that there is not")
    return Corrections(rows=which, numbers=numbers), data
