"""Names that have moved: the old ones work for one more minor version, and say where the new ones are."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from typing import Any

__all__ = ["moved"]


def moved(old: str, new: str, until: str) -> Callable[[str], Any]:
    """A module's `__getattr__` that takes every name from another module, with a warning.

    Parameters
    ----------
    old
        The module's own name.
    new
        Where its names are now.
    until
        The version of gasp-core in which the old ones are gone.
    """

    def look_up(name: str) -> Any:
        # Python itself asks modules for names like __path__.
        if name.startswith("__"):
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        try:
            value = getattr(importlib.import_module(new), name)
        except AttributeError:
            raise AttributeError(f"module {old!r} has no attribute {name!r}, nor has {new!r}, its new name") from None
        warnings.warn(
            f"{old}.{name} is {new}.{name} now; the old name goes with gasp-core {until}",
            DeprecationWarning,
            stacklevel=2,
        )
        return value

    return look_up
