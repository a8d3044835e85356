"""How matter rings on."""

from __future__ import annotations

import math
from dataclasses import replace

from gasp_core.contract import Elastic, Material, NeoHookean, PointProblem
from mutants.base import Mutant, mutant


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
