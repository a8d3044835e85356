"""Where the environments of engines are: a folder each, in the user's data folder."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

__all__ = ["HOME_VARIABLE", "environments_folder"]

HOME_VARIABLE = "GASP_ENVIRONMENTS"
"""Names another folder for the environments, e.g. on a larger disk."""


def environments_folder() -> Path:
    """The folder that holds the environments; it need not exist."""
    named = os.environ.get(HOME_VARIABLE)
    return Path(named).absolute() if named else platformdirs.user_data_path("gasp") / "environments"
