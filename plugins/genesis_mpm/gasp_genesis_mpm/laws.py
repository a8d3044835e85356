"""Our materials in Genesis' words: which of its classes, and with what parameters.

A law's stresses are multiplied by a scale, in which a portion's volume is. What Genesis' law cannot say is refused here
and not approximated in silence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gasp_core.engine.materials import Elastic, Fluid, Material, Metal, NeoHookean, Sand, Snow
from gasp_core.errors import SceneError

__all__ = ["SNOW_HARDENING", "Law", "law_of", "refuse_unknown", "stiffness_of"]

SNOW_HARDENING = 10.0
"""xi of Genesis' snow, a number in its source."""


@dataclass(frozen=True, slots=True)
class Law:
    """One of Genesis' materials.

    Parameters
    ----------
    name
        Of the class in `genesis.materials.MPM`.
    parameters
        By name, what it is made with.
    """

    name: str
    parameters: tuple[tuple[str, float | bool | str], ...]


def stiffness_of(material: Material) -> float:
    """The modulus [Pa] by which laws are scaled: Young's, or the bulk modulus of a fluid."""
    modulus = getattr(material, "bulk_modulus", None)
    return float(modulus if modulus is not None else getattr(material, "youngs_modulus"))  # noqa: B009


def refuse_unknown(material: Material) -> None:
    """Refuse what Genesis' law of a material has no parameter for.

    Raises
    ------
    SceneError
        Naming the parameter, and what it would have to be.
    """
    if isinstance(material, Snow) and material.hardening != SNOW_HARDENING:
        raise SceneError(
            f"genesis-mpm hardens snow by {SNOW_HARDENING:g} alone, found Snow.hardening {material.hardening:g}:"
            f" leave it at {SNOW_HARDENING:g}, or use another engine"
        )
    if isinstance(material, Metal) and material.hardening != 0.0:
        raise SceneError(
            f"genesis-mpm knows no metal that hardens, found Metal.hardening {material.hardening:g}:"
            " leave it at 0, or use another engine"
        )


def law_of(material: Material, scale: float, step: float) -> Law:
    """Genesis' law of a material.

    Parameters
    ----------
    material
        One of the declared ones, with nothing in it that `refuse_unknown` refuses.
    scale
        Factor on every stress.
    step
        Substep [s] it is made for. Only a viscous fluid depends on it: Genesis shears one elastically within a substep
        and then forgets, 2 mu dt sym(grad v), so that a viscosity eta is a shear modulus eta / dt. That modulus resists
        dilation as well, and is taken off the bulk modulus, to first order in the dilation.
    """
    match material:
        case Elastic():
            return Law("Elastic", (*_moduli(material, scale), ("model", "corotation")))
        case NeoHookean():
            return Law("Elastic", (*_moduli(material, scale), ("model", "neohooken")))
        case Sand():
            return Law("Sand", (*_moduli(material, scale), ("friction_angle", material.friction_angle)))
        case Snow():
            box = (("yield_lower", material.critical_compression), ("yield_higher", material.critical_stretch))
            return Law("Snow", (*_moduli(material, scale), *box))
        case Metal():
            # Genesis bounds |dev tau| itself, we sqrt(3/2) of it.
            bound = math.sqrt(2 / 3) * material.yield_stress * scale
            return Law(
                "ElastoPlastic",
                (*_moduli(material, scale), ("use_von_mises", True), ("von_mises_yield_stress", bound)),
            )
        case Fluid():
            shear = material.viscosity / step
            return Law(
                "Liquid",
                (
                    # Not used where Lame's parameters are given.
                    ("E", scale * material.bulk_modulus),
                    ("nu", 0.0),
                    ("lam", scale * (material.bulk_modulus - 2 * shear / 3)),
                    ("mu", scale * shear),
                    ("viscous", shear > 0),
                ),
            )
        case _:
            raise AssertionError(f"{material.kind} is not among the declared materials")


def _moduli(material: Elastic | NeoHookean | Sand | Snow | Metal, scale: float) -> tuple[tuple[str, float], ...]:
    return ("E", scale * material.youngs_modulus), ("nu", material.poissons_ratio)
