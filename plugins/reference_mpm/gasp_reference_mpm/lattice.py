"""Where the grid lies in space."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.shapes import HalfSpace

__all__ = ["grid_origin"]

Array = NDArray[Any]


def grid_origin(problem: PointProblem, spacing: float) -> Array:
    """A node of the grid, (3,) [m], near the cloud's lowest corner.

    Positions are kept relative to it, so a scene 10 km from the origin is as exact as one at it. Along an axis that has
    a plane across it, nodes lie on that plane (a floor between two layers of nodes would be felt half a cell too
    high); along any other the grid starts at the cloud's own corner, so that it moves with the scene.
    """
    corner = problem.points.reference_positions.min(axis=0)
    origin = corner.copy()
    aligned: set[int] = set()
    for collider in problem.colliders:
        if not isinstance(collider.shape, HalfSpace):
            continue
        normal = np.abs(collider.shape.normal)
        axis = int(normal.argmax())
        if normal[axis] == 1.0 and axis not in aligned:
            aligned.add(axis)
            plane = collider.shape.point[axis]
            origin[axis] = plane + spacing * np.floor((corner[axis] - plane) / spacing)
    return origin
