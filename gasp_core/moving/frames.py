"""Frames of whole numbers, each foretold by the ones before it."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.moving.bodies import Corrections
from gasp_core.moving.integers import decoded, encoded

__all__ = ["CorrectionReader", "CorrectionWriter", "FrameReader", "FrameWriter"]

Array = NDArray[Any]

_NOTHING, _LAST, _LINE = range(3)
"""What foretells a frame: nothing, the last one, or the last two, as if all went on as it did."""


class FrameWriter:
    """Writes the numbers of one body, frame after frame.

    Parameters
    ----------
    shape
        Of a frame: rows and columns.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._before: list[Array] = []

    def write(self, chosen: Callable[[Array], Array]) -> tuple[bytes, Array]:
        """A frame, as short as it can be foretold, and its numbers (N, C).

        Parameters
        ----------
        chosen
            From what is foretold, (N, C), the numbers (N, C): those that are meant, or others near enough to them that
            take less room.

        Raises
        ------
        ValueError
            Where a number is too large.
        """
        found: list[tuple[bytes, Array]] = []
        for kind, foretold in enumerate(_foretold(self._before, self._shape)):
            numbers = chosen(foretold)
            found.append((bytes([kind]) + encoded(numbers - foretold), numbers))
        data, numbers = min(found, key=lambda choice: _entropy(choice[0]))
        self._before = [*self._before[-1:], numbers]
        return data, numbers


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
        choices = _foretold(self._before, self._shape)
        if not len(data) or data[0] >= len(choices):
            raise ValueError("a frame is foretold by frames that there are not")
        differences, rest = decoded(data[1:], *self._shape)
        numbers = choices[data[0]] + differences
        self._before = [*self._before[-1:], numbers]
        return numbers, rest


def _foretold(before: Sequence[Array], shape: tuple[int, int]) -> list[Array]:
    found: list[Array] = [np.zeros(shape, dtype=np.int64)]
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


class CorrectionWriter:
    """Writes the corrections of one body, frame after frame: what is corrected as it was takes next to nothing.

    Parameters
    ----------
    rows
        Of the body.
    """

    def __init__(self, rows: int) -> None:
        self.last = Corrections.none()
        self._rows = rows

    def write(self, corrections: Corrections) -> bytes:
        """How many, which rows are corrected that were not or the other way round, and how far numbers have changed."""
        count = len(corrections.rows)
        last, self.last = self.last, corrections
        if not count:
            return _COUNT.pack(0)
        changed = np.setxor1d(last.rows, corrections.rows)
        differences = corrections.numbers - _numbers_at(last, corrections.rows, self._rows)
        return _COUNT.pack(count) + _COUNT.pack(len(changed)) + encoded(changed[:, None]) + encoded(differences)


class CorrectionReader:
    """Reads what `CorrectionWriter` wrote, in the same order.

    Parameters
    ----------
    rows
        Of the body.
    version
        Of the file: up to 1 there are the rows themselves, and their numbers.
    """

    def __init__(self, rows: int, version: int) -> None:
        self._rows = rows
        self._version = version
        self._last = Corrections.none()

    def read(self, data: memoryview) -> tuple[Corrections, memoryview]:
        """The corrections of the next frame, and what comes behind them.

        Raises
        ------
        ValueError
            Where they are cut off, or of rows that there are not.
        """
        count, data = _counted(data, self._rows)
        if not count:
            self._last = Corrections.none()
        elif self._version < 2:
            rows, data = _decoded_rows(data, count, self._rows)
            numbers, data = decoded(data, count, 12)
            self._last = Corrections(rows=rows, numbers=numbers)
        else:
            changes, data = _counted(data, self._rows)
            changed, data = _decoded_rows(data, changes, self._rows)
            rows = np.setxor1d(self._last.rows, changed)
            if len(rows) != count:
                raise ValueError("corrections are of other Gaussians than there are")
            differences, data = decoded(data, count, 12)
            numbers = differences + _numbers_at(self._last, rows, self._rows)
            self._last = Corrections(rows=rows, numbers=numbers)
        return self._last, data


def _counted(data: memoryview, most: int) -> tuple[int, memoryview]:
    if len(data) < _COUNT.size:
        raise ValueError("corrections are cut off")
    (count,) = _COUNT.unpack_from(data)
    if count > most:
        raise ValueError("there are more corrections than Gaussians")
    return count, data[_COUNT.size :]


def _decoded_rows(data: memoryview, count: int, most: int) -> tuple[Array, memoryview]:
    rows, data = decoded(data, count, 1)
    if count and (rows.min() < 0 or rows.max() >= most):
        raise ValueError("a correction is of a Gaussian that there is not")
    return rows[:, 0], data


def _numbers_at(corrections: Corrections, chosen: Array, rows: int) -> Array:
    """The numbers (K, 12) of the chosen of so many rows; 0 where there is no correction."""
    places = np.full(rows, len(corrections.rows))
    places[corrections.rows] = np.arange(len(corrections.rows))
    return np.append(corrections.numbers, np.zeros((1, 12), dtype=np.int64), axis=0)[places[chosen]]
