"""Parts and columns in a scene file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from gasp_core.contract import Material
from gasp_core.scene.columns import Column, PlyProperty
from gasp_core.scene.paths import read_path
from gasp_core.scene.tables import Table, kind_of
from gasp_core.scene.varying import VARYING, VaryingMaterial, stand_ins

__all__ = ["PART", "read_column_choice", "read_part_values", "read_varying"]

PART = ("name", "region", "component", "labels", "label", "material", "pinned", "rigid")
"""Keys of a part."""


def read_part_values(table: Table, folder: Path | None) -> dict[str, Any]:
    """What a part says, but for its region and its material."""
    table.only(*PART)
    values: dict[str, Any] = {"name": table.text("name", ""), "pinned": table.flag("pinned")}
    values["rigid"] = table.flag("rigid")
    if table.has("component"):
        values["component"] = _whole(table, "component", table.values["component"])
    if table.has("labels"):
        values["labels"] = read_column_choice(table, "labels", folder)
    if table.has("label"):
        label: object = table.values["label"]
        listed = cast("list[object]", label) if isinstance(label, list) else [label]
        values["label"] = tuple(_whole(table, "label", each) for each in listed)
    return values


def _whole(table: Table, key: str, value: object) -> int:
    if type(value) is not int:
        table.fail(key, f"must be a whole number, found {kind_of(value)}")
    return value


def read_column_choice(table: Table, key: str, folder: Path | None) -> Column:
    """A number for each Gaussian: the path of a ``.npy``, or ``{ property = "..." }`` of the splat's own ``.ply``."""
    value = table.values[key]
    if isinstance(value, str):
        return read_path(table, key, folder)
    if not isinstance(value, Mapping):
        table.fail(key, f'must be a .npy, or {{ property = "name" }} of the .ply, found {kind_of(value)}')
    inner = table.table(key)
    inner.only("property")
    return inner.make(PlyProperty, {"property": inner.text("property")})


def read_varying(table: Table, kind: type[Material], folder: Path | None) -> Material | VaryingMaterial:
    """The material of a table that has named its model: with columns where one of its numbers is no number."""
    columns = {
        name: read_column_choice(table, name, folder)
        for name in VARYING
        if isinstance(table.values.get(name), (str, Mapping))
    }
    base = table.build(kind, tag="model", **stand_ins(columns))
    return table.make(VaryingMaterial, {"base": base, "columns": columns}) if columns else base
