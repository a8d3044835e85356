"""Columns in a scene file: a number for each Gaussian."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gasp_core.contract import Material
from gasp_core.scene.columns import Column, PlyProperty
from gasp_core.scene.shape_tables import path_of
from gasp_core.scene.tables import Table, kind_of
from gasp_core.scene.varying import VARYING, VaryingMaterial, stand_ins
from gasp_core.scene.writing import MEMORY

__all__ = ["read_column_choice", "read_varying"]


def read_column_choice(table: Table, key: str, folder: Path | None, *, number: bool = False) -> Column:
    """A number for each Gaussian: the path of a ``.npy``, or ``{ property = "..." }`` of the splat's own ``.ply``.

    `number`: whether one for all would do as well, for messages.
    """
    value = table.values[key]
    if isinstance(value, Mapping):
        inner = table.table(key)
        inner.only("property")
        return inner.make(PlyProperty, {"property": inner.text("property")})
    if not isinstance(value, str) or not (value.endswith(".npy") or value.startswith(MEMORY)):
        one = "a number, " if number else ""
        table.fail(key, f'must be {one}a .npy, or {{ property = "name" }} of the .ply, found {kind_of(value)}')
    return path_of(table, key, folder)


def read_varying(table: Table, kind: type[Material], folder: Path | None) -> Material | VaryingMaterial:
    """The material of a table that has named its model: with columns where one of its numbers is no number."""
    columns = {
        name: read_column_choice(table, name, folder, number=True)
        for name in VARYING
        if isinstance(table.values.get(name), (str, Mapping))
    }
    base = table.build(kind, tag="model", **stand_ins(columns))
    return table.make(VaryingMaterial, {"base": base, "columns": columns}) if columns else base
