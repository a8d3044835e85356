"""What is in files, as one number."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

__all__ = ["add_content"]


def add_content(digest: Any, path: Path, *, named: bool = True) -> None:
    """Feed the content of a file, or of all files below a folder, to a digest of `hashlib`.

    Parameters
    ----------
    digest
        To be fed.
    path
        What is no ordinary file (a pipe, a device without an end) counts as nothing.
    named
        Whether the names of files count too; those in a folder always do.

    Raises
    ------
    OSError
        Where something cannot be read.
    """
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            if named or path.is_dir():
                digest.update(file.name.encode())
            with file.open("rb") as stream:
                hashlib.file_digest(stream, lambda: digest)
