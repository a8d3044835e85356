"""Problems, accuracies, options and reports as plain JSON values, with their arrays set aside.

No pickle: what is rebuilt at the other end is a dataclass or an enum named by its module, and nothing is called.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["from_plain", "to_plain"]

Array = NDArray[Any]

_SEQUENCES: dict[str, type[Any]] = {"tuple": tuple, "list": list, "frozenset": frozenset, "set": set}


def to_plain(value: object, arrays: dict[str, Array]) -> Any:
    """A value as JSON has it.

    Parameters
    ----------
    value
        None, numbers, text, paths, enums, arrays, dataclasses of these, and tuples, lists, sets and mappings of these.
    arrays
        Arrays within it are added here, under the names that stand in their places.

    Raises
    ------
    TypeError
        Where something else is within.
    """
    if isinstance(value, Enum):
        return {"enum": _address(type(value)), "name": value.name}
    if isinstance(value, np.generic):
        return to_plain(value.item(), arrays)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        name = str(len(arrays))
        arrays[name] = cast(Array, value)
        return {"array": name}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: to_plain(getattr(value, field.name), arrays) for field in dataclasses.fields(value)}
        return {"dataclass": _address(type(value)), "fields": fields}
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, Mapping):
        entries = cast("Mapping[object, object]", value).items()
        return {"mapping": [[to_plain(key, arrays), to_plain(item, arrays)] for key, item in entries]}
    for kind, sequence in _SEQUENCES.items():
        if isinstance(value, sequence):
            return {"sequence": kind, "items": [to_plain(item, arrays) for item in cast("Any", value)]}
    raise TypeError(f"{type(value).__name__} cannot be sent to a worker: use numbers, text, tuples and dataclasses")


def from_plain(plain: Any, arrays: Mapping[str, Array]) -> Any:
    """The value that `to_plain` made this of.

    Fields are set as they were, without a constructor: to normalise a unit vector once more would change its last bit.
    """
    if not isinstance(plain, dict):
        return plain
    told = cast("dict[str, Any]", plain)
    if "dataclass" in told:
        made = object.__new__(_class_at(told["dataclass"]))
        for name, value in told["fields"].items():
            object.__setattr__(made, name, from_plain(value, arrays))
        return made
    if "array" in told:
        array = arrays[told["array"]]
        array.flags.writeable = False
        return array
    if "enum" in told:
        return _class_at(told["enum"])[told["name"]]
    if "path" in told:
        return Path(told["path"])
    if "mapping" in told:
        return {from_plain(key, arrays): from_plain(item, arrays) for key, item in told["mapping"]}
    return _SEQUENCES[told["sequence"]](from_plain(item, arrays) for item in told["items"])


def _address(kind: type) -> str:
    if "<" in kind.__qualname__ or kind.__module__ == "__main__":
        raise TypeError(f"{kind.__qualname__} cannot be sent to a worker: define it at the top of a module")
    return f"{kind.__module__}:{kind.__qualname__}"


@functools.cache
def _class_at(address: str) -> Any:
    module, _, name = address.partition(":")
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    if not (isinstance(found, type) and (dataclasses.is_dataclass(found) or issubclass(found, Enum))):
        raise TypeError(f"{address} is neither a dataclass nor an enum")
    return found
