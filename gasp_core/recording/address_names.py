"""Names of recordings: addresses, and paths on this machine."""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["address_of", "path_here"]

_ADDRESS = re.compile(r"([a-z][a-z0-9+.-]+):/{1,2}(?!/)(.+)", re.DOTALL)
_HERE = re.compile(r"(?:file|local):/{1,3}(?!/)(.+)", re.DOTALL)


def address_of(path: str | Path) -> str | None:
    """The address that a path stands for, ``s3://bucket/run.gasp``; None where it is one of this machine.

    A `Path` has lost one of the slashes.
    """
    found = _ADDRESS.fullmatch(str(path))
    if found is None or found[1] in ("file", "local"):
        return None
    return f"{found[1]}://{found[2].rstrip('/')}"


def path_here(path: str | Path) -> Path:
    """A path on this machine, ``/tmp/run.gasp`` of ``file:///tmp/run.gasp`` too.

    A `Path` has lost some of the slashes: one that is left stands for the root.
    """
    found = _HERE.fullmatch(str(path))
    return Path(path) if found is None else Path("/") / found[1]
