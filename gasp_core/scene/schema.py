"""The number of the scene file's keys, and the way of older ones to today's.

A key that is added with a default that leaves scenes what they were needs nothing here. A key that is renamed or goes,
a value that means something else, a default that changes: the number goes up by one, and a step of `_STEPS` makes
tables of the number before those of the new one. So scenes in files that say their number, and in recordings, stay what
they were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

from gasp_core.scene.tables import Table

__all__ = ["SCHEMA", "migrated"]

Tables = dict[str, Any]

SCHEMA = 4
"""Of scenes as they are written today. A scene file that says no number is of today, a recording of number 1."""


def _with_every_vertex(top: Tables) -> Tables:
    """1: every vertex was a point, on a grid of 64 cells, where nothing else was said."""
    found = dict(top)
    items: object = top.get("object")
    if isinstance(items, list):
        found["object"] = [_said(item, "reduction", mode="all") for item in cast("list[object]", items)]
    accuracy: object = top.get("accuracy", {})
    if isinstance(accuracy, Mapping) and "spacing" not in accuracy and "tolerance" not in accuracy:
        found["accuracy"] = {"resolution": 64, **cast("Mapping[str, Any]", accuracy)}
    return found


def _without_what_meant_nothing(top: Tables) -> Tables:
    """2: a static object could say how it is simulated, and an alpha below 1 shrank what was at rest."""
    found = dict(top)
    items: object = top.get("object")
    if isinstance(items, list):
        found["object"] = [_still(item) for item in cast("list[object]", items)]
    maps: object = top.get("maps")
    if isinstance(maps, Mapping):
        values = cast("Mapping[str, Any]", maps)
        alpha: object = values.get("alpha")
        if isinstance(alpha, (int, float)) and 0 < alpha < 1:
            found["maps"] = {**values, "alpha": 1.0}
    return found


def _with_half_steps(top: Tables) -> Tables:
    """3: steps were half of the stable bound, and colliders moved about the origin, where nothing else was said."""
    found: Tables = _said(top, "accuracy", substep_fraction=0.5)
    items: object = top.get("collider")
    if isinstance(items, list):
        found = {**found, "collider": [_about_the_origin(item) for item in cast("list[object]", items)]}
    return found


def _about_the_origin(item: object) -> object:
    """A table of a collider whose motion, if it has one, says its center."""
    moves = isinstance(item, Mapping) and "motion" in item
    return _said(item, "motion", center=[0.0, 0.0, 0.0]) if moves else item


def _still(item: object) -> object:
    """A table of an object without what means nothing of a static one."""
    if not isinstance(item, Mapping):
        return item
    values = cast("Mapping[str, Any]", item)
    if values.get("static") is not True:
        return values
    idle = ("velocity", "angular_velocity", "region", "reduction", "vertices")
    return {key: value for key, value in values.items() if key not in idle}


def _said(owner: object, key: str, **defaults: Any) -> Any:
    """A table with these entries in its own table `key`, where they are not said; what is no table stays for others."""
    if not isinstance(owner, Mapping):
        return owner
    values = cast("Mapping[str, Any]", owner)
    inner: object = values.get(key, {})
    if not isinstance(inner, Mapping):
        return owner
    return {**values, key: {**defaults, **cast("Mapping[str, Any]", inner)}}


_STEPS: tuple[Callable[[Tables], Tables], ...] = (_with_every_vertex, _without_what_meant_nothing, _with_half_steps)
"""From number 1 to 2, from 2 to 3, ...: functions of the whole file's tables."""


def migrated(
    top: Table, unnumbered: int, *, schema: int = SCHEMA, steps: tuple[Callable[[Tables], Tables], ...] = _STEPS
) -> Table:
    """A scene's tables in the keys of today; one that says no number is of `unnumbered`.

    Raises
    ------
    SceneError
        Where the scene is of a newer number, or says no number at all that could be one.
    """
    values = dict(top.values)
    head = values.get("scene")
    number: object = head.get("schema", unnumbered) if isinstance(head, Mapping) else unnumbered
    if type(number) is not int or number < 1:
        top.table("scene").fail("schema", f"must be a whole number from 1 to {schema}, found {number!r}")
    if number > schema:
        top.table("scene").fail("schema", f"is {number}, this GASP knows scenes up to {schema}: update GASP")
    for step in steps[number - 1 : schema - 1]:
        values = step(values)
    return top.at(top.path, values)
