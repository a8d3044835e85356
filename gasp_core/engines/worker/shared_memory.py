"""Arrays from one process to another through memory that both have mapped.

The memory has no name: it is a file descriptor that a worker inherits. So nothing of it can be left behind, whichever
of the two is killed, and it is not bounded by the size of a mounted /dev/shm, which containers keep small.
"""

from __future__ import annotations

import mmap
import os
import tempfile
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.threads import processors

__all__ = ["Block", "Layout"]

Array = NDArray[Any]
Layout = dict[str, tuple[str, list[int], int]]
"""By name: type of the elements, shape, and offset in the block [bytes]."""

_ALIGNMENT = 64

_WORTH_A_THREAD = 2**22
"""Bytes that take some tenths of a millisecond to copy, ten times what starting a thread does."""


class Block:
    """A piece of shared memory that grows as needed and is used again for every parcel.

    Parameters
    ----------
    descriptor
        Of the memory; the block owns it.
    """

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._map: mmap.mmap | None = None

    @classmethod
    def make(cls) -> Block:
        """New memory that no other process has yet."""
        if hasattr(os, "memfd_create"):
            return cls(os.memfd_create("gasp-worker"))
        with tempfile.TemporaryFile() as nameless:
            return cls(os.dup(nameless.fileno()))

    def pack(self, arrays: Mapping[str, Array]) -> Layout:
        """Copy arrays into the block; what was there is overwritten.

        Raises
        ------
        TypeError
            Where an array holds anything but numbers, truth values or text.
        OSError
            Where there is not so much memory.
        """
        layout: Layout = {}
        end = 0
        for name, array in arrays.items():
            if array.dtype.kind not in "biufcSU":
                raise TypeError(f'array "{name}" of type {array.dtype} cannot be sent: use plain numbers')
            layout[name] = (array.dtype.str, list(array.shape), end)
            end += -(-array.nbytes // _ALIGNMENT) * _ALIGNMENT
        self._reserve(end)
        for view, array in zip(self._views(layout).values(), arrays.values()):
            _copy(view, array)
        return layout

    def unpack(self, layout: Layout, empty: Callable[[tuple[int, ...], Any], Array] = np.empty) -> dict[str, Array]:
        """Copies of the arrays in the block, owned by whoever asks.

        Parameters
        ----------
        layout
            What `pack` said at the other end.
        empty
            Makes the arrays to copy into, of a shape and a type.

        Raises
        ------
        ValueError, TypeError
            Where the layout is not of what the block holds.
        """
        views = self._views(layout)
        if self._map is not None and sum(view.nbytes for view in views.values()) > len(self._map):
            raise ValueError("they are more than the memory holds")
        copies: dict[str, Array] = {}
        for name, view in views.items():
            copies[name] = empty(view.shape, view.dtype)
            _copy(copies[name], view)
        return copies

    def close(self) -> None:
        """Let go of the memory; it is freed once both processes have. May be called twice."""
        self._map = None
        descriptor, self.descriptor = self.descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _reserve(self, size: int) -> None:
        if os.fstat(self.descriptor).st_size >= size:
            return
        if hasattr(os, "posix_fallocate"):
            # Lack of memory is an error here; a page that is missing later would be a SIGBUS.
            os.posix_fallocate(self.descriptor, 0, size)
        else:
            os.ftruncate(self.descriptor, size)

    def _views(self, layout: Layout) -> dict[str, Array]:
        self._reserve(mmap.PAGESIZE)  # nothing at all cannot be mapped
        size = os.fstat(self.descriptor).st_size
        if self._map is None or len(self._map) < size:
            self._map = mmap.mmap(self.descriptor, size)
        return {
            name: np.ndarray(tuple(shape), dtype=np.dtype(kind), buffer=self._map, offset=offset)
            for name, (kind, shape, offset) in layout.items()
        }


def _copy(target: Array, source: Array) -> None:
    """Copy rows, by two threads where there is much to copy: one does not use all that the memory bears."""
    if source.nbytes < _WORTH_A_THREAD or source.ndim == 0 or processors() == 1:
        np.copyto(target, source)
        return
    half = len(source) // 2
    other = threading.Thread(target=np.copyto, args=(target[:half], source[:half]))
    other.start()
    np.copyto(target[half:], source[half:])
    other.join()
