"""How large a substep the points bear as they are deformed now, and how they may move in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Fluid, Material, Metal, PointProblem, Snow
from gasp_core.stepping.stiffening import hencky_stiffening, snow_stiffening, stiffening
from gasp_genesis_mpm.particle_state import Motion
from gasp_genesis_mpm.rest_step import rest_step
from gasp_genesis_mpm.stiffness_groups import Portion

__all__ = ["stable_step"]

Array = NDArray[Any]


def stable_step(problem: PointProblem, portions: tuple[Portion, ...], motion: Motion, spacing: float) -> float:
    """Largest stable substep [s], of the point that bears least.

    A point whose volume is less than that of its portion is as stiff as the portion and lighter: its step is shorter by
    the root of the ratio.
    """
    volumes = problem.points.reference_volumes
    bound = np.inf
    for portion in portions:
        rows = portion.rows
        growth = _growth(portion.material, motion.deformations[rows], motion.history[rows])
        lightness = portion.volume / volumes[rows]
        bound = min(bound, rest_step(portion.material, spacing) / float(np.sqrt((growth * lightness).max())))
    return bound


def _growth(material: Material, deformations: Array, history: Array) -> Array:
    """Factors (n,) by which points are stiffer than at rest, of F (n, 3, 3) and Genesis' Jp (n,)."""
    match material:
        case Fluid():
            # Cole's pressure stiffens with J^-6 under compression; one power more each way leaves room for a cycle.
            return np.maximum(stiffening(deformations), np.linalg.det(deformations) ** -8)
        case Metal():
            return hencky_stiffening(deformations)
        case Snow():
            hardened = np.log(np.maximum(history, 1e-300))
            return stiffening(deformations) * snow_stiffening(hardened, material.hardening)
        case _:
            return stiffening(deformations)
