"""What colliders and drives do to the nodes of a cage, after each of Blender's steps.

Blender's own collisions of soft bodies keep a gap, eject what starts inside, and bounce by chance (a coefficient of .8
gave rebounds of 0 to .86). The contract says what contact is, so it is done here: on nodes, as material point methods
do it on theirs. What starts inside a collider is not pushed out of it, which would crush or throw it: it cannot go
deeper, and is free to leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, ContactCondition, Side

__all__ = ["Bonds", "touch"]

Array = NDArray[Any]


@dataclass(slots=True)
class Bonds:
    """What has touched a collider that does not let go, and what started inside one.

    Parameters
    ----------
    bound : (C, V) bool
        Which nodes are bound to which collider.
    anchors : (C, V, 3) [m]
        Where they touched it.
    depths : (C, V) [m]
        How far inside each node has been ever since the start; 0 once it has left.
    """

    bound: Array
    anchors: Array
    depths: Array

    @classmethod
    def at_start(cls, colliders: Sequence[Collider], places: Array, sizes: Array) -> Bonds:
        """Of nodes at `places` (V, 3) [m] that have touched nothing yet; `sizes` as of `touch`."""
        count, nodes = len(colliders), len(places)
        depths = [np.maximum(sizes - _distance(collider, places), 0.0) for collider in colliders]
        return cls(
            bound=np.zeros((count, nodes), dtype=bool),
            anchors=np.zeros((count, nodes, 3)),
            depths=np.array(depths).reshape(count, nodes),
        )


def touch(
    colliders: Sequence[Collider],
    bonds: Bonds,
    places: Array,
    velocities: Array,
    sizes: Array,
    reach: float,
    step: float,
) -> tuple[Array, Array]:
    """Places [m] and velocities [m/s] (V, 3) after contact.

    Parameters
    ----------
    sizes : (V,) [m]
        How far the matter of a node goes beyond it.
    reach
        How near counts as touching [m].
    step
        For how long nodes have moved with these velocities [s].
    """
    for number, collider in enumerate(colliders):
        sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
        outside = _distance(collider, places) - sizes
        depths = bonds.depths[number] = np.minimum(bonds.depths[number], np.maximum(-outside, 0.0))
        distance = outside + depths
        bound = bonds.bound[number]
        near = np.flatnonzero((distance <= reach) | bound)
        if len(near) == 0:
            continue
        normal = sign * collider.shape.outward_normal(places[near])
        surface = places[near] - np.minimum(distance[near], 0.0)[:, None] * normal
        if collider.contact is ContactCondition.SEPARATE:
            slower, held = _separate(velocities[near], normal, collider.friction)
            # What friction has taken of a velocity has not moved the node either: else what sticks would creep.
            places = _put(places, near, surface - step * held)
            velocities = _put(velocities, near, slower)
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


def _distance(collider: Collider, places: Array) -> Array:
    """From its surface [m], (V,); negative where matter may not be."""
    distance = collider.shape.signed_distance(places)
    return distance if collider.side is Side.OUTSIDE else -distance


def _put(array: Array, rows: Array, values: Array) -> Array:
    changed = array.copy()
    changed[rows] = values
    return changed


def _separate(velocities: Array, normal: Array, friction: float) -> tuple[Array, Array]:
    """Nothing into the surface, and Coulomb's share of what was taken away, along it, which is returned besides."""
    across = np.minimum((velocities * normal).sum(axis=1), 0.0)
    along = velocities - across[:, None] * normal
    slip = along - np.maximum((along * normal).sum(axis=1), 0.0)[:, None] * normal
    speed = np.linalg.norm(slip, axis=1)
    kept = np.maximum(speed + friction * across, 0.0) / np.where(speed > 0, speed, 1.0)
    held = (1 - kept)[:, None] * slip
    return along - held, held
