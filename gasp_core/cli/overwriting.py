"""``--overwrite``, for all commands that write files: what is there already stays there without it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

__all__ = ["keep_what_is_there", "overwrite_option"]

Command = Callable[..., Any]


def overwrite_option(what: str) -> Callable[[Command], Command]:
    """The option, which says what it replaces."""
    return click.option("--overwrite", is_flag=True, help=f"Replace {what} already there.")


def keep_what_is_there(
    paths: Iterable[Path], overwrite: bool, option: str = "--out", read: Iterable[Path] = ()
) -> None:
    """Refuse to begin where something has the name of what is to be written; an empty folder is in nobody's way.

    Parameters
    ----------
    paths
        Of all that is to be written.
    overwrite
        It may be replaced.
    option
        That names another place.
    read
        What all that is made from: nobody means to replace that.

    Raises
    ------
    click.UsageError
        Which names the first of them.
    """
    sources = [source for source in read if source.exists()]
    for path in paths:
        if path.exists() and any(path.samefile(source) for source in sources):
            raise click.UsageError(f"{path} is what is read: {option} names another place")
        there = any(path.iterdir()) if path.is_dir() else path.exists()
        if there and not overwrite:
            raise click.UsageError(f"{path} is there already: --overwrite replaces it, {option} names another place")
