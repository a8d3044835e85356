"""How a process ends that has Blender in it."""

from __future__ import annotations

import atexit
import ctypes
import gc
import sys
from types import ModuleType

__all__ = ["skip_teardown"]


def skip_teardown() -> None:
    """Let the process end without Blender's own clearing up.

    That runs as the module bpy is freed and in destructors of static objects. It crashes where bpy was imported outside
    the main thread, and waits for ever where something still refers to the module, as a test runner's traceback may.
    So the modules are kept, and the process ends, with its own exit status, before the destructors: handlers of
    `on_exit` (glibc) run last in, first out, and those of bpy were set as it was loaded. Elsewhere Blender clears up.
    """
    library = ctypes.CDLL(None)
    if not sys.platform.startswith("linux") or not hasattr(library, "on_exit"):
        return
    keep = ctypes.pythonapi.Py_IncRef
    keep.argtypes = [ctypes.py_object]
    for module in gc.get_objects():
        if isinstance(module, ModuleType) and module.__name__ in ("bpy", "_bpy"):
            keep(module)
    # What C has buffered would be lost.
    atexit.register(library.fflush, None)
    library.on_exit(library._exit, None)
