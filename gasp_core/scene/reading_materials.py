"""What a material is in a scene file: the name of a preset, a preset with numbers of one's own, or all numbers."""

from __future__ import annotations

from collections.abc import Mapping

from gasp_core.contract import MATERIALS, Material
from gasp_core.errors import SceneError
from gasp_core.scene.preset_table import MaterialPreset
from gasp_core.scene.presets import find_preset, numbers_as
from gasp_core.scene.tables import Table, kind_of

__all__ = ["read_material"]


def read_material(owner: Table, key: str = "material") -> Material:
    """The material that a key of a table says.

    Parameters
    ----------
    owner
        The table that has the key.
    key
        Whose value is a text, ``"rubber"``; a table with a preset, ``{ preset = "rubber", youngs_modulus = 2e6 }``; or
        one with a model, ``{ model = "elastic", density = 400, ... }``.

    Raises
    ------
    SceneError
        Where there is no such preset or model, or a number is missing or impossible.
    """
    value = owner.values.get(key)
    if isinstance(value, str):
        return _preset(owner, key, value).material
    if not isinstance(value, Mapping):
        owner.fail(key, f"must be the name of a preset, or a table, found {kind_of(value)}")
    table = owner.table(key)
    if not table.has("preset"):
        return table.build(table.choice("model", MATERIALS), tag="model")
    preset = _preset(table, "preset", table.text("preset"))
    kind: type[Material] = table.choice("model", MATERIALS, preset.material.kind)
    try:
        taken = numbers_as(preset, kind)
    except SceneError as error:
        table.fail("model", str(error))
    own = {name: number for name, number in table.values.items() if name != "preset"}
    return table.at(table.path, {**taken, **own}).build(kind, tag="model")


def _preset(table: Table, key: str, name: str) -> MaterialPreset:
    try:
        return find_preset(name)
    except SceneError as error:
        table.fail(key, str(error))
