"""Running the code of plugins: its prints, exits and errors are kept from doing harm."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Callable
from typing import cast

from gasp_core.discovery.requirements import missing_requirements
from gasp_core.errors import GaspError, PluginLoadError

__all__ = ["attribute_at", "contained", "how_to_mend", "import_factory", "one_line", "quietly"]


def contained(call: Callable[[], object]) -> object:
    """Call foreign code.

    Raises
    ------
    PluginLoadError
        Where it tries to end the program.
    """
    try:
        return call()
    except SystemExit as error:
        raise PluginLoadError(f"tried to exit the program (status {error.code!r}): report it to its author") from error


def quietly(call: Callable[[], object]) -> object:
    """`contained`, with what it prints sent to stderr: stdout is for what was asked for.

    For plugin modules and hooks alone: a backend may take another `sys.stdout` at its import for a notebook's, and
    print to it from then on (Taichi does, and slows down).
    """
    with contextlib.redirect_stdout(sys.stderr):
        return contained(call)


def one_line(error: BaseException) -> str:
    """An error in one line; its type is part of it unless the message is ours."""
    text = " ".join(str(error).split())
    if isinstance(error, GaspError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def how_to_mend(distribution: str) -> str:
    """What to do about a distribution whose code does not load: install what it misses, or install it anew."""
    missing = missing_requirements(distribution)
    if missing:
        return "pip install " + " ".join(f'"{requirement}"' for requirement in missing)
    return f"update it: pip install --upgrade --force-reinstall {distribution}"


def attribute_at(address: str) -> Callable[[], object]:
    """Import "package.module:attribute" and return what is there, taken to be a function of nothing."""
    module_name, _, attribute = address.partition(":")
    target: object = importlib.import_module(module_name)
    for name in attribute.split("."):
        target = getattr(target, name)
    return cast("Callable[[], object]", target)


def import_factory(factory: str, what: str, distribution: str) -> Callable[[], object]:
    """Import "package.module:attribute" on behalf of `what`.

    Raises
    ------
    PluginLoadError
        Where that fails: says what is missing and what to install.
    """
    try:
        target = contained(lambda: attribute_at(factory))
    except Exception as error:
        remedy = how_to_mend(distribution)
        raise PluginLoadError(f"{what} ({factory}) cannot be loaded: {one_line(error)}; {remedy}") from error
    if not callable(target):
        raise PluginLoadError(f"{what}: {factory} of {distribution} cannot be called; update {distribution}")
    return cast("Callable[[], object]", target)
