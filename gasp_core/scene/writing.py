"""A scene as the text of a scene file again, so that a recording can keep what it was made from."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, cast

from gasp_core.contract import BoxShape, Collider, HalfSpace, Material, SphereShape
from gasp_core.gaussians import Gaussians
from gasp_core.scene.columns import Column, GivenColumn, PlyProperty, column_digest
from gasp_core.scene.file_shapes import FileShape
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import Motion
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.parts import Part
from gasp_core.scene.schema import SCHEMA
from gasp_core.scene.varying import VaryingMaterial

__all__ = [
    "MEMORY",
    "gaussians_digest",
    "material_table",
    "motion_table",
    "path_from",
    "scene_to_toml",
    "toml_text",
]

MEMORY = "memory:"
"""Stands before the digest of Gaussians that came from no file."""


def gaussians_digest(gaussians: Gaussians) -> str:
    """SHA-256 over the arrays, their types and shapes."""
    digest = hashlib.sha256()
    for field in dataclasses.fields(gaussians):
        array = getattr(gaussians, field.name)
        digest.update(f"{field.name} {array.dtype.str} {array.shape};".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def scene_to_toml(scene: Scene, beside: Path | None = None) -> str:
    """TOML text that `load_scene` reads back as an equal scene.

    Gaussians built in memory are written as ``memory:`` and a digest: they are in the recording, not in the text.

    Parameters
    ----------
    scene
        To be written.
    beside
        Folder that the text is for: paths of files below it start there, so that it can be moved with all in it. All
        others are made absolute.
    """
    head = {"schema": SCHEMA, "duration": scene.duration, "frame_rate": scene.frame_rate, "gravity": scene.gravity}
    lines = ["[scene]", *_entries(head)]
    for item in scene.objects:
        lines += ["", "[[object]]", *_entries(_object(item, beside))]
    for rule in scene.contacts:
        lines += ["", "[[contact]]", *_entries(_fields(rule))]
    for collider in scene.colliders:
        lines += ["", "[[collider]]", *_entries(_collider(collider, beside))]
    for drive in scene.drives:
        lines += ["", "[[drive]]", *_entries({"kind": drive.kind, **_fields(drive)})]
    for wind in scene.force_fields:
        lines += ["", "[[wind]]", *_entries(_fields(wind))]
    if scene.domain is not None:
        lines += ["", "[domain]", *_entries(_fields(scene.domain))]
    for name in ("engine", "accuracy", "maps", "recording"):
        lines += ["", f"[{name}]", *_entries(_fields(getattr(scene, name)))]
    if scene.camera is not None:
        values = _fields(scene.camera)
        if scene.camera.file is not None:
            values["file"] = path_from(scene.camera.file, beside)
        del values["path"]
        if scene.camera.path:
            values["path"] = [_fields(point) for point in scene.camera.path]
        lines += ["", "[camera]", *_entries(values)]
    return "\n".join(lines) + "\n"


def path_from(path: Path, beside: Path | None) -> str:
    """A path as a scene file in a folder names it: from there where it lies below, else absolute."""
    if beside is not None:
        # As it is named, through whatever links; else by the folder that holds it, for a splat may be a link itself.
        for here, folder in (
            (path.absolute(), beside.absolute()),
            (path.parent.resolve() / path.name, beside.resolve()),
        ):
            if here.is_relative_to(folder) and ".." not in here.relative_to(folder).parts:
                return str(here.relative_to(folder))
    return str(path.absolute())


def _object(item: SplatObject, beside: Path | None) -> dict[str, Any]:
    values = _fields(item)
    if isinstance(item.splat, Gaussians):
        values["splat"] = MEMORY + gaussians_digest(item.splat)
    elif not str(item.splat).startswith(MEMORY):
        values["splat"] = path_from(item.splat, beside)
    if item.reduction.mesh is not None:
        values["reduction"]["mesh"] = path_from(item.reduction.mesh, beside)
    if item.material is not None:
        values["material"] = material_table(item.material, beside)
    del values["parts"]
    if item.parts:
        values["part"] = [_part(part, beside) for part in item.parts]
    if item.motion is not None:
        values["motion"] = motion_table(item.motion)
    return values


def _part(part: Part, beside: Path | None) -> dict[str, Any]:
    values = _fields(part)
    if part.labels is not None:
        values["labels"] = _column(part.labels, beside)
    if part.material is not None:
        values["material"] = material_table(part.material, beside)
    # What nobody said; a label of 0 is said.
    return {name: value for name, value in values.items() if value is not False and value != ""}


def material_table(material: Material | VaryingMaterial, beside: Path | None = None) -> dict[str, Any]:
    """A material as the table of a scene file: all its numbers, wherever they are from."""
    if isinstance(material, VaryingMaterial):
        columns = {name: _column(column, beside) for name, column in material.columns.items()}
        return {**material_table(material.base), **columns}
    values = _fields(material)
    if not material.name:
        del values["name"]
    return {"model": material.kind, **values}


def _column(column: Column, beside: Path | None) -> str | dict[str, str]:
    if isinstance(column, PlyProperty):
        return {"property": column.property}
    if isinstance(column, GivenColumn):
        return MEMORY + column_digest(column)
    return str(column) if str(column).startswith(MEMORY) else path_from(column, beside)


def motion_table(motion: Motion) -> dict[str, Any]:
    """A motion as the table of a scene file."""
    return {"kind": motion.kind, **_fields(motion)}


def _collider(collider: Collider, beside: Path | None) -> dict[str, Any]:
    values = _fields(collider)
    shape: dict[str, Any] = values.pop("shape")
    if isinstance(collider.shape, FileShape):
        shape[collider.shape.kind] = path_from(collider.shape.file, beside)
        del shape["file"]
    return {**shape, **values}


def _fields(owner: Any) -> dict[str, Any]:
    """Fields of a dataclass that are not None, as TOML values."""
    values = {field.name: getattr(owner, field.name) for field in dataclasses.fields(owner)}
    return {name: _plain(value) for name, value in values.items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, (HalfSpace, BoxShape, SphereShape, FileShape)):
        return {"shape": value.kind, **_fields(value)}
    if isinstance(value, (Gaussians, GivenColumn)):
        return ""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Path):
        return str(value)
    if dataclasses.is_dataclass(value):
        return _fields(value)
    if callable(value):
        name = getattr(value, "__name__", "")
        return f"{getattr(value, '__module__', 'memory')}:{name if name.isidentifier() else 'function'}"
    return value


def _entries(values: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {toml_text(value)}" for key, value in values.items()]


def _key(key: str) -> str:
    bare = key.isascii() and key.replace("-", "_").replace("_", "a").isalnum()
    return key if bare else toml_text(key)


def toml_text(value: Any) -> str:
    """A value as TOML; JSON's escapes are TOML's, but for DEL, which TOML wants escaped too."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Mapping):
        entries = cast("Mapping[str, Any]", value)
        return "{ " + ", ".join(_entries(entries)) + " }" if entries else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_text(entry) for entry in cast("list[Any]", value)) + "]"
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
