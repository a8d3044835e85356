"""Colliders as the planes and boxes that Genesis' rigid coupling knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, HalfSpace, Side

__all__ = ["Wall", "WallKind", "walls_of"]

Array = NDArray[Any]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class WallKind:
    """What of a wall is compiled.

    Parameters
    ----------
    normal
        Of a plane, out of it; None for a box.
    size
        Of a box [cells]; zeros for a plane.
    friction
        Coulomb's coefficient.
    """

    normal: Vector | None
    size: Vector
    friction: float


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall and its place (3,) [m]: a point of the plane, the centre of the box."""

    kind: WallKind
    place: Array


def walls_of(colliders: Sequence[Collider], spacing: float) -> tuple[Wall, ...]:
    """The walls that hold matter back as colliders do, on a grid of `spacing` [m]; a container is six planes."""
    walls: list[Wall] = []
    for collider in colliders:
        shape, inside = collider.shape, collider.side is Side.INSIDE
        match shape:
            case HalfSpace():
                walls.append(_plane(shape.point, -np.array(shape.normal) if inside else shape.normal, collider))
            case BoxShape() if inside:
                center, half = np.array(shape.center), np.array(shape.half_extents)
                for out in (*np.eye(3), *-np.eye(3)):
                    walls.append(_plane(center + half * out, -out, collider))
            case BoxShape():
                x, y, z = (2 * extent / spacing for extent in shape.half_extents)
                kind = WallKind(normal=None, size=(x, y, z), friction=collider.friction)
                walls.append(Wall(kind=kind, place=np.array(shape.center)))
            case _:
                raise AssertionError(f"{shape.kind} is not among the declared shapes")
    return tuple(walls)


def _plane(point: Any, normal: Any, collider: Collider) -> Wall:
    # Adding zero makes one number of both zeros: two planes that are the same are made once.
    x, y, z = (float(component) + 0.0 for component in normal)
    kind = WallKind(normal=(x, y, z), size=(0.0, 0.0, 0.0), friction=collider.friction)
    return Wall(kind=kind, place=np.array(point, dtype=np.float64))
