"""What colliders and drives do to the nodes of a cage, after each of Blender's steps.

Blender's own collisions of soft bodies keep a gap, eject what starts inside, and bounce by chance (a coefficient of .8
gave rebounds of 0 to .86). The contract says what contact is, so it is done here: on nodes, as material point methods
do it on theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.forcing import Collider, ContactCondition, Side

__all__ = ["Bonds", "touch"]

Array = NDArray[Any]


@dataclass(slots=True)
class Bonds:
    """What has touched a collider that does not let go.

    Parameters
    ----------
    bound : (C, V) bool
        Which nodes are bound to which collider.
    anchors : (C, V, 3) [m]
        Where they touched it.
    """

    bound: Array
    anchors: Array


def touch(
    colliders: Sequence[Collider], bonds: Bonds, places: Array, velocities: Array, reach: float
) -> tuple[Array, Array]:
    """Places [m] and velocities [m/s] (V, 3) after contact; `reach` [m] is how near counts as touching."""
    for number, collider in enumerate(colliders):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        distance = sign * collider.shape.signed_distance(places)
        bound = bonds.bound[number]
        near = np.flatnonzero((distance <= reach) | bound)
        if len(near) == 0:
            continue
        normal = sign * collider.shape.outward_normal(places[near])
        surface = places[near] - np.minimum(distance[near], 0.0)[:, None] * normal
        if collider.contact is ContactCondition.SEPARATE:
            places = _put(places, near, surface)
            velocities = _put(velocities, near, _separate(velocities[near], normal, collider.friction))
            continue
        fresh = near[~bound[near]]
        bonds.anchors[number, fresh] = surface[~bound[near]]
        bonds.bound[number, near] = True
        if collider.contact is ContactCondition.STICK:
            places = _put(places, near, bonds.anchors[number, near])
            velocities = _put(velocities, near, np.zeros((len(near), 3)))
        else:
            # Back onto the surface from either side of it.
            places = _put(places, near, places[near] - distance[near][:, None] * normal)
            across = (velocities[near] * normal).sum(axis=1)[:, None]
            velocities = _put(velocities, near, velocities[near] - across * normal)
    return places, velocities


def _put(array: Array, rows: Array, values: Array) -> Array:
    changed = array.copy()
    changed[rows] = values
    return changed


def _separate(velocities: Array, normal: Array, friction: float) -> Array:
    """Nothing into the surface, and Coulomb's share of what was taken away, along it."""
    across = np.minimum((velocities * normal).sum(axis=1), 0.0)
    along = velocities - across[:, None] * normal
    slip = along - np.maximum((along * normal).sum(axis=1), 0.0)[:, None] * normal
    speed = np.linalg.norm(slip, axis=1)
    kept = np.maximum(speed + friction * across, 0.0) / np.where(speed > 0, speed, 1.0)
    return along - (1 - kept)[:, None] * slip
