"""What they compute: a law, or a transfer, is wrong inside."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
from gasp_reference_mpm.boundary import collided
from gasp_reference_mpm.material_points import deformed
from gasp_reference_mpm.transfer import gather
from numpy.typing import NDArray

from gasp_core.contract import Collider, Drive, EngineAccuracy, StepReport
from gasp_core.stepping.forcing import prescribed_velocities
from gasp_core.stepping.time_step import MotionLimits
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


class Inside(Session):
    """Runs with functions of the right engine replaced."""

    def advance_to(self, time: float) -> StepReport:
        with ExitStack() as stack:
            for target, replacement in self.engine.wrong.items():
                stack.enter_context(patch(f"gasp_reference_mpm.{target}", replacement))
            return super().advance_to(time)


class InsideOut(Mutant):
    """With functions of its own inside."""

    session = Inside
    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {}


def _as_it_flows(velocities: Array, *_: Any) -> Array:
    return velocities


@mutant(
    "sinks-into-floors",
    {"material:sand[floor]": "surface below it", "material:fluid[floor]": "lowest percent below it"},
    slow=["material:sand[floor]"],
)
class SinksIntoFloors(InsideOut):
    """Points go with the splines, which reach half a cell behind a wall."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.kept_out": _as_it_flows}


def _linear_stress(deformation: Array, mu: float, lame: float) -> Array:
    strain = (deformation + deformation.swapaxes(1, 2)) / 2 - np.eye(3)
    stress = 2 * mu * strain + lame * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return stress @ deformation.swapaxes(1, 2)


def _along_tangents(drive: Drive, time: float, step: float, places: Array) -> Array:
    return prescribed_velocities(drive, time, 0.0, places)


@mutant("drives-along-tangents", {"drive:driven": "error after turns"})
class DrivesAlongTangents(InsideOut):
    """What is driven round has the velocity of the moment at which a substep begins."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"boundary.prescribed_velocities": _along_tangents}


def _counted_once(problem: Any, drives: Any, time: float, positions: Array, *_: Any) -> Array:
    return np.ones(len(positions))


@mutant(
    "clamps-give-way",
    {"V7[K=2, clamped between nodes]": "drop of the tip error"},
    slow=["V7[K=2, clamped between nodes]"],
)
class ClampsGiveWay(InsideOut):
    """What is held counts once, and the splines of the first free node reach into it."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"session.firmness": _counted_once}


@mutant("small-strains", {"conserved:angular_momentum": "relative change"})
class SmallStrains(InsideOut):
    """Elasticity is that of small strains: what turns is taken to be strained."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"material_points.fixed_corotated_stress": _linear_stress}


def _pulling_stress(deformation: Array, velocity_gradient: Array, bulk_modulus: float, viscosity: float) -> Array:
    ratio = deformation[:, 0, 0] ** 3
    rate = velocity_gradient + velocity_gradient.swapaxes(1, 2)
    return ratio[:, None, None] * viscosity * rate - (ratio * bulk_modulus / 7 * (ratio**-7 - 1))[
        :, None, None
    ] * np.eye(3)


@mutant("fluid-pulls", {"material:fluid[no tension]": "way not gone where nothing holds"})
class FluidPulls(InsideOut):
    """A fluid bears tension."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"material_points.fluid_stress": _pulling_stress}


def _transposing_gather(*arguments: Any) -> tuple[Array, ...]:
    velocities, *gradients = gather(*arguments)
    return velocities, *(np.ascontiguousarray(each.swapaxes(1, 2)) for each in gradients)


@mutant("affine-transposed", {"field:deformation_gradients": r"from I \+ A t", "V8[8 cells]": "spin kept"})
class AffineTransposed(InsideOut):
    """The gradient of the velocity is transposed."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.gather": _transposing_gather}


def _flat_gather(*arguments: Any) -> tuple[Array, ...]:
    velocities, *gradients = gather(*arguments)
    return velocities, *(each * [1.0, 1.0, 0.0] for each in gradients)


@mutant(
    "third-axis-forgotten",
    {"V16[quarter turn about y]": "distance / size", "field:deformation_gradients": r"from I \+ A t"},
    slow=["V16[quarter turn about y]"],
)
class ThirdAxisForgotten(InsideOut):
    """A plane solver was given a third axis, along which velocities have no gradient."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.gather": _flat_gather}


def _unmet(
    problem: Any, stencil: Any, grid: Any, velocities: Array, held: Any, separation: Any, *_: Any
) -> tuple[Array, Any]:
    return velocities, separation


@mutant("ghosts", {"bodies-meet": "velocity exchanged, relative", "V10[32 cells]": "the bars did not touch"})
class Ghosts(InsideOut):
    """Bodies go through each other."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.met": _unmet}


def _in_single_precision(*arguments: Any) -> tuple[Array, Array]:
    deformations, history = deformed(*arguments)
    return deformations.astype(np.float32).astype(np.float64), history


@mutant("gradients-in-single-precision", {"slow-load": "strain by F / by places"})
class GradientsInSinglePrecision(InsideOut):
    """F is kept in float32, beside 1."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.deformed": _in_single_precision}


def _whatever(*_: Any) -> None:
    return None


def _no_shock(matter: Any, *_: Any) -> Array:
    return np.zeros(len(matter.masses))


@mutant("crushed-and-well", {"impact[elastic]": "thickness / side|share of points crushed"})
class CrushedAndWell(InsideOut):
    """Nothing stops a shock, and matter that is flat and without energy is as good as any."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {
        "session.ReferenceSession.refuse_crushed": _whatever,
        "substep.shock_pressures": _no_shock,
    }


def _step_of_stiffness(limits: MotionLimits, spacing: float, accuracy: EngineAccuracy) -> float:
    return accuracy.substep or accuracy.substep_fraction * limits.stress


@mutant("steps-by-stiffness-alone", {"speed": r"a block in walls: ended with non_finite: point \d+ crosses"})
class StepsByStiffnessAlone(InsideOut):
    """However fast matter is, steps are as long as its stiffness bears."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"session.substep_size": _step_of_stiffness}


def _braked(
    velocities: Array, places: Array, colliders: Sequence[Collider], time: float, step: float, spacing: float
) -> Array:
    return 0.9 * velocities + 0.1 * collided(velocities, places, colliders, time, step, spacing)


@mutant("walls-brake", {"speed": r"points beyond \[m\]"})
class WallsBrake(InsideOut):
    """A wall takes a tenth a substep of the velocity into it, which stops what is slow."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.collided": _braked}


def _stress_with_another_volume_term(deformation: Array, mu: float, lame: float) -> Array:
    ratio = np.linalg.det(deformation)
    shear = mu * (deformation @ deformation.swapaxes(1, 2) - np.eye(3))
    return shear + (lame * (ratio - 1) * ratio)[:, None, None] * np.eye(3)


@mutant("another-volume-term", {"V17": "distance / amplitude is"})
class AnotherVolumeTerm(InsideOut):
    """Neo-Hookean matter has lambda (J - 1)^2 / 2 in its energy, where the law has lambda (ln J)^2 / 2."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {
        "material_points.neo_hookean_stress": _stress_with_another_volume_term
    }
