"""Whether an engine's own code could be imported, told from metadata alone: nothing of it is imported."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import sys

__all__ = ["missing_factory", "missing_requirements"]

_REQUIREMENT_NAME = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9._-]*)")


def missing_requirements(distribution: str) -> list[str]:
    """Requirements of an installed distribution that are not installed, as written there, e.g. "taichi>=1.7.3".

    Only presence is looked at, not versions. Requirements with an environment marker are passed over: they may be
    meant for another platform or an extra that nobody asked for.
    """
    try:
        requirements = importlib.metadata.requires(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    missing: list[str] = []
    for requirement in requirements:
        name = _REQUIREMENT_NAME.match(requirement)
        if ";" in requirement or name is None:
            continue
        try:
            importlib.metadata.distribution(name.group(1))
        except importlib.metadata.PackageNotFoundError:
            missing.append(requirement.replace(" ", ""))
    return missing


def missing_factory(factory: str) -> str | None:
    """The module of a factory "package.module:attribute" if it cannot be found, else None.

    Looked up only where that imports nothing new, that is, where the package it lies in is imported already.
    """
    module = factory.partition(":")[0]
    parent = module.rpartition(".")[0]
    if parent and parent not in sys.modules:
        return None
    try:
        found = module in sys.modules or importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        found = False
    return None if found else module
