"""Where the surface of a collider is at a time, and how fast it moves there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, Side
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["wall_distances", "wall_surface"]

Array = NDArray[Any]


def wall_distances(wall: Collider, positions: Array, time: float) -> Array:
    """Distances (N,) [m] of positions (N, 3) [m] to a collider's surface, negative where matter may not be."""
    sign = 1.0 if wall.side is Side.OUTSIDE else -1.0
    places = positions if wall.motion is None else pose_of(wall.motion, time).before(positions)
    return sign * wall.shape.signed_distance(places)


def wall_surface(wall: Collider, positions: Array, time: float) -> tuple[Array, Array]:
    """Unit normals (N, 3) towards where matter may be, and a collider's own velocities (N, 3) [m/s]."""
    sign = 1.0 if wall.side is Side.OUTSIDE else -1.0
    if wall.motion is None:
        return sign * wall.shape.outward_normal(positions), np.zeros_like(positions)
    pose = pose_of(wall.motion, time)
    normals = sign * wall.shape.outward_normal(pose.before(positions))
    return normals @ pose.rotation.T, pose.velocities(positions)
