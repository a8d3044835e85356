"""TOML tables read by key and type; every complaint names file, key path, what was found and what is allowed."""

from __future__ import annotations

import dataclasses
import re
import types
import typing
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any, NoReturn, TypeVar, cast

from gasp_core.errors import SceneError
from gasp_core.io.format_errors import shown
from gasp_core.scene.near_words import did_you_mean

__all__ = ["StoredTable", "Table", "kind_of"]

Made = TypeVar("Made")
Chosen = TypeVar("Chosen")

_LONGEST_SHOWN = 60
"""Characters of a key or a text of the file."""
_LONGEST_SAID = 1000
_OWN_FIELD = re.compile(r"\w+\.(\w+) (.*)", re.DOTALL)


def kind_of(value: object) -> str:
    """A value as its TOML type and text, for messages."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        listed = cast("list[object]", value)
        return f"an array of {len(listed)}" if len(listed) > 4 else f"the array {listed!r}"
    if isinstance(value, str):
        return f'the text "{value[:_LONGEST_SHOWN]}"'
    return repr(value)


class Table:
    """One table of a scene file.

    Parameters
    ----------
    file
        Named in every message.
    path
        Of the table in the file, e.g. ``object[0].material``; empty for the file itself.
    values
        The table.
    """

    def __init__(self, file: str, path: str, values: Mapping[str, Any]) -> None:
        self.file = file
        self.path = path
        self.values = values

    def at(self, path: str, values: Mapping[str, Any]) -> Table:
        """Another table of the same file."""
        return Table(self.file, path, values)

    def fail(self, key: str, message: str) -> NoReturn:
        """Raise the refusal of a key of this table."""
        raise self.refusal(key, message)

    def refusal(self, key: str, message: str) -> SceneError:
        """The error that says what is wrong with a key of this table."""
        name = shown(key)
        name = name if len(name) <= _LONGEST_SHOWN else name[:_LONGEST_SHOWN] + "..."
        where = f"{self.path}.{name}" if self.path and key else self.path or name
        said = shown(f"{where}: {message}" if where else message)
        return SceneError(f"{shown(self.file)}: {said if len(said) <= _LONGEST_SAID else said[:_LONGEST_SAID] + '...'}")

    def only(self, *known: str) -> None:
        """Refuse keys that are not among `known`; called first, or a misspelt key would be reported as missing."""
        for key in self.values:
            if key not in known:
                hint = did_you_mean(key, known) or ","
                self.fail(key, f"unknown key{hint} known here: {', '.join(sorted(known))}")

    def has(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self.values

    def required(self, key: str, what: str) -> None:
        """Refuse a table without the key."""
        if key not in self.values:
            self.fail(key, f"missing, expected {what}")

    def number(self, key: str, default: float | None = None) -> float:
        """A number; without a default the key is required."""
        if default is None:
            self.required(key, "a number")
        return _number(self, key, self.values.get(key, default))

    def text(self, key: str, default: str | None = None) -> str:
        """A text; without a default the key is required."""
        if default is None:
            self.required(key, "a text")
        value = self.values.get(key, default)
        if not isinstance(value, str):
            self.fail(key, f"must be a text, found {kind_of(value)}")
        return value

    def flag(self, key: str, default: bool = False) -> bool:
        """True or false."""
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            self.fail(key, f"must be true or false, found {kind_of(value)}")
        return value

    def numbers(self, key: str, lengths: tuple[int, ...] = (3,)) -> tuple[float, ...]:
        """An array of numbers of one of the given lengths."""
        allowed = " or ".join(str(length) for length in lengths)
        self.required(key, f"an array of {allowed} numbers")
        return _numbers(self, key, self.values[key], lengths)

    def vector(self, key: str, default: tuple[float, float, float] | None = None) -> tuple[float, float, float]:
        """Three numbers; without a default the key is required."""
        if default is not None and key not in self.values:
            return default
        x, y, z = self.numbers(key)
        return (x, y, z)

    def choice(self, key: str, allowed: Mapping[str, Chosen], default: str | None = None) -> Chosen:
        """One of a few names, as what it stands for."""
        if default is None:
            self.required(key, f"one of {', '.join(allowed)}")
        name = self.values.get(key, default)
        if not isinstance(name, str) or name not in allowed:
            hint = did_you_mean(name, allowed)
            self.fail(key, f"must be one of {', '.join(allowed)}, found {kind_of(name)}{hint}")
        return allowed[name]

    def table(self, key: str, main: str = "") -> Table:
        """A table inside this one; empty where it is left out. `main` is the key that a text alone is meant for."""
        value = self.values.get(key, {})
        if not isinstance(value, Mapping):
            meant = (
                f': write {key} = {{ {main} = "{value[:_LONGEST_SHOWN]}" }}' if main and isinstance(value, str) else ""
            )
            self.fail(key, f"must be a table, found {kind_of(value)}{meant}")
        return self.at(f"{self.path}.{key}" if self.path else key, cast("Mapping[str, Any]", value))

    def tables(self, key: str) -> list[Table]:
        """An array of tables; empty where it is left out."""
        value = self.values.get(key, [])
        entries = cast("list[Any]", value) if isinstance(value, list) else [None]
        if not all(isinstance(entry, Mapping) for entry in entries):
            written = re.sub(r"\[\d+\]", "", f"{self.path}.{key}" if self.path else key)
            self.fail(key, f"must be an array of tables, written [[{written}]], found {kind_of(value)}")
        path = f"{self.path}.{key}" if self.path else key
        return [self.at(f"{path}[{index}]", cast("Mapping[str, Any]", entry)) for index, entry in enumerate(entries)]

    def build(self, kind: type[Made], *, tag: str | None = None, **given: Any) -> Made:
        """An instance of a dataclass from the keys named like its fields.

        Parameters
        ----------
        kind
            The dataclass; its fields' types are checked, and its own refusals are given their place in the file.
        tag
            A key that named the class and is no field.
        given
            Fields that have been read already, from keys of the same name.
        """
        described: Any = kind
        fields = {field.name: field for field in dataclasses.fields(described)}
        self.only(*fields, *([tag] if tag else []))
        hints = typing.get_type_hints(kind)
        values: dict[str, Any] = dict(given)
        for name, field in fields.items():
            if name in given:
                continue
            if name in self.values:
                values[name] = _convert(self, name, self.values[name], hints[name])
            elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
                self.fail(name, f"missing, expected {_expected(hints[name])}")
        return self.make(kind, values)

    def make(self, kind: type[Made], values: Mapping[str, Any]) -> Made:
        """`kind(**values)`, its refusal given its place in the file."""
        try:
            return kind(**values)
        except SceneError as error:
            own = _OWN_FIELD.fullmatch(str(error))
            if own is None:
                self.fail("", str(error))
            self.fail(own[1], own[2])


class StoredTable(Table):
    """A table of a scene that a recording has kept: keys that are not known any more are passed over, and told.

    Parameters
    ----------
    file, path, values
        As of any table.
    forgotten
        Gets the paths of keys that are passed over.
    """

    def __init__(self, file: str, path: str, values: Mapping[str, Any], forgotten: list[str]) -> None:
        super().__init__(file, path, values)
        self.forgotten = forgotten

    def at(self, path: str, values: Mapping[str, Any]) -> StoredTable:
        """Another table of the same file."""
        return StoredTable(self.file, path, values, self.forgotten)

    def only(self, *known: str) -> None:
        """Pass over keys that are not among `known`."""
        self.forgotten += [f"{self.path}.{key}" if self.path else key for key in self.values if key not in known]


def _number(table: Table, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        table.fail(key, f"must be a number, found {kind_of(value)}")
    return _float(table, key, value)


def _float(table: Table, key: str, value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        raise table.refusal(key, "must be a number below 1e308, found a longer one") from None


def _numbers(table: Table, key: str, value: Any, lengths: tuple[int, ...]) -> tuple[float, ...]:
    entries = cast("list[Any]", value) if isinstance(value, list) else []
    allowed = " or ".join(str(length) for length in lengths)
    if len(entries) not in lengths or any(isinstance(e, bool) or not isinstance(e, (int, float)) for e in entries):
        table.fail(key, f"must be an array of {allowed} numbers, found {kind_of(value)}")
    return tuple(_float(table, key, entry) for entry in entries)


def _arms(hint: Any) -> list[Any]:
    """The alternatives of a type, None left out: a key that is not there says None."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return [arm for arm in typing.get_args(hint) if arm is not type(None)]
    return [hint]


