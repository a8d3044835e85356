"""docs/scene.md against what is read: each table of keys has the fields of its dataclass, and their defaults."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

from gasp_core import Scene, SplatObject
from gasp_core.contract import (
    MATERIALS,
    Collider,
    Domain,
    Driven,
    EngineAccuracy,
    Impulse,
    KeyframedMotion,
    Pinned,
    SteadyMotion,
    Wind,
)
from gasp_core.engines.worker.session import Limits
from gasp_core.scene.body_contacts import ContactRule
from gasp_core.scene.file_shapes import MeshShape, SplatShape
from gasp_core.scene.motions import MOTIONS, DMiSoMotion, FrameSequence, PythonMotion
from gasp_core.scene.objects import UP_AXES, Reduction
from gasp_core.scene.parts import Part
from gasp_core.scene.schema import SCHEMA
from gasp_core.scene.settings import VIEWS, CameraChoice, EngineChoice, MapChoice, RecordingChoice
from gasp_core.solid import SolidOptions

PAGE = Path(__file__).parents[2] / "docs" / "scene.md"
SPOKEN_NAMES = {"objects": "object", "parts": "part", "contacts": "contact", "colliders": "collider", "drives": "drive"}
"""Fields whose keys in the file are in the singular: each is a table of its own."""
TABLES_OF_THEIR_OWN = frozenset({
    "object", "contact", "collider", "drive", "force_fields", "domain", "engine", "accuracy", "maps", "recording",
    "camera",
})  # fmt: skip

Row = tuple[str, str]
"""The cells of keys and of their default."""


def section(heading: str) -> str:
    """What stands under a heading that contains these words, up to the next."""
    parts = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (found,) = [part for part in parts if heading in part.partition("\n")[0]]
    return found


def tables_of(text: str) -> list[list[list[str]]]:
    """Every table of a section: its rows, the heading first, each a list of cells."""
    found: list[list[list[str]]] = []
    for block in re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE):
        rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("|"))] for line in block.splitlines()]
        found.append([rows[0], *rows[2:]])
    return found


def rows_of(heading: str, first: str, *, among: str | None = None) -> list[Row]:
    """Keys and defaults of the table whose first key is `first`; of several settings in one, those of one."""
    for head, *rows in tables_of(section(heading)):
        if among is None and head[:2] == ["key", "default"] and f"`{first}`" in rows[0][0]:
            return [(row[0], row[1]) for row in rows]
        if among is not None and head[:3] == ["table", "key", "default"]:
            kept: list[Row] = []
            current = ""
            for row in rows:
                current = row[0] or current
                if current == among:
                    kept.append((row[1], row[2]))
            return kept
    raise AssertionError(f"{heading}: no table of keys that begins with {first}")


def names_in(text: str) -> list[str]:
    return re.findall(r"`([a-z_0-9]+)`", text)


def fields_of(*kinds: type) -> dict[str, dataclasses.Field[Any]]:
    """By the keys of the file."""
    return {SPOKEN_NAMES.get(field.name, field.name): field for kind in kinds for field in dataclasses.fields(kind)}


def default_of(field: dataclasses.Field[Any]) -> object:
    """As TOML has it; None where it has none, or nothing to be written."""
    value = field.default
    if field.default_factory is not dataclasses.MISSING:
        value = field.default_factory()
    if value is dataclasses.MISSING or value is None or value == () or value == "" or value == {}:
        return None
    if isinstance(value, Enum):
        return value.value
    if dataclasses.is_dataclass(value):
        # A table that says its first key alone.
        name = dataclasses.fields(value)[0].name
        return None if getattr(value, name) is None else {name: getattr(value, name)}
    return list(value) if isinstance(value, tuple) else value


LEFT_OPEN = {
    "up": UP_AXES[3],
    "metres_per_unit": 1,
    "collider": False,
    "levels": Reduction(mode="cores", fraction=0.5).levels,
    "transfer": Reduction(mode="cores", fraction=0.5).transfer,
    "start_velocity": True,
    "frame_limit": Limits().frame,
    "view": next(iter(VIEWS)),
}
"""What a field that is None, or 0 for a view, comes to mean."""

WORDS = {"never": float("inf"), "at rest": None, "upright": None}
"""Defaults that stand there without being TOML."""


def defaults_said(keys: list[str], cell: str) -> list[object]:
    """What a row says of each of its keys; ... where it tells in words what happens without it."""
    texts = [text.strip() for text in cell.split(",")] if len(keys) > 1 and cell.count("[") == 0 else [cell]
    if len(texts) == 1:
        texts *= len(keys)
    found: list[object] = []
    for text in texts:
        literal = re.fullmatch(r"(?:(?:splats|today's,) )?`([^`]*)`(?:, .*)?", text)
        if not text:
            found.append(None)
        elif literal and literal[1] != "[maps]":
            found.append(tomllib.loads(f"a = {literal[1]}")["a"])
        else:
            found.append(WORDS.get(text, ...))
    return found


def faults(rows: list[Row], fields: dict[str, dataclasses.Field[Any]]) -> Iterator[str]:
    """Where rows and fields differ."""
    said: dict[str, object] = {}
    for cell, default in rows:
        keys = names_in(cell)
        for key, value in zip(keys, defaults_said(keys, default), strict=True):
            if key in said and key in fields:
                # What means another thing beside another key has a row for each.
                continue
            said[key] = value
    yield from (f"{key}: is not read" for key in said.keys() - fields.keys())
    yield from (f"{key}: is not on the page" for key in fields.keys() - said.keys())
    for key in said.keys() & fields.keys():
        stands, true = said[key], default_of(fields[key])
        if stands is ... and true is not None:
            yield f"{key}: its default is {true!r}, the page says words"
        elif stands is not ... and stands != true and (true or stands != LEFT_OPEN.get(key)):
            yield f"{key}: its default is {true!r}, the page says {stands!r}"


def contents(
    *kinds: type, without: frozenset[str] = frozenset(), besides: dict[str, object] | None = None
) -> dict[str, dataclasses.Field[Any]]:
    """What of several classes stands in one table, and what the reader itself knows."""
    fields = {key: field for key, field in fields_of(*kinds).items() if key not in without}
    for name, default in (besides or {}).items():
        fields |= fields_of(dataclasses.make_dataclass("Read", [(name, Any, dataclasses.field(default=default))]))
    return fields


OF_MOTIONS = frozenset({"composition", "start", "rate", "schedule", "start_velocity"})
OF_MESHES, OF_CORES = frozenset({"mesh", "mesh_up", "points"}), frozenset({"fraction", "count", "levels", "transfer"})
OF_FRAMES = frozenset({"frame_rate", "match"})
CENTER, FILE, KIND = frozenset({"center"}), {"file": None}, {"kind": None}
OF_PLACES = frozenset({"file", "height", "metres_per_unit", "position", "rotation"})

KEY_TABLES = {
    "scene": ("`[scene]`", "schema", contents(Scene, without=TABLES_OF_THEIR_OWN, besides={"schema": SCHEMA})),
    "object": ("`[[object]]`", "name", contents(SplatObject)),
    "solid": ("`[[object]]`", "interior", contents(SolidOptions)),
    "reduction": ("`[[object]]`", "fraction", contents(Reduction, without=OF_MESHES | {"mode"})),
    "mesh": ("`[[object]]`", "mesh", contents(Reduction, without=OF_CORES | {"mode"})),
    "part": ("`[[object.part]]`", "name", contents(Part)),
    "motion": ("`[object.motion]`", "kind", contents(FrameSequence, without=OF_FRAMES, besides=KIND)),
    "d-miso": ("`[object.motion]`", "duration", contents(DMiSoMotion, without=OF_MOTIONS)),
    "python": ("`[object.motion]`", "span", contents(PythonMotion, without=OF_MOTIONS | {"function"})),
    "contact": ("`[[contact]]`", "between", contents(ContactRule)),
    "collider": ("`[[collider]]`", "shape", contents(Collider)),
    "file": ("`[[collider]]`", "up", contents(SplatShape, MeshShape, without=OF_PLACES)),
    "moving": ("`[[collider]]`", "velocity", contents(SteadyMotion, KeyframedMotion, without=CENTER, besides=FILE)),
    "engine": ("`[engine]`", "engine", contents(EngineChoice)),
    "accuracy": ("`[engine]`", "accuracy", contents(EngineAccuracy)),
    "maps": ("`[engine]`", "maps", contents(MapChoice)),
    "recording": ("`[engine]`", "recording", contents(RecordingChoice)),
    "camera": ("`[camera]`", "view", contents(CameraChoice)),
}  # fmt: skip


@pytest.mark.parametrize("name", KEY_TABLES)
def test_a_table_of_keys_has_the_fields_and_their_defaults(name):
    heading, first, fields = KEY_TABLES[name]
    rows = rows_of(heading, first, among=name if heading == "`[engine]`" else None)
    assert sorted(faults(rows, fields)) == []


def test_every_table_of_keys_is_compared():
    tables = [table for table in tables_of(PAGE.read_text(encoding="utf-8")) if "default" in table[0]]
    # Four of them are one.
    assert len(KEY_TABLES) == len(tables) + 3


def test_a_difference_is_noticed():
    @dataclasses.dataclass
    class Lamp:
        power: float
        colour: str = "white"
        on: bool = False

    fields = fields_of(Lamp)
    right = [("`power`", ""), ("`colour`", '`"white"`'), ("`on`", "`false`")]
    assert list(faults(right, fields)) == []
    assert list(faults(right[:2], fields)) == ["on: is not on the page"]
    assert list(faults([*right, ("`size`", "")], fields)) == ["size: is not read"]
    assert list(faults([*right[:2], ("`on`", "`true`")], fields)) == ["on: its default is False, the page says True"]
    assert list(faults([("`power`", "`1`"), *right[1:]], fields)) == ["power: its default is None, the page says 1"]
    assert list(faults([right[0], ("`colour`", "that of the wall"), right[2]], fields)) == [
        "colour: its default is 'white', the page says words"
    ]
    assert list(faults([right[0], ("`colour`, `on`", '`"white"`')], fields)) == [
        "on: its default is False, the page says 'white'"
    ]


# --- tables whose rows are kinds ------------------------------------------------------------------------------------


def test_materials_have_their_keys_and_defaults():
    (table,) = [table for table in tables_of(section("`[[object]]`")) if table[0] == ["model", "keys"]]
    found: dict[str, str] = {}
    for models, keys in table[1:]:
        for name in re.findall(r"`([a-z-]+)`", models):
            found[name] = keys
    assert found.keys() == MATERIALS.keys()
    for name, text in found.items():
        fields = fields_of(MATERIALS[name])
        assert set(names_in(text)) == fields.keys() - {"density", "name"}, name
        for key in names_in(text):
            said = re.search(rf'`{key}`(?: \([^)]*\)| \[[^]]*\])*, (?:([\d.]+)|`("[^"]*")`)', text)
            stands = tomllib.loads(f"a = {said[1] or said[2]}")["a"] if said else None
            assert stands == default_of(fields[key]), f"{name}.{key}"


def test_drives_have_their_keys():
    (table,) = tables_of(section("`[[drive]]`"))
    rows = {row[0].strip("`"): row[1] for row in table[1:]}
    assert rows.keys() == {kind.kind for kind in (Pinned, Driven, Impulse)}
    window = {"region", "start", "end"}
    for kind in (Pinned, Driven, Impulse):
        assert set(names_in(rows[kind.kind])) - window == fields_of(kind).keys() - window


@pytest.mark.parametrize(
    "heading, opening, kind", [("`[[drive]]`", "`[[wind]]`: ", Wind), ("`[domain]`", "\n\n", Domain)]
)
def test_tables_in_words_name_their_keys(heading, opening, kind):
    text = section(heading).partition(opening)[2].partition("\n\n")[0]
    assert set(names_in(text)) == fields_of(kind).keys()


def test_motions_that_are_formulas_have_their_keys():
    (table,) = [table for table in tables_of(section("`[object.motion]`")) if table[0] == ["kind", "keys", "psi"]]
    shared = {"composition", "start", "rate", "schedule", "start_velocity", "phase"}
    before: set[str] = set()
    for row in table[1:]:
        keys = set(names_in(row[1])) | (before if row[1].startswith("those") else set())
        assert keys == fields_of(MOTIONS[row[0].strip("`")]).keys() - shared, row[0]
        before = keys
