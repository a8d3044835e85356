"""Scene files: TOML in, `Scene` out, or one line that says where it went wrong."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, cast

from gasp_core.contract import (
    ContactCondition,
    Domain,
    Drive,
    Driven,
    EngineAccuracy,
    Impulse,
    Pinned,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.io.format_errors import shown
from gasp_core.io.near_files import did_you_mean_file
from gasp_core.io.text_files import read_text
from gasp_core.scene.body_contacts import ContactRule
from gasp_core.scene.changes import changed
from gasp_core.scene.files import with_files
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import MOTIONS, Motion, PythonMotion
from gasp_core.scene.objects import UP_AXES, Floaters, Reduction, SplatObject
from gasp_core.scene.part_tables import read_part
from gasp_core.scene.reading_materials import read_material
from gasp_core.scene.schema import SCHEMA, migrated
from gasp_core.scene.settings import CameraChoice, EngineChoice, MapChoice, RecordingChoice, Viewpoint
from gasp_core.scene.shape_tables import path_of, read_collider, read_contact, read_shape
from gasp_core.scene.tables import StoredTable, Table, kind_of
from gasp_core.scene.toml_errors import explained
from gasp_core.solid.options import SolidOptions

__all__ = ["load_camera", "load_scene", "read_scene", "read_stored_motion", "read_stored_scene"]

_DRIVES: dict[str, type[Drive]] = {drive.kind: drive for drive in (Pinned, Driven, Impulse)}
_SPLATS = (".ply", ".splat", ".spz", ".sog", ".glb", ".usdc", ".usda", ".usd", ".usdz")
_LONGEST_CHANGES = 120
"""Of a message: what has been set, from outside of the file."""
_LONGEST_SCENE = 1 << 20
_DEEPEST = 64
_ENDLESS_KEY = re.compile(r"(?:[\w\-\"' \t]{0,40}\.){500}")
"""Python's reader of TOML takes time with the square of a key's parts."""
_TOP = (
    "scene", "object", "contact", "collider", "drive", "wind", "domain", "engine", "accuracy", "maps", "recording",
    "camera",
)  # fmt: skip
_OBJECT = (
    "name", "splat", "material", "part", "static", "up", "height", "metres_per_unit", "position", "rotation",
    "velocity", "angular_velocity", "reduction", "solid", "min_opacity", "region", "floaters", "vertices", "motion",
    "collider",
)  # fmt: skip


def load_scene(path: str | Path, changes: Sequence[str] = ()) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path
        TOML; splats named in it are looked for beside it.
    changes
        Keys to set instead of what the file says, each "object.plant.height=0.3".

    Raises
    ------
    SceneError
        Where the file cannot be read, is no TOML, has an unknown key, a wrong type or an impossible number, or names a
        splat that is not there. The message names file and key.
    """
    path = Path(path)
    # One change is one of several.
    changes = [changes] if isinstance(changes, str) else changes
    return read_scene(_text_of(path), file=str(path), folder=path.parent, changes=changes)


def load_camera(path: str | Path) -> CameraChoice:
    """The camera of a scene file, or of a file that has nothing but a `[camera]`.

    Raises
    ------
    SceneError
        Where it cannot be read, has no camera, or one that is impossible.
    """
    path = Path(path)
    top = Table(str(path), "", _tables(_text_of(path), str(path)))
    top.only(*_TOP)
    top.required("camera", "a table [camera]")
    return _read_camera(top.table("camera", "view"), path.parent)


