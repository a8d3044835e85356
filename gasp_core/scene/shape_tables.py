"""Tables of a scene file that describe where something is: files, shapes, colliders."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gasp_core.contract import BodyContact, BoxShape, Collider, ContactCondition, HalfSpace, Shape, Side, SphereShape
from gasp_core.io.near_files import did_you_mean_file
from gasp_core.scene.file_shapes import FileShape, MeshShape, SplatShape
from gasp_core.scene.objects import UP_AXES
from gasp_core.scene.rigid_motions import read_rigid_motion
from gasp_core.scene.tables import Table, kind_of
from gasp_core.solid.options import SolidOptions

__all__ = ["path_of", "read_collider", "read_contact", "read_shape"]

_FORMULAS = ("plane", "box", "sphere")
_FILE_SHAPES: dict[str, type[FileShape]] = {kind.kind: kind for kind in (SplatShape, MeshShape)}
_CONTACT = ("contact", "friction", "side", "motion")
_LONGEST_PATH = 300
_VARIABLE = re.compile(r"\$\{?(\w+)")


def path_of(table: Table, key: str, folder: Path | None) -> Path:
    """The path of a file that a key names, which must be there.

    Parameters
    ----------
    table, key
        Where it is said; variables of the environment are put in.
    folder
        Where relative paths start. None: the path is taken as it is and not looked for.
    """
    text = table.text(key)
    if folder is None:
        return Path(text)
    try:
        # A file may have any name, that of a variable too.
        path = folder / text
        there = path.exists()
        if not there:
            path = folder / Path(os.path.expandvars(text)).expanduser()
            there = path.exists()
    except (OSError, ValueError, RuntimeError):
        # A name that is too long, a null character, a home of nobody: none of them is a file.
        path, there = folder, False
    if not there:
        # As it is written: what a variable stands for need not go to everybody who is shown the message.
        unset = [name for name in _VARIABLE.findall(text) if name not in os.environ]
        hint = f"{unset[0]} is not set in the environment" if unset else "relative paths start at the scene file"
        # Of a folder that somebody's environment names nothing need be told.
        near = "" if "$" in text else did_you_mean_file(path)
        table.fail(key, f"no such file: {_shortened(text)} ({hint}){near}")
    return path


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_PATH else f"{text[:_LONGEST_PATH]}..."


def read_shape(table: Table, *also: str) -> Shape:
    """The shape a table describes.

    Parameters
    ----------
    table
        Its keys are those of the shape.
    also
        Keys that belong to somebody else.
    """
    shape = table.choice("shape", {kind: kind for kind in _FORMULAS})
    if shape == "box":
        table.only("shape", "center", "half_extents", *also)
        return table.make(BoxShape, {"center": table.vector("center"), "half_extents": table.vector("half_extents")})
    if shape == "sphere":
        table.only("shape", "center", "radius", *also)
        return table.make(SphereShape, {"center": table.vector("center"), "radius": table.number("radius")})
    if table.has("height"):
        table.only("shape", "height", *also)
        return table.make(HalfSpace, {"point": (0.0, 0.0, table.number("height")), "normal": (0.0, 0.0, 1.0)})
    table.only("shape", "point", "normal", "height", *also)
    return table.make(HalfSpace, {"point": table.vector("point"), "normal": table.vector("normal")})


def read_contact(table: Table) -> BodyContact | None:
    """Of an object that stands still: true, false, or a table with its friction."""
    value = table.values["collider"]
    if isinstance(value, bool):
        return BodyContact() if value else None
    if not isinstance(value, Mapping):
        table.fail("collider", f"must be true, false or a table such as {{ friction = 0.4 }}, found {kind_of(value)}")
    return table.table("collider").build(BodyContact)


def _read_file_shape(table: Table, kind: type[FileShape], folder: Path | None) -> FileShape:
    """A shape that a file describes; the file's key is the kind's name."""
    fields = [field.name for field in dataclasses.fields(kind) if field.name != "file"]
    table.only("shape", kind.kind, *fields, *_CONTACT)
    own = {key: value for key, value in table.values.items() if key in fields}
    given: dict[str, Any] = {"file": path_of(table, kind.kind, folder)}
    if "up" in own:
        given["up"] = table.choice("up", {axis: axis for axis in UP_AXES})
    if "rotation" in own:
        given["rotation"] = table.numbers("rotation", (3, 4))
    if "solid" in own:
        given["solid"] = table.table("solid").build(SolidOptions)
    return table.at(table.path, own).build(kind, **given)


def read_collider(table: Table, folder: Path | None) -> Collider:
    """A table of `[[collider]]`; paths of files start at the folder, see `path_of`."""
    kind = table.choice("shape", {**dict.fromkeys(_FORMULAS), **_FILE_SHAPES})
    shape = _read_file_shape(table, kind, folder) if kind else read_shape(table, *_CONTACT)
    middle = shape.center if isinstance(shape, BoxShape | SphereShape) else None
    return table.make(
        Collider,
        {
            "shape": shape,
            "contact": table.choice("contact", {way.value: way for way in ContactCondition}, "separate"),
            "friction": table.number("friction", 0.0),
            "side": table.choice("side", {side.value: side for side in Side}, "outside"),
            "motion": read_rigid_motion(table.table("motion"), folder, middle) if table.has("motion") else None,
        },
    )
