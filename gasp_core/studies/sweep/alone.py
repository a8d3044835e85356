"""One sweep at a time into a folder."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from gasp_core.errors import RecordingError

__all__ = ["alone_in"]

try:
    import fcntl
except ImportError:  # Windows, where no runs are made in processes of their own either.
    fcntl = None

_LOCK = ".sweep.lock"


@contextmanager
def alone_in(folder: Path) -> Generator[None]:
    """Hold a folder, which is made where it is not there, and goes again where nothing came into it.

    The lock ends with the process, however that ends.

    Raises
    ------
    RecordingError
        Where another process holds it, or it cannot be made.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file, and a sweep has a folder: choose another --out")
    try:
        was_there = folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        # A file, open for writing: over NFS nothing else can be locked.
        descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise RecordingError(
            f"{folder}: cannot be written: {error.strerror or error}: choose a folder that is writable and has room"
        ) from None
    try:
        if fcntl is not None and _is_held(descriptor):
            raise RecordingError(f"{folder}: another sweep is at work there: wait for it, or choose another --out")
        yield
    finally:
        os.close(descriptor)
        if not was_there:
            with contextlib.suppress(OSError):
                if [entry.name for entry in folder.iterdir()] == [_LOCK]:
                    (folder / _LOCK).unlink()
                    folder.rmdir()


def _is_held(descriptor: int) -> bool:
    assert fcntl is not None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        # A file system without locks keeps nobody apart.
        return False
    return False
