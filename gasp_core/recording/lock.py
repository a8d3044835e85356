"""Who is writing a recording: one process at most, and one can tell whether it lives."""

from __future__ import annotations

import os
import time
from pathlib import Path

__all__ = ["lock", "locked"]

try:
    import fcntl
except ImportError:  # Windows has no flock; there two runs into one folder are not kept apart.
    fcntl = None


def lock(path: Path) -> int | None:
    """Take a recording for writing: the open descriptor that holds it, or None where somebody else does.

    The lock ends with the process, however that ends.
    """
    descriptor = os.open(path / "zarr.json", os.O_RDWR)
    if fcntl is None:
        return descriptor
    for _ in range(20):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            # A reader that just looks holds it for microseconds.
            time.sleep(0.01)
        else:
            return descriptor
    os.close(descriptor)
    return None


def locked(path: Path) -> bool:
    """Whether a living process writes the recording."""
    if fcntl is None:
        return True
    descriptor = os.open(path / "zarr.json", os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
