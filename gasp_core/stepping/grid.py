"""Where the nodes of a regular grid lie, in one place for every engine that has one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, ContactCondition, Fluid, HalfSpace, PointProblem, Side
from gasp_core.contract.validation import finite_vector

__all__ = ["GridAnchor", "grid_node"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class GridAnchor:
    """A hint of a problem: a place [m] that a grid is laid out from instead of the points' middle, see `grid_node`.

    Few points that stand for much matter reach less far than it does: laid out from them, the grid would lie elsewhere
    for each choice of them.
    """

    place: tuple[float, float, float]

    def __post_init__(self) -> None:
        finite_vector(self, "place")


def grid_node(problem: PointProblem, spacing: float) -> Array:
    """A place, (3,) [m], where a node of a grid of the given spacing [m] belongs.

    Along an axis without a plane across it: the problem's anchor, or the middle of the cloud, so that the grid moves
    with the scene, and turns and mirrors with it by quarter turns.

    Along an axis with a plane across it (the first such collider counts, a face of a box that holds the scene is one)
    the plane decides, because a collider acts on the nodes it covers. One that holds matter both ways (stick, slip) has
    nodes on it. One that matter may leave has them half a cell to either side: quadratic B-splines feel a node from a
    cell and a half away, so that matter comes to rest more than a cell above the nodes that stop it, and would float
    that far above a plane that they lie on. Fluids have no such gap, because they are pressed on: to them a plane is
    where the nodes are that stop them, and with those half a cell behind it a tank is a cell too wide; the water in it
    flows on into its walls until it has lost a fifth of its depth. Where there are any, nodes lie on the plane.
    """
    positions = problem.points.reference_positions
    middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
    anchors = [hint for hint in problem.hints if isinstance(hint, GridAnchor)]
    node = np.array(anchors[0].place) if anchors else middle
    wet = any(isinstance(problem.materials[index], Fluid) for index in np.unique(problem.points.material_ids))
    for axis in range(3):
        for collider in problem.colliders:
            plane = _plane_across(collider, axis)
            if plane is not None:
                shift = 0.0 if wet or collider.contact is not ContactCondition.SEPARATE else spacing / 2
                node[axis] = plane + shift
                break
    return node


def _plane_across(collider: Collider, axis: int) -> float | None:
    """Where [m] a collider has a plane face across the axis that matter lies at, if it has."""
    match collider.shape:
        case HalfSpace(point=point, normal=normal) if abs(abs(normal[axis]) - 1.0) <= 1e-12:
            return point[axis]
        case BoxShape(center=center, half_extents=half_extents) if collider.side is Side.INSIDE:
            return center[axis] - half_extents[axis]
        case _:
            return None
