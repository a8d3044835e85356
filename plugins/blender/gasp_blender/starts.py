"""Matter that starts within a collider: told, or, where it is rigid, refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import Side
from gasp_core.errors import SceneError

__all__ = ["starts_inside"]

Array = NDArray[Any]


def starts_inside(problem: PointProblem, spacing: float, rigid: Array) -> Iterator[str]:
    """One line for each collider that a point starts in, deeper than `spacing` [m].

    Parameters
    ----------
    rigid
        Rows of points of rigid bodies.

    Raises
    ------
    SceneError
        Where a rigid body starts inside: Bullet would throw it out.
    """
    positions = problem.points.reference_positions
    for number, collider in enumerate(problem.colliders, start=1):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        depth = -sign * collider.shape.signed_distance(positions)
        inside = depth > spacing
        if not inside.any():
            continue
        what = (
            f"{int(inside.sum())} point(s), first {int(np.argmax(inside))}, start up to {depth.max():.3g} m inside"
            f" collider {number}"
        )
        if inside[rigid].any():
            raise SceneError(f"{what}, and a body among them is rigid: move the object, or the collider")
        yield f"{what}: they may leave and cannot go deeper; move the object, or the collider, if it is to be outside"
