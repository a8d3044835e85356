"""Taichi's CUDA context, made current in whichever thread is about to touch memory of the GPU.

A CUDA context is current in a thread. Taichi makes its own current where it is initialised and where it launches a
kernel, but allocates and frees in whichever context it finds. Without this a process whose sessions lived outside its
main thread is killed on its way out, when what is left is freed in the main thread (CUDA_ERROR_INVALID_CONTEXT, then
SIGABRT).
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import os

__all__ = ["enter", "remember"]

_context = ctypes.c_void_p()


@functools.cache
def _driver() -> ctypes.CDLL:
    return ctypes.CDLL("nvcuda.dll" if os.name == "nt" else "libcuda.so.1")


def remember() -> None:
    """Take note of the context that is current: the one that Taichi has just made or entered."""
    found = ctypes.c_void_p()
    _driver().cuCtxGetCurrent(ctypes.byref(found))
    if not found:
        # Initialised anew, Taichi goes on in the context it has, which need not be current here.
        return
    if not _context:
        atexit.register(enter)
    _context.value = found.value


def enter() -> None:
    """Make it current in this thread; nothing where there is none yet."""
    if _context:
        _driver().cuCtxSetCurrent(_context)
