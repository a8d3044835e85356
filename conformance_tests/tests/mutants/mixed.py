"""Bodies of several materials, and numbers that vary from point to point."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gasp_reference_mpm.plugin import CAPABILITIES

from gasp_core.contract import PointProblem
from mutants.base import Mutant, mutant


def _as_the_first(problem: PointProblem, *names: str) -> PointProblem:
    """Every point has these numbers of the first point of its body, as far as its material has them."""
    points = problem.points
    bodies, firsts = np.unique(points.body_ids, return_index=True)
    ids = points.material_ids.copy()
    materials: list[Any] = []
    for body, first in zip(bodies, firsts):
        model = problem.materials[points.material_ids[first]]
        for row in np.unique(points.material_ids[points.body_ids == body]):
            own = problem.materials[row]
            taken = {name: getattr(model, name) for name in names if hasattr(model, name) and hasattr(own, name)}
            ids[(points.body_ids == body) & (points.material_ids == row)] = len(materials)
            materials.append(replace(own, **taken))
    return replace(problem, points=replace(points, material_ids=ids), materials=tuple(materials))


@mutant("first-stiffness-of-a-body", {"material:elastic[two stiffnesses]": "frequency error"})
class FirstStiffnessOfABody(Mutant):
    """A body is as stiff everywhere as where its first point is."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _as_the_first(problem, "youngs_modulus", "poissons_ratio")


@mutant(
    "first-poissons-ratio-of-a-body",
    {
        "material:elastic[two stiffnesses]": "narrowing by stretch of the second half",
        "material:neo-hookean[two stiffnesses]": "narrowing by stretch of the second half",
    },
)
class FirstPoissonsRatioOfABody(Mutant):
    """A body has the Poisson's ratio of its first point everywhere."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _as_the_first(problem, "poissons_ratio")


@mutant(
    "ends-of-a-body-swapped",
    {"material:elastic[two stiffnesses]": "stretch of the second half"},
)
class EndsOfABodySwapped(Mutant):
    """Points are sorted, and their materials are not: those of a body are the wrong way round."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, points=replace(problem.points, material_ids=problem.points.material_ids[::-1]))


class ByColumns(Mutant):
    """Numbers that vary from point to point are as many materials; one of them is not heard."""

    right_can = False
    declares = replace(CAPABILITIES, material_columns=frozenset({"density", "youngs_modulus", "poissons_ratio"}))
    deaf: ClassVar[str]

    def problem(self, problem: PointProblem) -> PointProblem:
        points = problem.points
        names = [name for name in points.material_columns if name != self.deaf]
        table = np.stack([points.material_ids, *(problem.material_values(name) for name in names)], axis=1)
        rows, ids = np.unique(table, axis=0, return_inverse=True)
        materials = [
            replace(problem.materials[int(row)], **dict(zip(names, map(float, values)))) for row, *values in rows
        ]
        return replace(
            problem,
            points=replace(points, material_ids=ids.reshape(-1), material_columns={}),
            materials=tuple(materials),
        )


@mutant("columns-of-density-ignored", {"material-column:density": "frequency error"})
class ColumnsOfDensityIgnored(ByColumns):
    """Columns are declared, and those of densities are not heard."""

    deaf = "density"


@mutant("columns-of-stiffness-ignored", {"material-column:youngs_modulus": "frequency error"})
class ColumnsOfStiffnessIgnored(ByColumns):
    """Columns are declared, and those of Young's modulus are not heard."""

    deaf = "youngs_modulus"


@mutant("columns-of-poissons-ratio-ignored", {"material-column:poissons_ratio": "narrowing by stretch of the second"})
class ColumnsOfPoissonsRatioIgnored(ByColumns):
    """Columns are declared, and those of Poisson's ratio are not heard."""

    deaf = "poissons_ratio"
