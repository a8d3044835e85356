"""An engine's own options: from a table of plain values to the typed dataclass its plugin declares."""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, cast

import numpy as np

from gasp_core.contract.descriptor import EngineDescriptor
from gasp_core.contract.validation import whole
from gasp_core.errors import SceneError

__all__ = ["build_options", "chosen_options"]


def build_options(descriptor: EngineDescriptor, table: Mapping[str, object] | None = None) -> Any:
    """The engine's options with the given ones set and the others at their defaults.

    Parameters
    ----------
    descriptor
        The engine; its `options` is a dataclass of bool, int, float, str, `Path`, `Enum`, `Literal`, tuples and
        unions (`None` included) of these.
    table
        Plain values by name, as a scene file holds them.

    Returns
    -------
    An instance of `descriptor.options`; None for an engine without options.

    Raises
    ------
    SceneError
        Where a name is unknown (the known ones are listed), a value has the wrong type, or the plugin refuses it.
    """
    given = dict(table or {})
    where = f"options of engine {descriptor.name}"
    known = list(descriptor.option_names())
    for name in given:
        if name not in known:
            raise SceneError(f'{where}: unknown option "{name}"; {_known(name, known)}')
    if descriptor.options is None:
        return None
    hints = typing.get_type_hints(descriptor.options)
    try:
        values = {name: _converted(value, hints[name], f"{where}: {name}") for name, value in given.items()}
        return descriptor.options(**values)
    except SceneError as error:
        text = str(error)
        raise SceneError(text if text.startswith(where) else f"{where}: {text}") from None
    except (TypeError, ValueError) as error:
        raise SceneError(f"{where}: {' '.join(str(error).split())}") from error


def chosen_options(options: Any) -> dict[str, Any]:
    """The options that are not at their defaults, as JSON values that `build_options` takes; none of None.

    A number that JSON has no word for is kept as the text of it.
    """
    if options is None:
        return {}
    chosen: dict[str, Any] = {}
    for option in dataclasses.fields(options):
        value = getattr(options, option.name)
        made = option.default_factory() if option.default_factory is not dataclasses.MISSING else option.default
        if value != made:
            chosen[option.name] = _plain(value)
    return chosen


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in cast("list[Any]", value)]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def _known(name: str, known: list[str]) -> str:
    if not known:
        return "this engine has none"
    close = difflib.get_close_matches(name, known, n=1)
    hint = f' (did you mean "{close[0]}"?)' if close else ""
    return f"known are {', '.join(known)}{hint}"


def _converted(value: object, hint: Any, where: str) -> object:
    """The value as the annotated type, exactly or by a conversion that loses nothing."""
    matched, result = _match(value, hint)
    if not matched:
        raise SceneError(f"{where} must be {_described(hint)}, found {value!r}")
    return result


def _match(value: object, hint: Any) -> tuple[bool, object]:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return True, value
    if hint is None or hint is types.NoneType:
        return value is None, None
    if origin in (typing.Union, types.UnionType):
        return next((match for each in arguments if (match := _match(value, each))[0]), (False, None))
    if origin is typing.Literal:
        # True == 1, so the type has to agree too.
        return any(value == each and type(value) is type(each) for each in arguments), value
    if origin in (tuple, list) and isinstance(value, (tuple, list)):
        items: list[object] = list(value)
        kinds = list(arguments[:1]) * len(items) if origin is list or arguments[1:] == (...,) else list(arguments)
        matches = [_match(item, kind) for item, kind in zip(items, kinds)]
        if len(items) != len(kinds) or not all(matched for matched, _ in matches):
            return False, None
        return True, origin(result for _, result in matches)
    if isinstance(hint, type):
        return _match_class(value, hint)
    return False, None


def _match_class(value: object, hint: type[Any]) -> tuple[bool, object]:
    if hint is bool or hint is str:
        return type(value) is hint, value
    if hint is int:
        number = whole(value)
        return number is not None, number
    if hint is float:
        return _match_float(value)
    if issubclass(hint, Enum):
        member = next((member for member in hint if value is member or value == member.value), None)
        return member is not None, member
    if issubclass(hint, Path):
        return (True, Path(value)) if isinstance(value, (str, Path)) else (False, None)
    return isinstance(value, hint), value


def _match_float(value: object) -> tuple[bool, object]:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
        return False, None
    try:
        return True, float(value)
    except OverflowError:
        return False, None


def _described(hint: Any) -> str:
    """A type as a person who writes a scene file would say it."""
    names = {bool: "true or false", int: "a whole number", float: "a number", str: "a string", Path: "a path"}
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in names:
        return names[hint]
    if hint is types.NoneType:
        return "left out"
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_described(each) for each in arguments)
    if origin is typing.Literal:
        return "one of " + ", ".join(repr(each) for each in arguments)
    if origin is list or (origin is tuple and arguments[1:] == (...,)):
        return f"a list, each {_described(arguments[0])}" if arguments else "a list"
    if origin is tuple:
        return f"a list of {len(arguments)}: " + ", ".join(_described(each) for each in arguments)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return "one of " + ", ".join(repr(member.value) for member in hint)
    return getattr(hint, "__name__", str(hint))
