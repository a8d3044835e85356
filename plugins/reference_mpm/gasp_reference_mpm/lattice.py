"""Where the grid lies in space, and how large it may become."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.shapes import HalfSpace

__all__ = ["grid_excess", "grid_origin", "place_name"]

Array = NDArray[Any]

_NODE_CAP = 2**24
"""Nodes in the box around the cloud: 256 cells a side, and half a gigabyte of momenta."""


def grid_origin(problem: PointProblem, spacing: float) -> Array:
    """A node of the grid, (3,) [m], near the cloud's lowest corner.

    Positions are kept relative to it, so a scene 10 km from the origin is as exact as one at it. Along an axis that has
    a plane across it, nodes lie on that plane (a floor between two layers of nodes would be felt up to a cell too
    low); along any other a node lies at the middle of the cloud, so that the grid moves with the scene, and turns and
    mirrors with it by quarter turns.
    """
    corner = problem.points.reference_positions.min(axis=0)
    middle = (corner + problem.points.reference_positions.max(axis=0)) / 2
    origin = middle - spacing * np.ceil((middle - corner) / spacing)
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


def grid_excess(places: Array, spacing: float) -> str | None:
    """Why points at `places` (N, 3) [m] are too far apart for one grid, in words for the user; None if they are not."""
    nodes = np.prod(np.ptp(places, axis=0) / spacing + 4)
    if nodes <= _NODE_CAP:
        return None
    farthest = int(np.abs(places - np.median(places, axis=0)).max(axis=1).argmax())
    return (
        f"the cloud spans {nodes:.3g} grid nodes, more than {_NODE_CAP}; farthest is point {farthest} at"
        f" {place_name(places[farthest])}: coarsen the resolution, or set a domain with policy stop or clamp"
    )


def place_name(position: Array) -> str:
    """A position (3,) [m] as one reads it."""
    return "(" + ", ".join(f"{coordinate:.4g}" for coordinate in position) + ") m"
