"""Memory for arrays that are handed out, taken back once nobody has them any more.

To have the system give every frame fresh pages costs more than to fill them (benchmarks/worker_round_trip.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Recycling"]

Array = NDArray[Any]

_KEPT = 4
"""Pieces of one size that wait: positions and velocities of the frame before and of this one."""


class Recycling:
    """Makes arrays; the memory of those that are gone is used again for others of the same size."""

    def __init__(self) -> None:
        self._spare: dict[int, list[Array]] = {}

    def empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
        """An array of whatever values, in memory that is its own as long as it, or any view of it, lives."""
        size = int(np.prod(shape)) * dtype.itemsize
        spare = self._spare.setdefault(size, [])
        # One list is shared by all that die, in whatever thread: pop first, ask later.
        try:
            piece = spare.pop()
        except IndexError:
            piece = np.empty(size, dtype=np.uint8)
        lease: Array = np.asarray(_Lease(piece, spare))
        return lease.view(dtype).reshape(shape)


class _Lease:
    """Holds a piece of memory for the arrays that lie in it, which all keep it alive."""

    def __init__(self, piece: Array, spare: list[Array]) -> None:
        self.__array_interface__ = piece.__array_interface__
        self._piece = piece
        self._spare = spare

    def __del__(self) -> None:
        if len(self._spare) < _KEPT:
            self._spare.append(self._piece)
