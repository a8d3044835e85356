"""Snow, which the right engine does not model: an engine that does, and others that make of it what it is not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gasp_reference_mpm.constitution import fixed_corotated_stress
from gasp_reference_mpm.matter import Matter, Motion
from gasp_reference_mpm.plugin import CAPABILITIES
from gasp_reference_mpm.transfer import Stencil
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.materials import Material, Snow
from gasp_core.engine.stability import rest_bound, stiffening
from mutants.base import mutant
from mutants.problems import elastic, with_materials
from mutants.solvers import InsideOut

__all__ = ["RightSnow"]

Array = NDArray[Any]

# Stomakhin et al. 2013 (10.1145/2461912.2461948), section 5, for problems of snow alone. The volume gains of a motion
# hold ln J_P.


def _hardened(material: Snow, volume_gains: Array) -> Array:
    return np.exp(material.hardening * (1 - np.exp(volume_gains)))


def _stress(matter: Matter, motion: Motion, _: Stencil) -> Array:
    stress = np.empty_like(motion.deformations)
    for material, rows in matter.portions:
        at_rest = fixed_corotated_stress(motion.deformations[rows], material.shear_modulus, material.lame_lambda)
        stress[rows] = _hardened(material, motion.volume_gains[rows])[:, None, None] * at_rest
    return stress


def _deformed(matter: Matter, motion: Motion, velocity_gradients: Array, step: float) -> tuple[Array, Array]:
    deformations = motion.deformations + step * velocity_gradients @ motion.deformations
    volume_gains = motion.volume_gains.copy()
    for material, rows in matter.portions:
        left, stretches, right = np.linalg.svd(deformations[rows])
        kept = np.clip(stretches, 1 - material.critical_compression, 1 + material.critical_stretch)
        deformations[rows] = (left * kept[:, None, :]) @ right
        volume_gains[rows] += np.log(stretches / kept).sum(axis=1)
    return deformations, volume_gains


def _stable_step(matter: Matter, motion: Motion, spacing: float) -> float:
    bound = np.inf
    for material, rows in matter.portions:
        growth = stiffening(motion.deformations[rows]) * _hardened(material, motion.volume_gains[rows])
        bound = min(bound, rest_bound(material, spacing) / float(np.sqrt(growth.max())))
    return bound


class RightSnow(InsideOut):
    """Snow as its paper has it."""

    name = "right-snow"
    right_can = False
    declares = replace(CAPABILITIES, materials=frozenset({Snow}))
    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {
        "substep.kirchhoff_stress": _stress,
        "substep.deformed": _deformed,
        "session.stable_step": _stable_step,
    }

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, self.made_of)

    def made_of(self, material: Any) -> Material:
        """The snow it takes a snow for."""
        return material


@mutant(
    "snow-is-rubber",
    {
        "material:snow[compaction]": "set / the work's",
        "material:snow[confined]": "set / the work's",
        "material:snow[tearing]": "speed left",
    },
)
class SnowIsRubber(RightSnow):
    """Snow never yields."""

    session = RightSnow.session
    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {}

    def made_of(self, material: Any) -> Material:
        return elastic(material, Snow)


@mutant(
    "snow-does-not-harden",
    {"material:snow[compaction]": "set / the work's", "material:snow[tearing]": "speed left"},
)
class SnowDoesNotHarden(RightSnow):
    """What was pressed together is as stiff as it was, and what was pulled apart as well."""

    def made_of(self, material: Any) -> Material:
        return replace(material, hardening=0.0)


_USUAL = Snow(density=1.0, youngs_modulus=1.0, poissons_ratio=0.0)


@mutant("snow-hardens-as-usual", {"material:snow[compaction]": "set / the work's"})
class SnowHardensAsUsual(RightSnow):
    """Its hardening is that of the paper's example, whatever is asked for."""

    def made_of(self, material: Any) -> Material:
        return replace(material, hardening=_USUAL.hardening)


@mutant("snow-yields-as-usual", {"material:snow[compaction]": "set / the work's"})
class SnowYieldsAsUsual(RightSnow):
    """Its critical compression is that of the paper's example, whatever is asked for."""

    def made_of(self, material: Any) -> Material:
        return replace(material, critical_compression=_USUAL.critical_compression)


@mutant("snow-tears-as-usual", {"material:snow[tearing]": "back swing / elastic"})
class SnowTearsAsUsual(RightSnow):
    """Its critical stretch is that of the paper's example, whatever is asked for."""

    def made_of(self, material: Any) -> Material:
        return replace(material, critical_stretch=_USUAL.critical_stretch)


def _half_hardened_stress(matter: Matter, motion: Motion, _: Stencil) -> Array:
    stress = np.empty_like(motion.deformations)
    for material, rows in matter.portions:
        shear = fixed_corotated_stress(motion.deformations[rows], material.shear_modulus, 0.0)
        volume = fixed_corotated_stress(motion.deformations[rows], 0.0, material.lame_lambda)
        stress[rows] = _hardened(material, motion.volume_gains[rows])[:, None, None] * shear + volume
    return stress


@mutant("snow-hardens-in-shear-alone", {"material:snow[confined]": "exp"})
class SnowHardensInShearAlone(RightSnow):
    """Of its two moduli only mu hardens."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {
        **RightSnow.wrong,
        "substep.kirchhoff_stress": _half_hardened_stress,
    }


@mutant("snow-a-little-off", {"material:snow[elastic]": "distance from its own law"})
class SnowALittleOff(RightSnow):
    """Snow is 10 % too stiff."""

    def made_of(self, material: Any) -> Material:
        return replace(material, youngs_modulus=1.1 * material.youngs_modulus)
