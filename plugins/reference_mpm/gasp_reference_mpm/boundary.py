"""What happens to the velocity of grid nodes: wind, drives, colliders, the domain's edge.

Every function takes velocities (G, 3) [m/s] of nodes at positions (G, 3) [m] in the scene's own frame, and returns new
velocities.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    Collider,
    ContactCondition,
    Domain,
    Drive,
    ForceField,
    Wind,
)
from gasp_core.stepping.forcing import drives_at, force_fields_at, position_at_start, prescribed_velocities, walls_of
from gasp_core.stepping.walls import stopped, wall_distances, wall_surface

__all__ = ["TOUCH", "blown", "collided", "driven", "kept_inside", "kept_out"]

Array = NDArray[Any]

TOUCH = 1e-3
"""In cells: a node this near to a surface counts as on it, so that one lying exactly on a plane does so whatever way
its coordinates were rounded."""


def blown(velocities: Array, positions: Array, winds: Sequence[ForceField], time: float, step: float) -> Array:
    """Drag towards the air's velocity, dv/dt = k (u - v), implicit in v: never overshoots however strong the wind."""
    for wind in force_fields_at(winds, time):
        if not isinstance(wind, Wind):
            continue
        relaxed = (velocities + step * wind.drag * np.asarray(wind.velocity)) / (1 + step * wind.drag)
        if wind.region is None:
            velocities = relaxed
        else:
            inside = wind.region.signed_distance(positions) <= 0
            velocities = np.where(inside[:, None], relaxed, velocities)
    return velocities


def driven(
    velocities: Array,
    positions: Array,
    bodies: Array,
    drives: Sequence[Drive],
    holding: Array,
    time: float,
    step: float,
    spacing: float,
) -> tuple[Array, Array]:
    """Prescribed velocity in the regions of drives that are active, and a mask (G,) of the nodes that have it.

    The regions have moved with their drive. Nodes are those of `bodies` (G,), of which each of the drives at this time
    holds some, `holding` (K, B).
    """
    held = np.zeros(len(positions), dtype=np.bool_)
    for drive, own in zip(drives_at(drives, time), holding):
        inside = drive.region.signed_distance(position_at_start(drive, time, positions)) <= TOUCH * spacing
        inside &= own[bodies]
        velocities = np.where(inside[:, None], prescribed_velocities(drive, time, step, positions), velocities)
        held |= inside
    return velocities, held


def collided(
    velocities: Array, positions: Array, colliders: Sequence[Collider], time: float, step: float, spacing: float
) -> Array:
    """Contact conditions at nodes on or behind the surface of each collider, in the order given.

    A collider that moves is met in its own frame: nodes where they would be there, velocities relative to its own.
    """
    for wall in itertools.chain.from_iterable(map(walls_of, colliders)):
        touching = wall_distances(wall, positions, time) <= TOUCH * spacing
        normals, own = wall_surface(wall, positions[touching], time, step)
        velocities = velocities.copy()
        velocities[touching] = own + _after_contact(velocities[touching] - own, normals, wall)
    return velocities


def _after_contact(velocities: Array, normals: Array, collider: Collider) -> Array:
    approach = np.sum(velocities * normals, axis=1, keepdims=True)
    tangential = velocities - approach * normals
    match collider.contact:
        case ContactCondition.STICK:
            return np.zeros_like(velocities)
        case ContactCondition.SLIP:
            return tangential
        case ContactCondition.SEPARATE:
            # Coulomb: what the floor took along the normal bounds what it takes along the surface.
            speed = np.linalg.norm(tangential, axis=1, keepdims=True)
            kept = np.maximum(0.0, 1 + collider.friction * approach / np.where(speed > 0, speed, 1.0))
            return np.where(approach < 0, kept * tangential, velocities)


def kept_out(
    velocities: Array, positions: Array, half_widths: Array, colliders: Sequence[Collider], time: float, step: float
) -> Array:
    """Velocities (N, 3) [m/s] with which points move so that what they stand for does not enter a collider.

    Nodes on a wall have no velocity into it, but the splines between them and those above reach half a cell behind the
    wall: matter that flows would go on until it is there. A point that is nearer to the wall than half its width
    (N,) [m] comes no nearer, and one that is farther off not nearer than that. The wall takes what it had towards it,
    and by friction of what it has along the wall: it is here that the weight of what flows arrives.
    """
    for wall in itertools.chain.from_iterable(map(walls_of, colliders)):
        room = wall_distances(wall, positions, time) - half_widths
        normals, own = wall_surface(wall, positions, time, step)
        velocities = own + stopped(velocities - own, normals, room, step, wall.contact, wall.friction)
    return velocities


def kept_inside(velocities: Array, positions: Array, domain: Domain, spacing: float) -> Array:
    """The domain's edge as a slip wall: no velocity out of it at nodes on or beyond it."""
    beyond_lower = positions <= np.asarray(domain.lower) + TOUCH * spacing
    beyond_upper = positions >= np.asarray(domain.upper) - TOUCH * spacing
    velocities = np.where(beyond_lower, np.maximum(velocities, 0.0), velocities)
    return np.where(beyond_upper, np.minimum(velocities, 0.0), velocities)
