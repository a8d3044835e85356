"""What a user has to be told of a scene before it moves, as nothing in the picture says it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gasp_blender.spring_model import Matter
from gasp_core.contract import PointProblem

__all__ = ["notices"]


def notices(problem: PointProblem, matters: Sequence[Matter], spacing: float, most_voxels: int) -> Iterator[str]:
    """One line each.

    Parameters
    ----------
    matters
        Of the elastic bodies.
    spacing
        Voxel size asked for [m].
    most_voxels
        In the cage of a body.
    """
    if not matters:
        return
    coarseness = max(matter.cage.coarseness for matter in matters)
    if coarseness > 1:
        yield (
            f"a cage has voxels of {coarseness * spacing:.3g} m instead of the {spacing:.3g} m of the"
            f" resolution, as it may have {most_voxels}: raise the option voxels, or lower the resolution"
        )
    kinds = {type(problem.materials[number]) for number in np.unique(problem.points.material_ids)}
    if len(kinds) > 1:
        yield (
            "blender's elastic bodies and its rigid ones pass through each other: keep them apart, make all of one"
            " kind, or use another engine"
        )
    if matters[0].is_cloth and len(matters) > 1:
        yield "sheets of blender's cloth pass through each other: keep them apart, or use elastic = cage"
