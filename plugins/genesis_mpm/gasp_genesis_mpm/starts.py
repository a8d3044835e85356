"""Matter that starts within a collider: refused, or, where it is a few stray points of a splat, told."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import Side
from gasp_core.errors import SceneError

__all__ = ["starts_inside"]

_DEPTH = 0.5
"""In cells: how far inside a collider a point may start. Walls act at nodes, and nodes are felt no finer."""
_STRAY = 0.01
"""Share of a body's mass that may be held in a wall: it weighs on the rest no more than that."""


def starts_inside(problem: PointProblem, spacing: float) -> Iterator[str]:
    """One line for each collider that a few points start in: Genesis holds them where they are, on a grid of `spacing`.

    Raises
    ------
    SceneError
        Where more of a body starts inside.
    """
    points, masses = problem.points, problem.masses
    bodies = np.unique(points.body_ids, return_inverse=True)[1].reshape(-1)
    whole = np.bincount(bodies, masses)
    for number, collider in enumerate(problem.colliders, start=1):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        depth = -sign * collider.shape.signed_distance(points.reference_positions)
        inside = depth > _DEPTH * spacing
        if not inside.any():
            continue
        share = float((np.bincount(bodies, masses * inside) / whole).max())
        what = (
            f"{int(inside.sum())} point(s), the deepest is point {int(depth.argmax())}, start up to {depth.max():.3g} m"
            f" inside collider {number} ({collider.shape.kind})"
        )
        if share > _STRAY:
            raise SceneError(f"{what}, {share:.3g} of a body's mass: move the object or the collider")
        yield f"{what}: they are held there; move the object if that shows"