def _text_of(path: Path) -> str:
    name = shown(path)
    try:
        text = read_text(path, _LONGEST_SCENE)
    except FileNotFoundError:
        raise SceneError(f"{name}: no such scene file{did_you_mean_file(path)}") from None
    except IsADirectoryError as error:
        if (path / "zarr.json").exists():
            raise SceneError(f"{name}: is a recording, and no scene file: gasp render {name} shows it") from None
        raise SceneError(f"{name}: cannot be read: {error.strerror}") from None
    except OSError as error:
        raise SceneError(f"{name}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        if path.name.lower().endswith(_SPLATS):
            raise _splat(name) from None
        if isinstance(error, UnicodeDecodeError):
            raise SceneError(f"{name}: is not a text file in UTF-8, so no scene file (TOML)") from None
        raise SceneError(f"{name}: is no scene file: {error}") from None
    if path.name.lower().endswith(_SPLATS):
        raise _splat(name)
    return text


def _splat(name: str) -> SceneError:
    return SceneError(f"{name}: is a splat, and no scene file: gasp new {name} writes a scene of it")


def read_scene(text: str, *, file: str, folder: Path | None, changes: Sequence[str] = ()) -> Scene:
    """A scene from TOML text.

    Parameters
    ----------
    text
        TOML.
    file
        Named in messages.
    folder
        Relative splat paths start here and must exist. None: paths are taken as they are and not looked for.
    changes
        As of `load_scene`.
    """
    try:
        return _read(migrated(Table(file, "", _tables(text, file, changes)), SCHEMA), folder)
    except SceneError as error:
        said, own = str(error), f"{shown(file)}: "
        if changes and said.startswith(own) and _is_scene(text, file, folder):
            # The fault is in none of the lines of that file.
            told = ", ".join(map(shown, changes))
            told = told if len(told) <= _LONGEST_CHANGES else f"{told[:_LONGEST_CHANGES]}..."
            raise SceneError(f"{own[:-2]}, with --set {told}: {said.removeprefix(own)}") from None
        raise


def _is_scene(text: str, file: str, folder: Path | None) -> bool:
    try:
        read_scene(text, file=file, folder=folder)
    except SceneError:
        return False
    return True


def read_stored_scene(text: str, *, file: str, beside: Path | None = None) -> tuple[Scene, tuple[str, ...]]:
    """A scene that a recording has kept, whichever GASP wrote it; paths are not looked for.

    Parameters
    ----------
    text
        TOML.
    file
        Named in messages.
    beside
        Folder that relative paths start at, see `scene_to_toml`. None: paths are taken as they are.

    Returns
    -------
    scene
        Of the keys that are known today.
    forgotten
        Paths of the keys that are not, e.g. ``object[0].glow``.

    Raises
    ------
    SceneError
        Where it cannot be read all the same.
    """
    forgotten: list[str] = []
    scene = _read(migrated(StoredTable(file, "", _tables(text, file), forgotten), 1), None)
    return scene if beside is None else with_files(scene, lambda path: beside / path), tuple(forgotten)


def read_stored_motion(values: Mapping[str, Any], *, file: str) -> Motion:
    """A motion that a recording has kept, as a table of the scene has it; keys that are not known are passed over.

    Raises
    ------
    SceneError
        Where it cannot be read all the same; `file` is named.
    """
    return _read_motion(StoredTable(file, "", values, []), None)


def _tables(text: str, file: str, changes: Sequence[str] = ()) -> dict[str, Any]:
    file = shown(file)
    if _ENDLESS_KEY.search(text):
        raise SceneError(f"{file}: has a key of more than 500 parts: write it in tables")
    try:
        values = tomllib.loads(text, parse_float=_finite_or_said)
    except RecursionError:
        raise SceneError(f"{file}: is nested too deep") from None
    except ValueError as error:
        raise SceneError(f"{file}: is not valid TOML: {explained(error, text)}") from None
    values = changed(values, changes)
    _refuse_extremes(values, file)
    return values


def _finite_or_said(text: str) -> float:
    """A number of the file; infinite only where it says so."""
    number = float(text)
    if math.isinf(number) and "inf" not in text:
        raise ValueError(f"the number {text[:20]} is beyond 1e308")
    return number


def _refuse_extremes(values: dict[str, Any], file: str) -> None:
    """Refuse what TOML need not take (whole numbers beyond 64 bits) and what is nested deeper than any scene."""
    left: list[tuple[Any, tuple[str, ...]]] = [(values, ())]
    while left:
        value, keys = left.pop()
        if len(keys) > _DEEPEST:
            raise SceneError(f"{file}: is nested too deep")
        if isinstance(value, dict):
            left += [(entry, (*keys, key)) for key, entry in cast("dict[str, Any]", value).items()]
        elif isinstance(value, list):
            left += [(entry, (*keys, str(index))) for index, entry in enumerate(cast("list[Any]", value))]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            where = shown(".".join(key[:60] for key in keys))
            raise SceneError(
                f"{file}: {where}: a whole number must be below 2^63; write more with a point, up to 1e308"
            )


def _read(top: Table, folder: Path | None) -> Scene:
    top.only(*_TOP)
    top.required("scene", "a table [scene]")
    head = top.table("scene")
    head.only("schema", "duration", "frame_rate", "gravity")
    accuracy = top.table("accuracy")
    if accuracy.has("tolerance"):
        accuracy.fail("tolerance", "comes later: name resolution = 48 (cells along the largest object) yourself")
    objects = [_read_object(table, folder) for table in top.tables("object")]
    if not objects:
        top.fail("object", "missing, a scene needs at least one [[object]]")
    for index, item in enumerate(objects):
        if item.name in [other.name for other in objects[:index]]:
            top.fail(f"object[{index}].name", f'"{item.name}" is taken: give each object a name of its own')
    return head.make(
        Scene,
        {
            "duration": head.number("duration"),
            "frame_rate": head.number("frame_rate"),
            "gravity": head.vector("gravity", (0.0, 0.0, -9.81)),
            "objects": tuple(objects),
            "contacts": tuple(_read_rule(table) for table in top.tables("contact")),
            "colliders": tuple(read_collider(table, folder) for table in top.tables("collider")),
            "drives": tuple(_read_drive(table) for table in top.tables("drive")),
            "force_fields": tuple(_read_wind(table) for table in top.tables("wind")),
            "domain": top.table("domain").build(Domain) if top.has("domain") else None,
            "engine": _read_engine(top.table("engine", "name")),
            "accuracy": accuracy.build(EngineAccuracy),
            "maps": top.table("maps").build(MapChoice),
            "recording": top.table("recording").build(RecordingChoice),
            "camera": _read_camera(top.table("camera", "view"), folder) if top.has("camera") else None,
        },
    )


def _read_object(table: Table, folder: Path | None) -> SplatObject:
    table.only(*_OBJECT)
    values: dict[str, Any] = {"name": table.text("name"), "splat": path_of(table, "splat", folder)}
    if table.has("material"):
        values["material"] = read_material(table, folder=folder)
    values["parts"] = tuple(read_part(each, folder) for each in table.tables("part"))
    for key in ("height", "metres_per_unit"):
        if table.has(key):
            values[key] = table.number(key)
    for key in ("position", "velocity", "angular_velocity"):
        if table.has(key):
            values[key] = table.vector(key)
    if table.has("up"):
        values["up"] = table.choice("up", {axis: axis for axis in UP_AXES})
    if table.has("rotation"):
        values["rotation"] = table.numbers("rotation", (3, 4))
    if table.has("reduction"):
        reduction = table.table("reduction", "mode")
        mesh: dict[str, Any] = {"mesh": path_of(reduction, "mesh", folder)} if reduction.has("mesh") else {}
        values["reduction"] = reduction.build(Reduction, **mesh)
    if table.has("solid"):
        values["solid"] = table.table("solid").build(SolidOptions)
    if table.has("region"):
        values["region"] = read_shape(table.table("region"))
    if table.has("vertices"):
        values["vertices"] = _read_vertices(table)
    if table.has("collider"):
        values["collider"] = read_contact(table)
    if table.has("motion"):
        values["motion"] = _read_motion(table.table("motion"), folder)
    values["static"] = table.flag("static")
    values["min_opacity"] = table.number("min_opacity", 0.0)
    values["floaters"] = table.choice("floaters", {rule.value: rule for rule in Floaters}, Floaters.KEEP.value)
    return table.make(SplatObject, values)


def _read_motion(table: Table, folder: Path | None) -> Motion:
    kind = table.choice("kind", MOTIONS)
    if not issubclass(kind, PythonMotion) or not table.has("function"):
        return table.build(kind, tag="kind")
    text = table.text("function")
    module, _, name = text.rpartition(":")
    # A module beside the scene file comes before one of that name that is installed.
    beside = None if folder is None else (folder / f"{module}.py").absolute()
    return table.build(kind, tag="kind", function=f"{beside}:{name}" if beside and _is_file(beside) else text)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        # The name is too long for one.
        return False


def _read_vertices(table: Table) -> Literal[3, 4, "auto"]:
    value = table.values["vertices"]
    if isinstance(value, bool) or value not in (3, 4, "auto"):
        table.fail("vertices", f'must be 3, 4 or "auto", found {kind_of(value)}')
    return value


def _read_drive(table: Table) -> Drive:
    kind = table.choice("kind", _DRIVES)
    table.required("region", 'a table such as { shape = "box", center = [0, 0, 0], half_extents = [1, 1, 1] }')
    return table.build(kind, tag="kind", region=read_shape(table.table("region")))


def _read_rule(table: Table) -> ContactRule:
    table.only("between", "contact", "friction")
    between: object = table.values.get("between")
    if between is not None and not (
        isinstance(between, list)
        and len(cast("list[object]", between)) == 2
        and all(isinstance(name, str) for name in cast("list[object]", between))
    ):
        table.fail("between", f'must be the names of two objects, e.g. ["bucket", "sand"], found {kind_of(between)}')
    return table.make(
        ContactRule,
        {
            "between": None if between is None else tuple(cast("list[str]", between)),
            "contact": table.choice("contact", {way.value: way for way in ContactCondition}, "separate"),
            "friction": table.number("friction", 0.0),
        },
    )


def _read_wind(table: Table) -> Wind:
    region = read_shape(table.table("region")) if table.has("region") else None
    return table.build(Wind, region=region)


def _read_camera(table: Table, folder: Path | None) -> CameraChoice:
    given: dict[str, Any] = {}
    if table.has("file"):
        given["file"] = path_of(table, "file", folder)
    if table.has("path"):
        given["path"] = tuple(point.build(Viewpoint) for point in table.tables("path"))
    return table.build(CameraChoice, **given)


def _read_engine(table: Table) -> EngineChoice:
    if table.values.get("name") == "auto":
        table.fail("name", '"auto" comes later: name an engine yourself (see `gasp engines`)')
    return table.build(EngineChoice, options=dict(table.table("options").values))
