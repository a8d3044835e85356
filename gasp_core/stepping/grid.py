"""Where the nodes of a regular grid lie, in one place for every engine that has one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import ContactCondition, HalfSpace, PointProblem

__all__ = ["grid_node"]

Array = NDArray[Any]


def grid_node(problem: PointProblem, spacing: float) -> Array:
    """A place, (3,) [m], where a node of a grid of the given spacing [m] belongs.

    Along an axis without a plane across it: the problem's anchor, or the middle of the cloud, so that the grid moves
    with the scene, and turns and mirrors with it by quarter turns.

    Along an axis with a plane across it (the first such collider counts) the plane decides, because a collider acts on
    the nodes it covers. One that holds matter both ways (stick, slip) has nodes on it. One that matter may leave has
    them half a cell to either side: quadratic B-splines feel a node from a cell and a half away, so that matter comes
    to rest more than a cell above the nodes that stop it, and would float that far above a plane that they lie on.
    """
    positions = problem.points.reference_positions
    middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
    node = middle if problem.grid_anchor is None else np.array(problem.grid_anchor)
    for axis in range(3):
        for collider in problem.colliders:
            if isinstance(collider.shape, HalfSpace) and abs(abs(collider.shape.normal[axis]) - 1.0) <= 1e-12:
                shift = spacing / 2 if collider.contact is ContactCondition.SEPARATE else 0.0
                node[axis] = collider.shape.point[axis] + shift
                break
    return node
