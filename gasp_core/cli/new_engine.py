"""A new engine from the template that lies beside this file: an engine that runs and passes, under another name.

The template is real code, my-engine in the package my_engine, so that it is checked as all other code is.
"""

from __future__ import annotations

import importlib.util
import keyword
import re
import sys
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath

import click

__all__ = ["write_engine"]

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_TEMPLATE_NAMES = re.compile("my-engine|my_engine")


def write_engine(name: str, folder: Path) -> Path:
    """Write a new engine into a folder of its name.

    Parameters
    ----------
    name
        As users write it, e.g. "my-engine"; its package is then my_engine.
    folder
        In which to make the folder.

    Returns
    -------
    The engine's folder.

    Raises
    ------
    click.UsageError
        Where the name will not do, or the folder is there already.
    """
    package = _package_of(name)
    home = folder / name
    try:
        home.mkdir()
    except FileExistsError:
        raise click.UsageError(f"{home} is there already: choose another name, or go to another folder") from None
    words = {"my-engine": name, "my_engine": package}
    for path, text in _template_files():
        target = home / _renamed(str(path), words)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(_renamed(text, words), encoding="utf-8")
    return home


def _package_of(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise click.UsageError(
            f'"{name}" is no name for an engine: use small letters and digits, with hyphens between words, as in'
            ' "my-engine"'
        )
    package = name.replace("-", "_")
    if keyword.iskeyword(package):
        raise click.UsageError(f'"{name}" is a word of Python, which no package can be called: choose another name')
    if package in sys.stdlib_module_names or importlib.util.find_spec(package) is not None:
        raise click.UsageError(
            f'"{name}" would be the package {package}, and there is one already: choose another name'
        )
    from gasp_core.discovery.registry import discover

    offers = discover().offers.get(name, ())
    if offers:
        raise click.UsageError(
            f'an engine "{name}" is installed already, by {offers[0].distribution}: choose another name'
        )
    return package


def _template_files() -> Iterator[tuple[PurePosixPath, str]]:
    """Path within the template, and text, of each of its files."""
    pending: list[tuple[PurePosixPath, Traversable]] = [
        (PurePosixPath(), files("gasp_core.cli").joinpath("engine_template"))
    ]
    while pending:
        path, place = pending.pop()
        if place.is_file():
            yield path, place.read_text(encoding="utf-8")
        # Installing compiles what ends in .py, wherever it lies.
        elif place.name != "__pycache__":
            pending += [(path / inner.name, inner) for inner in place.iterdir()]


def _renamed(text: str, words: dict[str, str]) -> str:
    return _TEMPLATE_NAMES.sub(lambda found: words[found.group()], text)
