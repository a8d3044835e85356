"""JSON that nobody vouches for: the index of a SOG, and of a set of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np

from gasp_core.io.format_errors import malformed, quoted

__all__ = ["LONGEST_META", "META", "Meta", "as_number", "parse_meta"]

META = "meta.json"
LONGEST_META = 1 << 18
"""Bytes; three codebooks are 20 kB. JSON of nothing but brackets takes 25 times its length."""


def as_number(value: object) -> float | None:
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if np.isfinite(number) else None


def parse_meta(text: bytes, name: str, path: Path) -> Meta:
    """The object that a text of JSON holds, whose keys are all different.

    Parameters
    ----------
    text
        The content of the file.
    name
        The file's, for messages.
    path
        The splat's, for messages.

    Raises
    ------
    SplatFormatError
        Where it holds none.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        entries = dict(pairs)
        if len(entries) != len(pairs):
            raise ValueError("a key occurs twice")
        return entries

    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is no number of JSON")

    try:
        meta: object = json.loads(text, object_pairs_hook=unique, parse_constant=no_constant)
    except (ValueError, RecursionError) as error:
        reason = "it is nested too deep" if isinstance(error, RecursionError) else str(error)
        raise malformed(path, f"{name} cannot be read: {quoted(reason)}") from error
    if not isinstance(meta, dict):
        raise malformed(path, f"{name} holds no object")
    return Meta(cast("dict[str, Any]", meta), "", name, path)


class Meta:
    """An object of a file of JSON whose entries are checked as they are asked for."""

    def __init__(self, entries: dict[str, Any], where: str, file: str, path: Path) -> None:
        self.entries = entries
        self._where = where
        self._file = file
        self._path = path

    def wrong(self, name: str, wanted: str) -> Exception:
        """What to raise where an entry is not what belongs there."""
        try:
            found = quoted(json.dumps(self.entries[name])) if name in self.entries else "nothing"
        except RecursionError:
            found = "brackets in brackets"
        return malformed(self._path, f"{self._file} has {found} for {self._where}{name}, where {wanted} belongs")

    def inner(self, name: str) -> Meta:
        """An object."""
        entry = self.entries.get(name)
        if not isinstance(entry, dict):
            raise self.wrong(name, "an object")
        return Meta(cast("dict[str, Any]", entry), f"{self._where}{name}.", self._file, self._path)

    def integer(self, name: str) -> int:
        """A whole number, not negative."""
        entry = self.entries.get(name)
        if isinstance(entry, bool) or not isinstance(entry, int) or entry < 0:
            raise self.wrong(name, "a whole number")
        return entry

    def array(self, name: str) -> list[Any]:
        """A list of anything."""
        entry = self.entries.get(name)
        if not isinstance(entry, list):
            raise self.wrong(name, "a list")
        return cast("list[Any]", entry)

    def objects(self, name: str) -> list[Meta]:
        """A list of objects, not empty."""
        entries = self.array(name)
        if not entries or not all(isinstance(entry, dict) for entry in entries):
            raise self.wrong(name, "a list of objects")
        return [
            Meta(cast("dict[str, Any]", entry), f"{self._where}{name}[{number}].", self._file, self._path)
            for number, entry in enumerate(entries)
        ]

    def first_integer(self, name: str) -> int:
        """The first of a list, a whole number."""
        entries = self.array(name)
        if not entries or isinstance(entries[0], bool) or not isinstance(entries[0], int) or entries[0] < 0:
            raise self.wrong(name, "a list of whole numbers")
        return entries[0]

    def number(self, name: str) -> float:
        """A finite number."""
        value = as_number(self.entries.get(name))
        if value is None:
            raise self.wrong(name, "a number")
        return value

    def numbers(self, name: str, length: int) -> list[float]:
        """A list of so many finite numbers."""
        values = [as_number(entry) for entry in self.array(name)]
        numbers = [value for value in values if value is not None]
        if len(numbers) != length or len(values) != length:
            raise self.wrong(name, f"a list of {length} numbers")
        return numbers

    def file_names(self, length: int) -> list[str]:
        """The entry "files": names of so many files beside this one."""
        entries = self.array("files")
        names = [entry for entry in entries if isinstance(entry, str)]
        if len(names) != length or len(entries) != length:
            raise self.wrong("files", f"a list of {length} file names")
        for name in names:
            # Neither up, nor absolute, nor a drive, nor a separator of another system.
            if not name or name in (".", "..") or any(c in name for c in "/\\:\0"):
                raise malformed(self._path, f"{self._file} names the file {quoted(name)}, which is outside the splat")
        return names
