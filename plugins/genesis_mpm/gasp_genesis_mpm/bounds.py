"""How large a substep the points bear as they are deformed now, and how they may move in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.materials import Snow
from gasp_core.engine.stability import rest_bound, snow_stiffening, stiffening
from gasp_genesis_mpm.motion import Motion
from gasp_genesis_mpm.portions import Portion

__all__ = ["stable_step"]

Array = NDArray[Any]


def stable_step(problem: PointProblem, portions: tuple[Portion, ...], motion: Motion, spacing: float) -> float:
    """Largest stable substep [s], of the point that bears least.

    A point whose volume is less than that of its portion is as stiff as the portion and lighter: its step is shorter by
    the root of the ratio. Fluids stiffen as solids do, in Genesis by 2 J^2 - J.
    """
    volumes = problem.points.reference_volumes
    bound = np.inf
    for portion in portions:
        rows = portion.rows
        growth = stiffening(motion.deformations[rows])
        if isinstance(portion.material, Snow):
            with np.errstate(divide="ignore", invalid="ignore"):
                hardened = np.log(np.maximum(motion.history[rows], 1e-300))
            growth = growth * snow_stiffening(hardened, portion.material.hardening)
        lightness = portion.volume / volumes[rows]
        bound = min(bound, rest_bound(portion.material, spacing) / float(np.sqrt((growth * lightness).max())))
    return bound
