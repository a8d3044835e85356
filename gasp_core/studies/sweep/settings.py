"""Which settings a sweep goes through: a grid, a list, or the rows of a table."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import SceneError
from gasp_core.io.format_errors import shown
from gasp_core.io.text_files import read_text
from gasp_core.scene.changes import value_of

__all__ = ["Setting", "settings_from_table", "settings_of"]

_LONGEST_TABLE = 1 << 26
_MOST = 1_000_000
_OPENING, _CLOSING = "[{(", "]})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """One run's keys of the scene.

    Parameters
    ----------
    values
        By key, as they are written.
    """

    values: Mapping[str, str]

    @property
    def changes(self) -> tuple[str, ...]:
        """As `load_scene` takes them."""
        return tuple(f"{key}={value}" for key, value in self.values.items())

    def columns(self) -> dict[str, Any]:
        """The values as TOML has them: numbers as numbers; what is neither number, text nor truth value as text."""
        found: dict[str, Any] = {}
        for key, text in self.values.items():
            value = value_of(text)
            found[key] = value if isinstance(value, (int, float, str, bool)) else text
        return found


def settings_of(changes: Sequence[str], *, zipped: bool = False) -> list[Setting]:
    """Of ``KEY=VALUE,VALUE,...``: every combination, the last key's values in turn first.

    Parameters
    ----------
    changes
        Commas within brackets or quotes are part of a value.
    zipped
        Not every combination, but the first values of all, the second, and so on; one value alone goes with each.

    Raises
    ------
    SceneError
        Where one is no such, a key is there twice, or lists differ in length.
    """
    lists: dict[str, list[str]] = {}
    for change in changes:
        key, equals, text = change.partition("=")
        key = key.strip()
        values = _split(text)
        if not equals or not key or not all(values):
            raise SceneError(f"--set {shown(change)}: must be KEY=VALUE,VALUE,... e.g. accuracy.resolution=24,48")
        if key in lists:
            raise SceneError(f"--set {shown(key)} is there twice: give all its values at once, with commas between")
        lists[key] = values
    if zipped:
        counts = {len(values) for values in lists.values()} - {1}
        if len(counts) > 1:
            said = ", ".join(f"{key} has {len(values)}" for key, values in lists.items())
            raise SceneError(f"--zip wants as many values of each key: {said}")
        count = counts.pop() if counts else 1
        rows = zip(*(values * count if len(values) == 1 else values for values in lists.values()))
    else:
        total = 1
        for values in lists.values():
            total *= len(values)
        if total > _MOST:
            raise SceneError(f"these are {total:,} runs: a sweep has {_MOST:,} at most")
        rows = itertools.product(*lists.values())
    return _different([Setting(values=dict(zip(lists, row))) for row in rows])


def settings_from_table(path: Path) -> list[Setting]:
    """Of a .csv: keys in its first line, a run a line; an empty cell leaves its key as the scene has it.

    Raises
    ------
    SceneError
        Where it cannot be read, a line has another number of cells, or two say the same.
    """
    name = shown(path)
    try:
        text = read_text(path, _LONGEST_TABLE)
        reader = csv.reader(text.removeprefix("\ufeff").splitlines(), skipinitialspace=True)
        lines = [(reader.line_num, line) for line in reader if line]
    except OSError as error:
        raise SceneError(f"{name}: cannot be read: {error.strerror or error}") from None
    except (ValueError, csv.Error) as error:
        raise SceneError(f"{name}: is no table of settings (CSV in UTF-8): {shown(error)[:100]}") from None
    if len(lines) < 2:
        raise SceneError(
            f"{name}: has no settings: keys in the first line, e.g. accuracy.resolution, a run a line below"
        )
    keys = [key.strip() for key in lines[0][1]]
    if len(keys) == 1 and ";" in keys[0]:
        raise SceneError(f"{name}: its cells are separated by semicolons: commas are wanted, and points in numbers")
    if not all(keys) or len(set(keys)) < len(keys):
        raise SceneError(f"{name}: its first line must name keys of the scene, each once, found {', '.join(keys)}")
    found: list[Setting] = []
    for number, line in lines[1:]:
        if len(line) != len(keys):
            raise SceneError(f"{name}: line {number} has {len(line)} cells, the first {len(keys)}")
        found.append(Setting(values={key: cell.strip() for key, cell in zip(keys, line) if cell.strip()}))
    return _different(found)


def _split(text: str) -> list[str]:
    """At commas that are in no brackets and no quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in _OPENING:
            depth += 1
        elif letter in _CLOSING:
            depth -= 1
        elif letter == "," and depth == 0:
            parts.append("")
            continue
        parts[-1] += letter
    return [part.strip() for part in parts]


def _different(settings: list[Setting]) -> list[Setting]:
    seen: set[tuple[tuple[str, str], ...]] = set()
    for setting in settings:
        key = tuple(sorted(setting.values.items()))
        if key in seen:
            raise SceneError(f"two runs have the same settings, {', '.join(setting.changes) or 'none'}: say each once")
        seen.add(key)
    return settings
