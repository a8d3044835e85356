"""Matter that starts within a collider: refused, or, where it is a few stray points of a splat, told."""

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

_STRAY = 0.01
"""Share of a body's mass that contact puts onto the surface at once; more of it there would crush the body."""


def starts_inside(problem: PointProblem, spacing: float, rigid: Array) -> Iterator[str]:
    """One line for each collider that a stray point starts in, deeper than `spacing` [m].

    Parameters
    ----------
    rigid
        Rows of points of rigid bodies, of which no point is stray: it is a corner of a hull.

    Raises
    ------
    SceneError
        Where a body starts inside.
    """
    points = problem.points
    masses = problem.masses
    bodies = np.unique(points.body_ids, return_inverse=True)[1].reshape(-1)
    whole = np.bincount(bodies, masses)
    for number, collider in enumerate(problem.colliders, start=1):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        depth = -sign * collider.shape.signed_distance(points.reference_positions)
        inside = depth > spacing
        if not inside.any():
            continue
        what = (
            f"{int(inside.sum())} point(s), first {int(np.argmax(inside))}, start up to {depth.max():.3g} m inside"
            f" collider {number}"
        )
        share = np.bincount(bodies, masses * inside) / whole
        if inside[rigid].any() or share.max() > _STRAY:
            raise SceneError(f"{what}: move the object, or the collider")
        yield f"{what}: contact puts them onto its surface at once; move the object if it starts with a jerk"
