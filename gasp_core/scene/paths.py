"""Paths that a scene file names."""

from __future__ import annotations

import os
import re
from pathlib import Path

from gasp_core.scene.tables import Table

__all__ = ["read_path"]

_LONGEST_PATH = 300
_VARIABLE = re.compile(r"\$\{?(\w+)")


def read_path(table: Table, key: str, folder: Path | None) -> Path:
    """The path that a key names, which starts at the scene's folder and has to be there; None: as it is written."""
    text = table.text(key)
    if folder is None:
        return Path(text)
    try:
        path = folder / Path(os.path.expandvars(text)).expanduser()
        there = path.exists()
    except (OSError, ValueError, RuntimeError):
        # A name that is too long, a null character, a home of nobody: none of them is a file.
        path, there = folder, False
    if not there:
        # As it is written: what a variable stands for need not go to everybody who is shown the message.
        unset = [name for name in _VARIABLE.findall(text) if name not in os.environ]
        hint = f"{unset[0]} is not set in the environment" if unset else "relative paths start at the scene file"
        table.fail(key, f"no such file: {_shortened(text)} ({hint})")
    return path


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_PATH else f"{text[:_LONGEST_PATH]}..."
