"""Materials by what people call them: a preset as it is, or adapted."""

from __future__ import annotations

import dataclasses
import difflib
import re
from typing import Any

from gasp_core.contract import MATERIALS, Elastic, Material, NeoHookean, Rigid
from gasp_core.errors import SceneError
from gasp_core.scene.preset_table import PRESETS, MaterialPreset

__all__ = ["find_preset", "material_preset", "numbers_as"]

_NEAREST = 3
_LONGEST = 60
"""Characters of a name that a message shows."""
_OTHER_MODELS: tuple[type[Material], ...] = (Elastic, NeoHookean, Rigid)
"""That a preset may be taken as instead of its own: their numbers mean the same wherever they occur."""


def _plain(name: str) -> str:
    """A name without case; spaces, underscores and hyphens are alike."""
    return re.sub(r"[\s_-]+", " ", name.strip()).casefold()


def find_preset(name: str) -> MaterialPreset:
    """The preset of a name, or of another name for the same.

    Parameters
    ----------
    name
        In whatever case; spaces, underscores and hyphens are alike.

    Raises
    ------
    SceneError
        Where there is none; the nearest names are named, then all.
    """
    known = {_plain(called): preset for preset in PRESETS for called in (preset.name, *preset.aliases)}
    wanted = _plain(name)
    if wanted in known:
        return known[wanted]
    within = [called for called in known if wanted in called.split()]
    close = [*within, *difflib.get_close_matches(wanted, known, n=_NEAREST)]
    meant = " or ".join(dict.fromkeys(f'"{known[called].name}"' for called in close))
    model = f'a model is: {{ model = "{wanted}", density = ... }}; ' if wanted in MATERIALS else ""
    raise SceneError(
        f'no material preset is called "{name[:_LONGEST]}"; {model}{f"did you mean {meant}? " if meant else ""}'
        f"there are {', '.join(sorted(preset.name for preset in PRESETS))}"
    )


def numbers_as(preset: MaterialPreset, kind: type[Material]) -> dict[str, Any]:
    """Those fields of a preset, its name among them, that a model has too.

    Raises
    ------
    SceneError
        Where the model is neither the preset's own nor elastic, neo-hookean or rigid.
    """
    if kind is not type(preset.material) and kind not in _OTHER_MODELS:
        others = ", ".join(f'"{other.kind}"' for other in _OTHER_MODELS)
        raise SceneError(
            f'preset "{preset.name}" cannot be taken as "{kind.kind}", whose numbers mean something else: leave the'
            f" model out, choose one of {others}, or write all numbers without the preset"
        )
    shared = {each.name for each in dataclasses.fields(kind)}
    return {name: value for name, value in {**preset.numbers, "name": preset.name}.items() if name in shared}


def material_preset(name: str, *, model: str | None = None, **numbers: float) -> Material:
    """A material by its name.

    Parameters
    ----------
    name
        "rubber", "steel", ...: `gasp materials` lists them. As of `find_preset`.
    model
        "elastic", "neo-hookean" or "rigid" instead of the preset's own: a statue of steel that does not deform.
    numbers
        Fields of the material instead of the preset's, e.g. ``youngs_modulus=2e6``.

    Raises
    ------
    SceneError
        Where there is no such preset, the model has no such field, or a number is impossible.
    """
    preset = find_preset(name)
    kind = type(preset.material) if model is None else MATERIALS.get(model)
    if kind is None:
        raise SceneError(f'no model is called "{model}": there are {", ".join(MATERIALS)}')
    values: dict[str, Any] = {**numbers_as(preset, kind), **numbers}
    fields = dataclasses.fields(kind)
    known = [each.name for each in fields]
    for key in numbers:
        if key not in known:
            raise SceneError(f'"{key}" is no number of {kind.kind} ("{preset.name}"): there are {", ".join(known)}')
    for each in fields:
        if each.default is dataclasses.MISSING and each.name not in values:
            raise SceneError(f'preset "{preset.name}" has no {each.name}, which {kind.kind} needs: give it')
    return kind(**values)