def _expected(hint: Any) -> str:
    return " or ".join(dict.fromkeys(_arm_name(arm) for arm in _arms(hint)))


def _arm_name(arm: Any) -> str:
    origin = typing.get_origin(arm)
    if origin is typing.Literal:
        return _listed(typing.get_args(arm))
    if isinstance(arm, type) and issubclass(arm, Enum):
        return _listed(member.value for member in arm)
    if origin is tuple and Ellipsis in typing.get_args(arm):
        return "an array"
    if origin is tuple:
        return f"an array of {len(typing.get_args(arm))} numbers"
    return {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}.get(arm, "a table")


def _words(arm: Any) -> list[str]:
    """Texts that are allowed, where they are few."""
    if typing.get_origin(arm) is typing.Literal:
        return [word for word in typing.get_args(arm) if isinstance(word, str)]
    return [str(one.value) for one in arm] if isinstance(arm, type) and issubclass(arm, Enum) else []


def _listed(values: Iterable[object]) -> str:
    return ", ".join(f'"{value}"' if isinstance(value, str) else str(value) for value in values)


def _convert(table: Table, key: str, value: Any, hint: Any) -> Any:
    """The value as the first alternative of its type that it fits, or the refusal that names them all."""
    for arm in _arms(hint):
        origin = typing.get_origin(arm)
        plain = not isinstance(value, bool)
        if arm is float and plain and isinstance(value, (int, float)):
            return _float(table, key, value)
        if arm in (int, str) and plain and isinstance(value, arm):
            return value
        if arm is bool and isinstance(value, bool):
            return value
        if origin is typing.Literal and plain and value in typing.get_args(arm):
            return value
        if isinstance(arm, type) and issubclass(arm, Enum) and value in [member.value for member in arm]:
            return arm(value)
        if origin is tuple and isinstance(value, list):
            arguments = [argument for argument in typing.get_args(arm) if argument is not Ellipsis]
            if all(argument is float for argument in arguments) and len(arguments) > 1:
                return _numbers(table, key, cast(object, value), (len(arguments),))
            return tuple(cast("list[Any]", value))
        if arm is Any or (origin in (dict, Mapping) and isinstance(value, Mapping)):
            return cast(Any, value)
    words = [word for arm in _arms(hint) for word in _words(arm)]
    raise table.refusal(key, f"must be {_expected(hint)}, found {kind_of(value)}{did_you_mean(value, words)}")
