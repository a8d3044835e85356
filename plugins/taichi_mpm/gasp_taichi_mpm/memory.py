"""Arrays where the kernels want them: NumPy's own memory on the CPU, Taichi's on a GPU."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_taichi_mpm import cuda_context
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["Memory"]

Array = NDArray[Any]

_TYPES = {np.dtype(np.float32): ti.f32, np.dtype(np.float64): ti.f64, np.dtype(np.int32): ti.i32}


class Memory:
    """Makes, reads and writes kernel arguments.

    On the CPU they are NumPy arrays, which Taichi uses in place: nothing is copied, and no memory of ours dies with
    Taichi's runtime.
    """

    def __init__(self, *, on_gpu: bool) -> None:
        self.on_gpu = on_gpu

    def put(self, host: Array) -> Any:
        """A kernel argument holding a copy of `host`: (n,) scalars or (n, k) vectors of k."""
        host = np.ascontiguousarray(host)
        if not self.on_gpu:
            return host.copy()
        argument = self.empty(host.shape, host.dtype)
        argument.from_numpy(host)
        return argument

    def empty(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """A kernel argument of a shape as for `put`, its content undefined."""
        if not self.on_gpu:
            return np.empty(shape, dtype=dtype)
        cuda_context.enter()
        kind = _TYPES[np.dtype(dtype)]
        if len(shape) == 2:
            return ti.Vector.ndarray(shape[1], kind, shape[0])
        return ti.ndarray(kind, shape)

    def get(self, argument: Any) -> Array:
        """The content: on the CPU the very memory, on a GPU a copy."""
        if not self.on_gpu:
            return argument
        cuda_context.enter()
        return argument.to_numpy()

    def write(self, argument: Any, host: Array) -> None:
        """Replace the content by `host`, of the same shape."""
        if self.on_gpu:
            cuda_context.enter()
            argument.from_numpy(np.ascontiguousarray(host))
        elif argument is not host:
            argument[...] = host
