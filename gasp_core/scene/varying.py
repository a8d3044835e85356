"""A material whose numbers vary from Gaussian to Gaussian."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from gasp_core.contract import Material
from gasp_core.errors import SceneError
from gasp_core.scene.columns import Column, column_of

__all__ = ["VARYING", "VaryingMaterial", "law_of", "stand_ins"]

VARYING = ("density", "youngs_modulus", "poissons_ratio")
"""Numbers of materials that may vary."""
_STAND_IN = 0.25
"""That every material takes for any of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VaryingMaterial:
    """A material some of whose numbers each Gaussian has for itself.

    Parameters
    ----------
    base
        The material; its own numbers hold for what does not vary, and are forgotten for what does.
    columns
        By name of a number of it, "density", "youngs_modulus" or "poissons_ratio": a path of a ``.npy``, a
        `PlyProperty`, or an array, of a number for each Gaussian of the file, in its order.

    Raises
    ------
    SceneError
        Where nothing varies, or something that this material does not have.
    """

    base: Material
    columns: Mapping[str, Column]

    def __post_init__(self) -> None:
        own = [field.name for field in dataclasses.fields(self.base)]
        allowed = [name for name in VARYING if name in own]
        for name in self.columns:
            if name not in allowed:
                raise SceneError(
                    f"VaryingMaterial.columns: {name} of {self.base.kind} does not vary, {', '.join(allowed)} may"
                )
        if not self.columns:
            raise SceneError("VaryingMaterial.columns is empty: say the material itself")
        object.__setattr__(self, "columns", {name: column_of(value) for name, value in self.columns.items()})
        # What a column replaces decides nothing: scenes that differ in it alone are one.
        object.__setattr__(self, "base", dataclasses.replace(self.base, **stand_ins(self.columns)))

    @classmethod
    def of(cls, kind: type[Material], **numbers: Any) -> VaryingMaterial:
        """`VaryingMaterial.of(Elastic, density=400, youngs_modulus="E.npy", poissons_ratio=0.3)`."""
        plain = {name: value for name, value in numbers.items() if name == "name" or isinstance(value, Real)}
        columns = {name: value for name, value in numbers.items() if name not in plain}
        return cls(base=kind(**plain, **stand_ins(columns)), columns=columns)


def stand_ins(names: Mapping[str, Any]) -> dict[str, Any]:
    """A number for each of what varies, so that the rest of a material can be checked without them."""
    return dict.fromkeys(names, _STAND_IN)


def law_of(material: Material | VaryingMaterial) -> Material:
    """The material itself, whatever of it varies."""
    return material.base if isinstance(material, VaryingMaterial) else material
