"""Which file it is that a scene names."""

from __future__ import annotations

import hashlib
from pathlib import Path

from gasp_core.errors import SceneError
from gasp_core.io.detect import whole
from gasp_core.io.digests import add_content
from gasp_core.io.format_errors import shown

__all__ = ["file_digest"]


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content, whatever its name; of a folder's files, or of those beside an index, with theirs.

    Raises
    ------
    SceneError
        Where it is not there, or cannot be read.
    """
    digest = hashlib.sha256()
    if not path.exists():
        raise SceneError(f"{shown(path)}: there is no such file")
    try:
        add_content(digest, whole(path), named=False)
    except OSError as error:
        raise SceneError(f"{shown(path)}: cannot be read: {error.strerror or error}") from None
    return digest.hexdigest()
