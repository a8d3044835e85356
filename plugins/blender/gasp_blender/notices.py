"""What a user has to be told of a scene before it moves, as nothing in the picture says it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gasp_blender.matter import Matter
from gasp_core.engine.contract import PointProblem

__all__ = ["notices"]


def notices(problem: PointProblem, matter: Matter | None, spacing: float, most_voxels: int) -> Iterator[str]:
    """One line each.

    Parameters
    ----------
    matter
        Of the elastic bodies; None where there are none.
    spacing
        Voxel size asked for [m].
    most_voxels
        In the cage of a body.
    """
    if matter is None:
        return
    if matter.cage.coarseness > 1:
        yield (
            f"a cage has voxels of {matter.cage.coarseness * spacing:.3g} m instead of the {spacing:.3g} m of the"
            f" resolution, as it may have {most_voxels}: raise the option voxels, or lower the resolution"
        )
    bodies = len(np.unique(problem.points.body_ids))
    if bodies > 1:
        yield (
            f"blender's elastic bodies touch colliders alone: the {bodies} bodies of this scene pass through each other"
            " where one of the two is elastic; keep them apart, or use another engine"
        )
