"""What engines make of snow that is not its law."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gasp_reference_mpm.constitutive import fixed_corotated_stress
from gasp_reference_mpm.material_points import Matter, Motion, kirchhoff_stress
from gasp_reference_mpm.transfer import Stencil
from numpy.typing import NDArray

from gasp_core.contract import Material, PointProblem, Snow
from mutants.base import Mutant, mutant
from mutants.problems import elastic, with_materials
from mutants.solvers import InsideOut

Array = NDArray[Any]


class OtherSnow(Mutant):
    """Takes the snow of a scene for another one."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: self.made_of(one) if isinstance(one, Snow) else one)

    def made_of(self, snow: Snow) -> Material:
        """The matter it takes a snow for."""
        return snow


@mutant(
    "snow-is-rubber",
    {
        "material:snow[compaction]": "set / the work's",
        "material:snow[confined]": "set / the work's",
        "material:snow[tearing]": "speed left",
    },
)
class SnowIsRubber(OtherSnow):
    """Snow never yields."""

    def made_of(self, snow: Snow) -> Material:
        return elastic(snow, Snow)


@mutant(
    "snow-does-not-harden",
    {"material:snow[compaction]": "set / the work's", "material:snow[tearing]": "speed left"},
)
class SnowDoesNotHarden(OtherSnow):
    """What was pressed together is as stiff as it was, and what was pulled apart as well."""

    def made_of(self, snow: Snow) -> Material:
        return replace(snow, hardening=0.0)


_USUAL = Snow(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0)


@mutant("snow-hardens-as-usual", {"material:snow[compaction]": "set / the work's"})
class SnowHardensAsUsual(OtherSnow):
    """Its hardening is that of the paper's example, whatever is asked for."""

    def made_of(self, snow: Snow) -> Material:
        return replace(snow, hardening=_USUAL.hardening)


@mutant("snow-yields-as-usual", {"material:snow[compaction]": "set / the work's"})
class SnowYieldsAsUsual(OtherSnow):
    """Its critical compression is that of the paper's example, whatever is asked for."""

    def made_of(self, snow: Snow) -> Material:
        return replace(snow, critical_compression=_USUAL.critical_compression)


@mutant("snow-tears-as-usual", {"material:snow[tearing]": "back swing / elastic"})
class SnowTearsAsUsual(OtherSnow):
    """Its critical stretch is that of the paper's example, whatever is asked for."""

    def made_of(self, snow: Snow) -> Material:
        return replace(snow, critical_stretch=_USUAL.critical_stretch)


def _half_hardened_stress(matter: Matter, motion: Motion, stencil: Stencil) -> Array:
    stress = kirchhoff_stress(matter, motion, stencil)
    for material, rows in matter.portions:
        if isinstance(material, Snow):
            at_rest = fixed_corotated_stress(motion.deformations[rows], 0.0, material.lame_lambda)
            hardened = np.exp(material.hardening * (1 - np.exp(motion.history[rows])))
            stress[rows] -= (hardened - 1)[:, None, None] * at_rest
    return stress


@mutant("snow-hardens-in-shear-alone", {"material:snow[confined]": "set / the work's"})
class SnowHardensInShearAlone(InsideOut):
    """Of its two moduli only mu hardens."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.kirchhoff_stress": _half_hardened_stress}


@mutant("snow-a-little-off", {"material:snow[elastic]": "distance from its own law"})
class SnowALittleOff(OtherSnow):
    """Snow is 10 % too stiff."""

    def made_of(self, snow: Snow) -> Material:
        return replace(snow, youngs_modulus=1.1 * snow.youngs_modulus)
