"""The engine: opens sessions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.elastic import CALM, Elastic
from gasp_blender.matter import elastic_matter
from gasp_blender.options import BlenderOptions
from gasp_blender.session import BlenderSession, Part
from gasp_blender.studio import studio
from gasp_core.engine.contract import EngineAccuracy, PointProblem, Precision
from gasp_core.errors import SceneError

__all__ = ["Blender"]

Array = NDArray[Any]


class Blender:
    """Blender's simulations behind `gasp_core.engine.contract.PointEngine`.

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
        spacing = accuracy.spacing_for(problem.points)
        matter = elastic_matter(problem, spacing, chosen.voxels)
        bound = matter.stable_step
        if accuracy.substep is not None and accuracy.substep > bound:
            raise SceneError(
                f"a substep of {accuracy.substep:g} s is above the stable bound of {bound:.3g} s: leave substep out, or"
                " lower it"
            )
        longest = accuracy.substep or accuracy.substep_fraction * CALM * bound
        if restart is not None and np.shape(restart.get("time", "nothing")) != ():
            raise SceneError("the checkpoint has no time")
        elastic = Elastic(problem, matter, spacing)
        parts: list[tuple[Array, Part]] = [(matter.rows, elastic)]
        time = 0.0
        if restart is not None:
            try:
                if "time" not in restart:
                    raise SceneError("the checkpoint holds no time: it belongs to another engine; start the run anew")
                elastic.restore(restart)
                time = float(restart["time"])
            except BaseException:
                elastic.close()
                raise
        return BlenderSession(problem, parts, longest, accuracy, time, ())
