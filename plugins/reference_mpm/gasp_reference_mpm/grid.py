"""Where the grid lies in space, and how large it may become."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.stepping.grid import grid_node

__all__ = ["grid_excess", "grid_origin", "place_name"]

Array = NDArray[Any]

_NODE_CAP = 2**24
"""Nodes in the box around the cloud: 256 cells a side, and half a gigabyte of momenta."""


def grid_origin(problem: PointProblem, spacing: float) -> Array:
    """The grid's node, (3,) [m], just below the cloud's lowest corner.

    Positions are kept relative to it, so a scene 10 km from the origin is as exact as one at it.
    """
    node = grid_node(problem, spacing)
    corner = problem.points.reference_positions.min(axis=0)
    return node + spacing * np.floor((corner - node) / spacing)


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
