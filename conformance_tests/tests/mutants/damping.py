"""How matter rings on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gasp_conformance.observables import angular_momentum
from numpy.typing import NDArray

from gasp_core.contract import Elastic, Material, NeoHookean, PointProblem, StepReport
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


def _damped(material: Material, mass: float, stiffness: float) -> Material:
    if not isinstance(material, Elastic | NeoHookean):
        return material
    return replace(
        material,
        mass_damping=mass * material.mass_damping,
        stiffness_damping=stiffness * material.stiffness_damping,
    )


@mutant(
    "rings-on", {"material-damping[mass-elastic]": "closed form", "material-damping[mass-neo-hookean]": "closed form"}
)
class RingsOn(Mutant):
    """Damping in proportion to mass is not heard."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, materials=tuple(_damped(each, 0.0, 1.0) for each in problem.materials))


@mutant(
    "damped-by-the-turn",
    {
        "material-damping[stiffness-elastic]": "closed form",
        "material-damping[stiffness-neo-hookean]": "closed form",
        "material-damping[volume-elastic]": "closed form",
        "material-damping[volume-neo-hookean]": "closed form",
    },
)
class DampedByTheTurn(Mutant):
    """Damping in proportion to stiffness is taken for one of hertz, where it is one of radians a second."""

    def problem(self, problem: PointProblem) -> PointProblem:
        turned = tuple(_damped(each, 1.0, 1 / (2 * math.pi)) for each in problem.materials)
        return replace(problem, materials=turned)


class GivingBack(Session):
    """Takes from what is damped by mass what that did to its motion as one, every hundredth of a second."""

    EVERY: ClassVar[float] = 0.01
    WAY: ClassVar[bool] = False
    SPIN: ClassVar[bool] = False

    def advance_to(self, time: float) -> StepReport:
        rates = np.array([getattr(one, "mass_damping", 0.0) for one in self.problem.materials])
        owned = rates[self.problem.points.material_ids]
        if not owned.any():
            return super().advance_to(time)
        reports: list[StepReport] = []
        while self.time < time:
            begun = self.time
            reports.append(super().advance_to(min(begun + self.EVERY, time)))
            state = self.inner.checkpoint()
            velocities = state["velocities"].copy()
            for body in np.unique(self.problem.points.body_ids[owned > 0]):
                rows = self.problem.points.body_ids == body
                gained = math.expm1(float(owned[rows].mean()) * (self.time - begun))
                velocities[rows] += gained * self._of_one(rows, state["positions"][rows], velocities[rows])
            self.change(velocities=velocities)
        if not reports:
            return super().advance_to(time)
        return replace(reports[-1], substep_count=sum(one.substep_count for one in reports))

    def _of_one(self, rows: Array, places: Array, velocities: Array) -> Array:
        """The motion (N, 3) [m/s] as one that is given back."""
        masses = self.problem.masses[rows]
        arms = places - masses @ places / masses.sum()
        out = np.zeros_like(velocities)
        if self.WAY:
            out += masses @ velocities / masses.sum()
        if self.SPIN:
            squares = arms.T @ (masses[:, None] * arms)
            inertia = np.trace(squares) * np.eye(3) - squares
            out += np.cross(np.linalg.solve(inertia, angular_momentum(masses, places, velocities)), arms)
        return out


class FlyingOn(GivingBack):
    WAY = True


@mutant(
    "flies-on",
    {
        "material-damping[flight-elastic]": "mass, flight: centre",
        "material-damping[flight-neo-hookean]": "mass, flight: centre",
    },
)
class FliesOn(Mutant):
    """Damping in proportion to mass is heard within a body, and takes nothing of its momentum."""

    session = FlyingOn


class TurningOn(GivingBack):
    SPIN = True


@mutant("turns-on", {"material-damping[flight-elastic]": "mass, flight: spin"})
class TurnsOn(Mutant):
    """Damping in proportion to mass takes nothing of a body's spin."""

    session = TurningOn


class Fading(GivingBack):
    WAY = SPIN = True

    def advance_to(self, time: float) -> StepReport:
        report = Session.advance_to(self, time)
        state = self.inner.checkpoint()
        velocities = state["velocities"].copy()
        for body in np.unique(self.problem.points.body_ids):
            rows = self.problem.points.body_ids == body
            as_one = self._of_one(rows, state["positions"][rows], velocities[rows])
            velocities[rows] = as_one + 0.9995**report.substep_count * (velocities[rows] - as_one)
        self.change(velocities=velocities)
        return report


@mutant("vibrations-fade", {"ringing": "rate of decay - declared"})
class VibrationsFade(Mutant):
    """All that is not the motion of a body as one is .9995 of what it was after every step."""

    session = Fading


@mutant(
    "drags-by-stiffness",
    {
        "material-damping[flight-elastic]": "stiffness, flight: centre",
        "material-damping[flight-neo-hookean]": "stiffness, flight: centre",
    },
)
class DragsByStiffness(Mutant):
    """Damping in proportion to stiffness resists velocities, where it is how these differ that it should resist."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, materials=tuple(_dragged(each) for each in problem.materials))


def _dragged(material: Material) -> Material:
    if not isinstance(material, Elastic | NeoHookean):
        return material
    return replace(material, mass_damping=material.mass_damping + 10.0 * material.stiffness_damping)
