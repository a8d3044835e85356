"""Parts of an object in a scene file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from gasp_core.scene.column_tables import read_column_choice
from gasp_core.scene.parts import Part
from gasp_core.scene.reading_materials import read_material
from gasp_core.scene.shape_tables import read_shape
from gasp_core.scene.tables import Table, kind_of

__all__ = ["read_part"]

_PART = ("name", "region", "component", "labels", "label", "material", "pinned", "rigid", "driven")


def read_part(table: Table, folder: Path | None) -> Part:
    """The part that a table describes; relative paths start at `folder`, None: they are taken as they are."""
    table.only(*_PART)
    values: dict[str, Any] = {"name": table.text("name", ""), "pinned": table.flag("pinned")}
    values["rigid"] = table.flag("rigid")
    values["driven"] = table.flag("driven")
    if table.has("component"):
        values["component"] = _whole(table, "component", table.values["component"])
    if table.has("labels"):
        values["labels"] = read_column_choice(table, "labels", folder)
    if table.has("label"):
        label: object = table.values["label"]
        listed = cast("list[object]", label) if isinstance(label, list) else [label]
        values["label"] = tuple(_whole(table, "label", each) for each in listed)
    if table.has("region"):
        values["region"] = read_shape(table.table("region"))
    if table.has("material"):
        values["material"] = read_material(table, folder=folder)
    return table.make(Part, values)


def _whole(table: Table, key: str, value: object) -> int:
    if type(value) is not int:
        table.fail(key, f"must be a whole number, found {kind_of(value)}")
    return value
