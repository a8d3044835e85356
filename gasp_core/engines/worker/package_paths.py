"""Which packages a worker borrows from this process, and from where.

The environment of an engine holds its backend. The contract and the plugin are not installed there: the worker finds
them where this process has them, and nothing else of this process's environment.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gasp_core.contract import EngineDescriptor
from gasp_core.errors import EngineEnvironmentError

__all__ = ["Loan", "lent_for", "loans"]

Loan = dict[str, Any]
"""Of one package or module: `origin`, its file (None for a namespace), and `folders` of its submodules (None)."""


def lent_for(descriptor: EngineDescriptor) -> list[str]:
    """Top-level names that an engine's worker borrows: the core's, the plugin's, and that of its options."""
    modules = [descriptor.factory.partition(":")[0]]
    if descriptor.options is not None:
        modules.append(descriptor.options.__module__)
    return list(dict.fromkeys(["gasp_core", *(module.partition(".")[0] for module in modules)]))


def loans(names: Iterable[str]) -> dict[str, Loan]:
    """Where these packages are, without importing any.

    Raises
    ------
    EngineEnvironmentError
        Where one is nowhere, or nowhere in the file system.
    """
    found: dict[str, Loan] = {}
    for name in names:
        try:
            spec = importlib.util.find_spec(name)
        except (ImportError, ValueError):
            spec = None
        if spec is None:
            raise EngineEnvironmentError(f"package {name} cannot be found: install the plugin it belongs to again")
        folders = None if spec.submodule_search_locations is None else list(spec.submodule_search_locations)
        if spec.origin is not None and not Path(spec.origin).is_file():
            raise EngineEnvironmentError(f"package {name} is in {spec.origin}: a worker needs it as files in a folder")
        found[name] = {"origin": spec.origin, "folders": folders}
    return found
