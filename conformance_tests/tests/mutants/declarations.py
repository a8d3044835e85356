"""What they declare, and have not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gasp_reference_mpm.plugin import CAPABILITIES

from gasp_core.contract import Elastic, PointProblem, PointState
from mutants.base import Mutant, Session, mutant
from mutants.readings import Showing


@mutant("order-overstated", {"temporal-order": "measured, 3 declared"})
class OrderOverstated(Mutant):
    """Third order is declared."""

    declares = replace(CAPABILITIES, temporal_order=3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Jelly(Elastic):
    """No check can know it."""

    kind = "jelly"


@mutant("jelly-declared", {"material:jelly": "the suite has no check for material:jelly yet"})
class JellyDeclared(Mutant):
    """A material of its own is declared, which nothing shows."""

    right_can = False
    declares = replace(CAPABILITIES, materials=CAPABILITIES.materials | {Jelly})


class Unsure(Showing):
    """The last digit is each session's own."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.noise = np.random.default_rng().integers(-1, 2, self.problem.points.reference_positions.shape)

    def shown(self, state: PointState) -> PointState:
        return replace(state, positions=state.positions + self.noise * np.spacing(state.positions))


class Falling(Mutant):
    """Matter that next to nothing holds together, in empty space."""

    session = Unsure

    def problem(self, problem: PointProblem) -> PointProblem:
        limp = tuple(Elastic(density=one.density, youngs_modulus=1e-9, poissons_ratio=0.0) for one in problem.materials)
        return replace(problem, materials=limp, colliders=(), drives=(), force_fields=())


@mutant(
    "falls-elsewhere",
    {
        "material:elastic[stretch]": "frequency error",
        "collider:plane[outside]": "deepest point",
        "V4[24 cells]": "frequency error",
    },
)
class FallsElsewhere(Mutant):
    """A second device is declared, on which matter falls and does nothing else."""

    declares = replace(CAPABILITIES, devices=("cpu", "moon"))
    device = "moon"

    def open(self, problem: PointProblem, *, device: str, **choices: Any) -> Session:
        return Mutant.open(Falling() if device == self.device else self, problem, device="cpu", **choices)
