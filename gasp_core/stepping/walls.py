"""Where the surface of a collider is at a time, how fast it moves there, and what it leaves of what comes near."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, ContactCondition, Side
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["stopped", "wall_distances", "wall_surface"]

Array = NDArray[Any]


def wall_distances(wall: Collider, positions: Array, time: float) -> Array:
    """Distances (N,) [m] of positions (N, 3) [m] to a collider's surface, negative where matter may not be."""
    sign = 1.0 if wall.side is Side.OUTSIDE else -1.0
    places = positions if wall.motion is None else pose_of(wall.motion, time).before(positions)
    return sign * wall.shape.signed_distance(places)


def wall_surface(wall: Collider, positions: Array, time: float, step: float = 0.0) -> tuple[Array, Array]:
    """Unit normals (N, 3) towards where matter may be, and a collider's own velocities (N, 3) [m/s].

    Of a step [s] from that time on: what has them is at the end where the collider has taken it.
    """
    sign = 1.0 if wall.side is Side.OUTSIDE else -1.0
    if wall.motion is None:
        return sign * wall.shape.outward_normal(positions), np.zeros_like(positions)
    pose = pose_of(wall.motion, time).during(step)
    normals = sign * wall.shape.outward_normal(pose.before(positions))
    return normals @ pose.rotation.T, pose.velocities(positions)


def stopped(
    velocities: Array, normals: Array, rooms: Array, step: float, contact: ContactCondition, friction: float
) -> Array:
    """Velocities (N, 3) [m/s], relative to a surface, of what comes no nearer to it than there is room (N,) [m].

    What has no room left comes no nearer. Friction takes of what is along the surface as much as was stopped towards
    it, times its coefficient. What sticks is held by the nodes, whatever arrives here.
    """
    along = np.sum(velocities * normals, axis=1)
    lacking = np.maximum(-np.maximum(rooms, 0.0) / step - along, 0.0)
    across = velocities - along[:, None] * normals
    speed = np.linalg.norm(across, axis=1)
    rubs = contact is ContactCondition.SEPARATE
    braked = (friction if rubs else 0.0) * lacking / np.where(speed > 0, speed, 1.0)
    return (along + lacking)[:, None] * normals + np.maximum(0.0, 1.0 - braked)[:, None] * across
