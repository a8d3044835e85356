"""What is to be in the picture: all but a backdrop, and colliders that move, as dots that are never drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BoxShape, Collider, SignedDistanceField, SphereShape
from gasp_core.harmonics import spread_directions
from gasp_core.render_input import RenderInput
from gasp_core.scene.placement import robust_box
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["BACKDROP", "Movers", "in_subject", "size_of"]

Array = NDArray[Any]

BACKDROP = 3.0
"""Times the size of what moves, from which on something else is what it moves before."""
_ACROSS = 9
"""Dots along each side of a surface."""
_WEIGHT = 0.02
"""Share of all places that those of colliders are at the least: a thousandth is passed over as being outermost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Movers:
    """Dots on colliders that move.

    Parameters
    ----------
    colliders
        Those that are no larger than what is simulated could be.
    dots : of each, (M, 3) [m]
        On its surface, where it stands in the scene.
    """

    colliders: tuple[Collider, ...]
    dots: tuple[Array, ...]

    @classmethod
    def of(cls, colliders: Sequence[Collider], largest: float) -> Self:
        """Of those of the colliders that move and are not larger than `largest` [m], across."""
        found: list[tuple[Collider, Array]] = []
        for collider in colliders:
            dots = _surface(collider.shape) if collider.motion is not None else None
            if dots is not None and len(dots) and float(np.linalg.norm(np.ptp(dots, axis=0))) <= largest:
                found.append((collider, dots))
        return cls(colliders=tuple(one for one, _ in found), dots=tuple(dots for _, dots in found))

    def at(self, time: float) -> Array:
        """Where the dots are at a time [s], (M, 3) [m]."""
        places = [np.zeros((0, 3))]
        for collider, dots in zip(self.colliders, self.dots):
            assert collider.motion is not None
            pose = pose_of(collider.motion, time)
            places.append(pose.place + (dots - pose.center) @ pose.rotation.T)
        return np.concatenate(places)

    def beside(self, positions: Array, time: float) -> Array:
        """Positions (N, 3) [m], and the dots at a time, as often as it takes for them to count."""
        dots = self.at(time)
        return np.concatenate([positions, *[dots] * int(np.ceil(_WEIGHT * len(positions) / max(len(dots), 1)))])

    def joined(self, splats: RenderInput, time: float) -> RenderInput:
        """Gaussians, and opaque ones at the dots: an outline that has the colliders in it."""
        dots = self.at(time)
        if not len(dots) or splats.quaternions is None or splats.scales is None:
            return splats
        count = len(dots)
        widths = np.concatenate([np.full(len(own), np.ptp(own, axis=0).max() / (2 * _ACROSS)) for own in self.dots])
        return splats.with_round(dots, widths, np.ones(count), np.zeros((count, 3)))


def size_of(means: Array) -> float:
    """Diagonal [m] of the box of means (N, 3) but for what is outermost; 0 of none."""
    if len(means) == 0:
        return 0.0
    lower, upper = robust_box(means)
    return float(np.linalg.norm(upper - lower))


def in_subject(means: Array, objects: Sequence[slice], moving: Sequence[bool]) -> Array:
    """Mask (N,) of Gaussians without those of objects that stand still and are much larger than all that moves."""
    chosen = np.ones(len(means), dtype=bool)
    moved = [means[rows] for rows, moves in zip(objects, moving) if moves]
    if moved:
        size = size_of(np.concatenate(moved))
        for rows, moves in zip(objects, moving):
            chosen[rows] = moves or size_of(means[rows]) <= BACKDROP * size
    return chosen


def _surface(shape: object) -> Array | None:
    """Dots (M, 3) [m] on a surface; None of one without an end."""
    if isinstance(shape, BoxShape):
        grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, _ACROSS)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        outside = (np.abs(grid) == 1).any(axis=1)
        return np.asarray(shape.center) + grid[outside] * np.asarray(shape.half_extents)
    if isinstance(shape, SphereShape):
        return np.asarray(shape.center) + shape.radius * spread_directions(2 * _ACROSS**2)
    if isinstance(shape, SignedDistanceField):
        near = np.argwhere(np.abs(shape.values) <= shape.spacing)
        near = near[:: max(1, len(near) // (6 * _ACROSS**2))]
        return np.asarray(shape.origin) + shape.spacing * near
    return None
