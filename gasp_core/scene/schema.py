"""The number of the scene file's keys, and the way of older ones to today's.

A key that is added with a default that leaves scenes what they were needs nothing here. A key that is renamed or goes,
a value that means something else, a default that changes: the number goes up by one, and a step of `_STEPS` makes
tables of the number before those of the new one. So scenes in files and in recordings stay what they were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from gasp_core.scene.tables import Table

__all__ = ["SCHEMA", "migrated"]

Tables = dict[str, Any]

SCHEMA = 1
"""Of scenes as they are written today. A scene that says none is of number 1."""

_STEPS: tuple[Callable[[Tables], Tables], ...] = ()
"""From number 1 to 2, from 2 to 3, ...: functions of the whole file's tables."""


def migrated(top: Table, *, schema: int = SCHEMA, steps: tuple[Callable[[Tables], Tables], ...] = _STEPS) -> Table:
    """A scene's tables in the keys of today.

    Raises
    ------
    SceneError
        Where the scene is of a newer number, or says no number at all that could be one.
    """
    values = dict(top.values)
    head = values.get("scene")
    number: object = head.get("schema", 1) if isinstance(head, Mapping) else 1
    if type(number) is not int or number < 1:
        top.table("scene").fail("schema", f"must be a whole number from 1 to {schema}, found {number!r}")
    if number > schema:
        top.table("scene").fail("schema", f"is {number}, this GASP knows scenes up to {schema}: update GASP")
    for step in steps[number - 1 : schema - 1]:
        values = step(values)
    return top.at(top.path, values)
