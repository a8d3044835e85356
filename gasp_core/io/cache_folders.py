"""Where what can be made again is kept on this machine."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

__all__ = ["CACHE_VARIABLE", "cache_folder"]

CACHE_VARIABLE = "GASP_CACHE"
"""Names another folder for what is kept; empty: nothing is."""


def cache_folder(kind: str) -> Path | None:
    """The folder for things of a kind; it need not exist. None: nothing is to be kept."""
    named = os.environ.get(CACHE_VARIABLE)
    if named == "":
        return None
    return (Path(named).absolute() if named else platformdirs.user_cache_path("gasp")) / kind
