"""What they declare, and have not."""

from __future__ import annotations

from dataclasses import replace

from gasp_reference_mpm.plugin import CAPABILITIES

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.materials import Snow
from mutants.base import Mutant, mutant
from mutants.problems import elastic, with_materials


@mutant("order-overstated", {"temporal-order": "measured, 3 declared"})
class OrderOverstated(Mutant):
    """Third order is declared."""

    declares = replace(CAPABILITIES, temporal_order=3.0)


@mutant("snow-is-rubber", {"material:snow": "the suite has no check for material:snow yet"})
class SnowIsRubber(Mutant):
    """Snow is declared, and never yields."""

    right_can = False
    declares = replace(CAPABILITIES, materials=CAPABILITIES.materials | {Snow})

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: elastic(one, Snow))
