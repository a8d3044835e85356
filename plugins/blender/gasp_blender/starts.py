"""Matter that starts within a collider: told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import Side

__all__ = ["starts_inside"]

Array = NDArray[Any]


def starts_inside(problem: PointProblem, spacing: float) -> Iterator[str]:
    """One line for each collider that a point starts in, deeper than `spacing` [m]."""
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
        yield f"{what}: they may leave and cannot go deeper; move the object, or the collider, if it is to be outside"
