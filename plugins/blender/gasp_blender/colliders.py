"""Colliders as bodies of a Bullet world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.initial_overlap import Pieces
from gasp_core.contract import BoxShape, Collider, HalfSpace, Side, SignedDistanceField, SphereShape
from gasp_core.errors import SceneError
from gasp_core.stepping.convex_pieces import convex_pieces, convex_walls

__all__ = ["wall_of"]

Array = NDArray[Any]

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_WIDTH = 200.0
"""Of what stands for a half space, in sizes of a body: float32 is then fine to 2e-5 of a body at its edge."""
_PIECES = 256
"""Convex bodies that a collider without a formula is made of, at most."""
_RINGS = 24
"""Of a ball's hull; it lies up to 1 - cos(pi / 48) = 0.2 % of the radius within the ball."""


def wall_of(collider: Collider, size: float) -> Iterator[Pieces]:
    """Vertices (V, 3) [m] of the convex pieces of each body that stands for a collider beside bodies of `size` [m].

    Raises
    ------
    SceneError
        For the inside of a ball, which no few convex bodies bound.
    """
    shape, inside = collider.shape, collider.side is Side.INSIDE
    if isinstance(shape, HalfSpace):
        normal = np.asarray(shape.normal) * (-1 if inside else 1)
        yield [_slab(np.asarray(shape.point), normal, _WIDTH * size)]
    elif isinstance(shape, BoxShape):
        center, half = np.asarray(shape.center), np.asarray(shape.half_extents)
        if not inside:
            yield [center + (2 * _CORNERS - 1) * half]
            return
        for axis in range(3):
            for way in (-1.0, 1.0):
                outward = way * np.eye(3)[axis]
                yield [_slab(center + outward * half, -outward, 4 * float(half.max()) + 4 * size)]
    elif isinstance(shape, SignedDistanceField):
        yield convex_walls(shape, size, _PIECES) if inside else convex_pieces(shape, _PIECES)
    elif not isinstance(shape, SphereShape):
        raise SceneError(f"blender knows no {shape.kind} as a collider of rigid bodies: use a plane, a box or a sphere")
    elif inside:
        raise SceneError("blender keeps no rigid body within a ball: use a box, or make the body elastic")
    else:
        yield [_ball(np.asarray(shape.center), shape.radius)]


def _slab(point: Array, normal: Array, width: float) -> Array:
    """A cube of `width` whose upper face has its middle at `point`."""
    across = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, across)
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first), normal])
    return point + ((_CORNERS - [0.5, 0.5, 1.0]) * width) @ axes


def _ball(center: Array, radius: float) -> Array:
    polar = np.linspace(0, np.pi, _RINGS + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, 2 * _RINGS, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    places = np.concatenate(
        [np.sin(angle) * ring + np.cos(angle) * np.array([0.0, 0.0, 1.0]) for angle in polar]
        + [np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])]
    )
    return center + radius * places
