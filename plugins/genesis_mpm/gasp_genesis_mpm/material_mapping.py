"""Our materials in Genesis' words: which of its classes, or of those in `added_materials`, and its parameters.

A law's stresses are multiplied by a scale, in which a portion's volume is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gasp_core.contract import Elastic, Fluid, Material, Metal, NeoHookean, Sand, Snow

__all__ = ["Law", "law_of", "stiffness_of"]


@dataclass(frozen=True, slots=True)
class Law:
    """One of Genesis' materials.

    Parameters
    ----------
    name
        Of the class in `gasp_genesis_mpm.added_materials`, or else in `genesis.materials.MPM`.
    parameters
        By name, what it is made with.
    """

    name: str
    parameters: tuple[tuple[str, float | str], ...]


def stiffness_of(material: Material) -> float:
    """The modulus [Pa] by which laws are scaled: Young's, or the bulk modulus of a fluid."""
    modulus = getattr(material, "bulk_modulus", None)
    return float(modulus if modulus is not None else getattr(material, "youngs_modulus"))  # noqa: B009


def law_of(material: Material, scale: float) -> Law:
    """The law of a material, with `scale` as a factor on every stress."""
    match material:
        case Elastic():
            return Law("Elastic", (*_moduli(material, scale), ("model", "corotation")))
        case NeoHookean():
            return Law("Elastic", (*_moduli(material, scale), ("model", "neohooken")))
        case Sand():
            return Law("Sand", (*_moduli(material, scale), ("friction_angle", _compression_angle(material))))
        case Snow():
            box = (("yield_lower", material.critical_compression), ("yield_higher", material.critical_stretch))
            return Law("HardeningSnow", (*_moduli(material, scale), *box, ("hardening", material.hardening)))
        case Metal():
            line = (("yield_stress", scale * material.yield_stress), ("hardening", scale * material.hardening))
            return Law("HardeningMetal", (*_moduli(material, scale), *line))
        case Fluid():
            return Law("BarotropicFluid", (("E", scale * material.bulk_modulus), ("nu", 0.0)))
        case _:
            raise AssertionError(f"{material.kind} is not among the declared materials")


def _compression_angle(material: Sand) -> float:
    """The angle [degrees] of which Genesis, whose cone is matched to triaxial compression, makes the same cone."""
    slope = material.friction_slope
    return math.degrees(math.asin(3 * slope / (6 + slope)))


def _moduli(material: Elastic | NeoHookean | Sand | Snow | Metal, scale: float) -> tuple[tuple[str, float], ...]:
    return ("E", scale * material.youngs_modulus), ("nu", material.poissons_ratio)
