"""The engine: opens sessions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from gasp_blender.bpy_runtime import studio
from gasp_blender.elastic import Elastic
from gasp_blender.impulses import Struck
from gasp_blender.nets import cloth_matter
from gasp_blender.options import BlenderOptions
from gasp_blender.rigid import LONGEST_STEP, RigidBodies, rigid_rows
from gasp_blender.session import BlenderSession
from gasp_blender.spring_model import Matter, elastic_matter
from gasp_blender.warnings_for_users import notices
from gasp_core.contract import EngineAccuracy, PointProblem, Precision
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays

__all__ = ["Blender"]

Array = NDArray[Any]

_CALM = 0.125
"""Of the stable step, on top of `substep_fraction`: a tenth of it in all by default. Blender's scheme damps an
oscillation of angular frequency w at w^2 dt / 4 per unit of time: at the bound itself, what rings at a tenth of the
fastest frequency is gone within three periods."""


class Blender:
    """Blender's simulations behind `gasp_core.contract.PointEngine`.

    Raises
    ------
    EngineEnvironmentError
        Where bpy cannot be imported.
    """

    def __init__(self) -> None:
        studio()

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any = None,
        restart: Mapping[str, Array] | None = None,
    ) -> BlenderSession:
        """Set a problem up, or go on from a checkpoint of it.

        Raises
        ------
        SceneError
            Where a fixed substep is above the stable bound, or the checkpoint is of another problem.
        """
        chosen = options if isinstance(options, BlenderOptions) else BlenderOptions()
        spacing = accuracy.spacing_for(problem.points.size)
        rows = rigid_rows(problem)
        build = cloth_matter if chosen.elastic == "cloth" else elastic_matter
        matters = build(problem, spacing, chosen.voxels)
        told = [*notices(problem, matters, spacing, chosen.voxels)]
        longest = _longest_step(matters, len(rows) > 0, accuracy)
        parts: list[tuple[Array, Elastic | RigidBodies]] = []
        struck = Struck(problem)
        try:
            gusts = (chosen.turbulence, chosen.turbulence_size, seed) if chosen.turbulence else None
            for number, matter in enumerate(matters):
                elastic = Elastic(problem, matter, struck, spacing, gusts, name=f"{number}." if number else "")
                parts.append((matter.rows, elastic))
                told += elastic.told
            if len(rows):
                bodies = RigidBodies(problem, rows, struck, longest)
                parts.append((rows, bodies))
                told += bodies.told
            struck.look_at(parts)
            time = 0.0 if restart is None else _restored(restart, parts)
        except BaseException:
            for _, part in parts:
                part.close()
            raise
        return BlenderSession(problem, parts, longest, accuracy, time, told)


def _longest_step(matters: Sequence[Matter], rigid: bool, accuracy: EngineAccuracy) -> float:
    """Largest substep [s]."""
    bound = min((matter.stable_step for matter in matters), default=math.inf)
    if accuracy.substep is not None:
        if accuracy.substep > bound:
            raise SceneError(
                f"substep under [accuracy], {accuracy.substep:g} s, is above the stable bound of {bound:.3g} s: leave"
                " it out, or lower it"
            )
        if rigid and accuracy.substep > 1:
            raise SceneError(
                f"substep under [accuracy], {accuracy.substep:g} s, is above the 1 s that Bullet bears: lower it"
            )
        return accuracy.substep
    return min(accuracy.substep_fraction * _CALM * bound, LONGEST_STEP if rigid else math.inf)


def _restored(restart: Mapping[str, Array], parts: list[tuple[Array, Elastic | RigidBodies]]) -> float:
    """Set the parts to a checkpoint; its time [s]."""
    time = float(checkpoint_arrays(restart, {"time": ()}, "blender")["time"])
    for _, part in parts:
        part.restore(restart)
    return time
