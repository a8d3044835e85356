"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from gasp_core.io.format_errors import malformed

__all__ = ["replacing"]


@contextmanager
def replacing(path: Path) -> Generator[BinaryIO]:
    """A stream beside `path` that takes its place, on disk, when the block ends well and vanishes otherwise.

    Raises
    ------
    SplatFormatError
        Where the folder or the disk refuses.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        if "\0" in str(path):
            raise malformed(path, "a path cannot hold a null character", "check the path")
        if path.is_dir():
            raise malformed(path, "cannot be written, it is a folder", "name a file")
        # Not tempfile: its files are readable by their owner alone, and the finished file would stay so.
        try:
            with beside.open("wb") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            beside.replace(path)
        except BaseException:
            with suppress(OSError):
                beside.unlink()
            raise
        _sync_folder(path.parent)
    except OSError as error:
        reason = error.strerror or str(error)
        raise malformed(
            path, f"cannot be written: {reason}", "choose a folder that exists, is writable and has room"
        ) from error


def _sync_folder(folder: Path) -> None:
    """Make the new name durable, where the system can open folders."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
