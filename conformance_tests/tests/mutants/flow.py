"""What engines make of metal, plasticine and foam that is not their law."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gasp_reference_mpm.constitutive import logarithmic_strains, viscoplastic_projection
from numpy.typing import NDArray

from gasp_core.contract import Foam, Material, Metal, Plasticine, PointProblem
from mutants.base import Mutant, mutant
from mutants.problems import elastic, with_materials
from mutants.solvers import InsideOut

Array = NDArray[Any]

HARDENING = "material:metal[hardening]"
SOFTENING = "material:plasticine[softening]"
RELAXATION = "material:foam[relaxation]"


class OtherFlow(Mutant):
    """Takes what flows in a scene for something else."""

    kind: ClassVar[type[Material]]

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: self.made_of(one) if isinstance(one, self.kind) else one)

    def made_of(self, given: Any) -> Material:
        """The matter it takes one of its kind for."""
        return given


def _perfect(given: Metal | Plasticine) -> Metal:
    return Metal(
        density=given.density,
        youngs_modulus=given.youngs_modulus,
        poissons_ratio=given.poissons_ratio,
        yield_stress=given.yield_stress,
    )


@mutant("metal-does-not-harden", {HARDENING: "metal that hardens: work lost when pressed"})
class MetalDoesNotHarden(OtherFlow):
    """Metal yields at the stress it yielded at first."""

    kind = Metal

    def made_of(self, given: Metal) -> Material:
        return _perfect(given)


@mutant("metal-softens", {HARDENING: "metal that hardens: work lost when pressed"})
class MetalSoftens(OtherFlow):
    """Hardening has the wrong sign."""

    kind = Metal

    def made_of(self, given: Metal) -> Material:
        lost = given.hardening / given.yield_stress
        return Plasticine(
            density=given.density,
            youngs_modulus=given.youngs_modulus,
            poissons_ratio=given.poissons_ratio,
            yield_stress=given.yield_stress,
            softening=lost,
            # It cannot fall below nothing; all of it, where nothing is lost.
            residual=1e-3 if lost else 1.0,
        )


@mutant("metal-yields-late", {HARDENING: "metal that does not harden: work lost when pressed"})
class MetalYieldsLate(OtherFlow):
    """The length of the deviator is held below the yield stress, which it is sqrt(2/3) of at yield."""

    kind = Metal

    def made_of(self, given: Metal) -> Material:
        return replace(given, yield_stress=math.sqrt(3 / 2) * given.yield_stress)


@mutant("metal-yields-early", {HARDENING: "metal that does not harden: work lost when pressed"})
class MetalYieldsEarly(OtherFlow):
    """The yield stress is multiplied by sqrt(2/3) twice."""

    kind = Metal

    def made_of(self, given: Metal) -> Material:
        return replace(given, yield_stress=math.sqrt(2 / 3) * given.yield_stress)


@mutant("plasticine-does-not-soften", {SOFTENING: "work lost when pressed"})
class PlasticineDoesNotSoften(OtherFlow):
    """Plasticine is metal."""

    kind = Plasticine

    def made_of(self, given: Plasticine) -> Material:
        return _perfect(given)


@mutant("plasticine-softens-to-nothing", {SOFTENING: "work lost on the way back"})
class PlasticineSoftensToNothing(OtherFlow):
    """Softening has no end but 0."""

    kind = Plasticine

    def made_of(self, given: Plasticine) -> Material:
        return replace(given, residual=1e-3)


@mutant("plasticine-softens-at-once", {SOFTENING: "work lost when pressed"})
class PlasticineSoftensAtOnce(OtherFlow):
    """What has yielded is at its residual."""

    kind = Plasticine

    def made_of(self, given: Plasticine) -> Material:
        return replace(given, softening=1e3)


@mutant("plasticine-yields-late", {SOFTENING: "work lost when pressed"})
class PlasticineYieldsLate(OtherFlow):
    """The length of the deviator is held below the yield stress."""

    kind = Plasticine

    def made_of(self, given: Plasticine) -> Material:
        return replace(given, yield_stress=math.sqrt(3 / 2) * given.yield_stress)


@mutant("foam-flows-at-once", {RELAXATION: "foam.*: (relaxation time|work lost when pressed)"})
class FoamFlowsAtOnce(OtherFlow):
    """Foam has no viscosity."""

    kind = Foam

    def made_of(self, given: Foam) -> Material:
        return replace(given, plastic_viscosity=0.0)


@mutant("foam-twice-as-viscous", {RELAXATION: "relaxation time"})
class FoamTwiceAsViscous(OtherFlow):
    """The plastic viscosity is taken for Bingham's, of which it is twice."""

    kind = Foam

    def made_of(self, given: Foam) -> Material:
        return replace(given, plastic_viscosity=2 * given.plastic_viscosity)


@mutant("foam-is-rubber", {RELAXATION: "relaxation time"})
class FoamIsRubber(OtherFlow):
    """Foam with viscosity never flows."""

    kind = Foam

    def made_of(self, given: Foam) -> Material:
        return elastic(given, Foam) if given.plastic_viscosity > 0 else given


@mutant("foam-creeps", {RELAXATION: "foam: length by its swing"})
class FoamCreeps(OtherFlow):
    """Foam with viscosity flows at any stress."""

    kind = Foam

    def made_of(self, given: Foam) -> Material:
        return replace(given, yield_stress=1e-3 * given.yield_stress) if given.plastic_viscosity > 0 else given


def _draining(deformation: Array, mu: float, yield_stress: float, viscosity: float, step: float) -> Array:
    strains = logarithmic_strains(deformation)
    sizes = np.linalg.norm(strains - strains.mean(axis=1, keepdims=True), axis=1)
    yields = 2 * mu * sizes > math.sqrt(2 / 3) * yield_stress
    drained = viscoplastic_projection(deformation, mu, 0.0, viscosity, step)
    return np.where(yields[:, None, None] & (viscosity > 0), drained, deformation)


@mutant("foam-drains", {RELAXATION: "foam: work lost when pressed"})
class FoamDrains(InsideOut):
    """Where foam yields all of its shear stress flows off, not what is above."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"material_points.viscoplastic_projection": _draining}
