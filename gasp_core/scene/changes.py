"""Keys of a scene file that are set from outside of it: ``object.plant.height=0.3``."""

from __future__ import annotations

import dataclasses
import difflib
import re
import tomllib
from collections.abc import Sequence
from typing import Any, cast

from gasp_core.errors import SceneError

__all__ = ["changed", "completed_decimals", "value_of"]

# Decimals as people and shells write them and TOML does not take them: without digits before or after the point.
_BARE_POINT = re.compile(r"(?P<before>(?<![\w.])[+-]?)\.(?=\d)")
_NUMBER = re.compile(r"\[\s*(\d+)\s*\]")
_TRAILING_POINT = re.compile(r"(?<![\w.])[+-]?\d+\.(?![\d.])")


def changed(values: dict[str, Any], changes: Sequence[str]) -> dict[str, Any]:
    """The tables of a scene file with some of their keys set.

    Parameters
    ----------
    values
        As TOML has them; they are changed.
    changes
        Each ``path=value``: names of keys with points between them, where one of several tables ([[object]],
        [[collider]]) is its number from 0 or its name, and need not be said of one alone, and one of several numbers
        (position) its number from 0; and a value as in the file, a text without quotes too.

    Raises
    ------
    SceneError
        Where one is no such, or leads nowhere. Whether there is a key of that name, the reader of the scene tells.
    """
    for change in changes:
        path, equals, text = change.partition("=")
        # Messages name the first object as object[0].
        keys = [key.strip() for key in _NUMBER.sub(r".\1", path).split(".")]
        if not equals or not all(keys):
            raise SceneError(f"--set {change}: must be KEY=VALUE, e.g. object.plant.height=0.3 or scene.duration=2")
        _set(values, keys, value_of(text), change)
    return values


def _set(values: dict[str, Any], keys: Sequence[str], value: Any, change: str) -> None:
    here: Any = values
    for depth, key in enumerate(keys[:-1]):
        if isinstance(here, list):
            here = _one_of(cast("list[Any]", here), key, ".".join(keys[:depth]), change)
            continue
        table = _table(here, keys[:depth], change)
        inner = table.setdefault(key, {})
        if isinstance(inner, str) and key == "material":
            # The name of a preset, of which a number is to be another.
            inner = table[key] = {"preset": inner}
        # One table of its kind alone need not be named.
        if isinstance(inner, list) and len(cast("list[Any]", inner)) == 1 and not _names(inner, keys[depth + 1]):
            inner = cast("list[Any]", inner)[0]
            _refuse_misspelt(inner, keys[depth + 1 :], key, change)
        here = inner
    where = ".".join(keys[:-1])
    if isinstance(here, list):
        entries = cast("list[Any]", here)
        if any(isinstance(entry, dict) for entry in entries):
            raise SceneError(f"--set {change}: {where} are several tables: say which, by name or number")
        _one_of(entries, keys[-1], where, change)
        entries[int(keys[-1])] = value
        return
    _table(here, keys[:-1], change)[keys[-1]] = value


def _table(here: Any, keys: Sequence[str], change: str) -> dict[str, Any]:
    if not isinstance(here, dict):
        raise SceneError(f"--set {change}: {'.'.join(keys)} is {here!r} there, and no table with keys in it")
    return cast("dict[str, Any]", here)


def _names(tables: Any, key: str) -> bool:
    """Whether a key is the number or the name of one of several tables."""
    entries = cast("list[Any]", tables)
    return (key.isdecimal() and int(key) < len(entries)) or any(
        isinstance(entry, dict) and cast("dict[str, Any]", entry).get("name") == key for entry in entries
    )


def _refuse_misspelt(table: Any, keys: Sequence[str], where: str, change: str) -> None:
    """Refuse what is meant for a name and is not that of the only table: nearly it, or no key that has keys."""
    key, own = keys[0], cast("dict[str, Any]", table) if isinstance(table, dict) else {}
    name = own.get("name")
    if not isinstance(name, str) or key in own:
        return
    if difflib.get_close_matches(key, [name]) or (
        len(keys) > 1 and where == "object" and key not in _keys_of_objects()
    ):
        raise SceneError(f'--set {change}: there is no {where} "{key}", there is "{name}"')


def _keys_of_objects() -> set[str]:
    from gasp_core.scene.objects import SplatObject

    return {"part", *(field.name for field in dataclasses.fields(SplatObject))}


def _one_of(tables: list[Any], key: str, where: str, change: str) -> Any:
    if not _names(tables, key):
        names = [
            str(cast("dict[str, Any]", entry).get("name", number)) if isinstance(entry, dict) else str(number)
            for number, entry in enumerate(tables)
        ]
        raise SceneError(f'--set {change}: there is no {where} "{key}", there are {", ".join(names) or "none"}')
    for entry in tables:
        if isinstance(entry, dict) and cast("dict[str, Any]", entry).get("name") == key:
            return cast("dict[str, Any]", entry)
    return tables[int(key)]


def value_of(text: str) -> Any:
    """A value as TOML has it, ``.5`` and ``2.`` as ``0.5`` and ``2.0``; what is none is a text."""
    for written in (text, completed_decimals(text)):
        try:
            found = tomllib.loads(f"value = {written}")
        except (ValueError, RecursionError):
            continue
        return found["value"] if len(found) == 1 else text.strip()
    return text.strip()


def completed_decimals(text: str) -> str:
    """Numbers with the digits before and after the point that TOML wants and people leave out."""
    return _BARE_POINT.sub(r"\g<before>0.", _TRAILING_POINT.sub(r"\g<0>0", text))
