"""Points sorted where they are: on a GPU only bodies' boxes, cells and counts come to the host."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp
from gasp_mpm_host.cloud import SortedCloud
from gasp_mpm_host.session import FarAwayError
from numpy.typing import NDArray

from gasp_warp_mpm.ordering import BOX_WIDTH, POINTS_A_BOX

__all__ = ["DeviceOrder"]

Array = NDArray[Any]


class DeviceOrder(SortedCloud):
    """How a cloud is sorted that is stepped in the way of a GPU; others are sorted by the host."""

    _kernels: Any
    _atomic: bool
    """The way of a GPU, whose memory is not the host's: arrays of NumPy do not show it as it is."""

    @abstractmethod
    def _launch(self, kernel: Any, size: int, *inputs: Any) -> None:
        """Launch a kernel in `size` threads."""

    @abstractmethod
    def _put(self, host: Array, kind: Any) -> Any:
        """An array in the memory of the tables."""

    @abstractmethod
    def _empty(self, size: int, kind: Any) -> Any:
        """Room there for `size` of them."""

    @abstractmethod
    def _permute_by(self, order: Any) -> None:
        """Put the points into the order of the rows `order`, which is in that memory."""

    @cached_property
    def _bodies_there(self) -> Any:
        return self._put(self._bodies, wp.int32)

    @property
    def _ids(self) -> Array:
        """(N,) int32, which of the scene's points each row is: brought here when somebody asks."""
        if self._ids_here is None:
            self._ids_here = self._ids_there.numpy()
        return self._ids_here

    @_ids.setter
    def _ids(self, ids: Array) -> None:
        self._ids_here: Array | None = ids
        if self._atomic:
            self._ids_there = self._put(ids, wp.int32)

    def _settled(self) -> Array:
        if not self._atomic:
            return super()._settled()
        kernels, count = self._kernels.order, len(self._stands)
        boxes = self._empty(count * BOX_WIDTH, wp.int32)
        self._launch(kernels.begin_boxes, count, boxes)
        threads = -(-self._count // POINTS_A_BOX)
        self._launch(kernels.box_homes, threads, self._ids_there, self._bodies_there, boxes)
        found = boxes.numpy().reshape(count, BOX_WIDTH)
        if found[:, -1].any():
            raise FarAwayError
        self._settle()
        return found[:, :-1].reshape(count, 2, 3).astype(np.int64)

    def _put_in_order(self, lower: Array, shape: Array) -> tuple[Array, Array]:
        if not self._atomic:
            return super()._put_in_order(lower, shape)
        kernels, count = self._kernels.order, self._count
        # As much again is room to sort in.
        keys, order = (self._empty(2 * count, wp.int32) for _ in range(2))
        grid = wp.vec3i(*lower.tolist()), wp.vec3i(*(shape // 4).tolist())
        self._launch(kernels.number_cells, count, *grid, keys, order)
        wp.utils.radix_sort_pairs(keys, order, count, end_bit=int(np.prod(shape)).bit_length())
        cells, counts = (self._empty(count, wp.int32) for _ in range(2))
        filled = wp.utils.runlength_encode(keys, cells, counts, value_count=count)
        self._permute_by(order)
        before, self._ids_there = self._ids_there, self._empty(count, wp.int32)
        self._launch(kernels.permute_ids, count, order, before, self._ids_there)
        self._ids_here = None
        return cells[:filled].numpy(), counts[:filled].numpy()
