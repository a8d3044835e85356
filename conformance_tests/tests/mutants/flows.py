"""What engines make of matter that flows far."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
from gasp_reference_mpm.engine import grid_origin
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from mutants.base import mutant
from mutants.solvers import InsideOut

Array = NDArray[Any]


def _forgotten(matter: Any, *_: Any) -> tuple[Array, Array]:
    count = len(matter.flowing)
    return np.zeros((count, 3)), np.zeros((count, 3, 3))


@mutant(
    "steps-forget-flow",
    {
        "material:sand[steps]": "mean height in a quarter",
        "material:plasticine[steps]": "mean height in a quarter",
        "material:foam[steps]": "mean height in a quarter",
    },
    slow=["material:plasticine[steps]", "material:foam[steps]"],
)
class StepsForgetFlow(InsideOut):
    """What the grid does not see of velocities is lost in every step, so that small ones lose more."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.subgrid_velocities": _forgotten}


def _off_the_planes(problem: PointProblem, spacing: float) -> Array:
    return grid_origin(problem, spacing) - spacing / 2


def _crowded(matter: Any, motion: Any, *_: Any) -> Any:
    return motion


@mutant(
    "water-flows-into-walls",
    {"material:fluid[volume]": "mean height off its volume's"},
    slow=["material:fluid[volume]"],
)
class WaterFlowsIntoWalls(InsideOut):
    """The nodes that stop water lie half a cell behind the walls, and nothing is said of points that crowd there."""

    wrong: ClassVar[Mapping[str, Callable[..., Any]]] = {"substep.with_room": _crowded}

    def open(self, problem: PointProblem, **choices: Any) -> Any:
        with patch("gasp_reference_mpm.engine.grid_origin", _off_the_planes):
            return super().open(problem, **choices)
