"""Regions of space: where a drive acts, what a collider fills, which part of an object is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.validation import finite_vector, positive, unit_vector
from gasp_core.errors import SceneError

__all__ = ["SHAPES", "BoxShape", "HalfSpace", "Shape", "SphereShape", "Vector"]

Array = NDArray[Any]
Vector = tuple[float, float, float]


@runtime_checkable
class Shape(Protocol):
    """A closed region of space with a signed distance."""

    kind: ClassVar[str]

    def signed_distance(self, positions: Array) -> Array:
        """Distance to the surface [m], (N,), negative inside, of positions (N, 3)."""
        ...

    def outward_normal(self, positions: Array) -> Array:
        """Unit gradient of the signed distance, (N, 3)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpace:
    """Everything below a plane.

    Parameters
    ----------
    point
        On the plane [m].
    normal
        Out of the matter, of any length.
    """

    kind: ClassVar[str] = "plane"
    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        finite_vector(self, "point")
        unit_vector(self, "normal")

    def signed_distance(self, positions: Array) -> Array:
        """Height above the plane."""
        return (positions - np.asarray(self.point)) @ np.asarray(self.normal)

    def outward_normal(self, positions: Array) -> Array:
        """The plane's normal."""
        return np.broadcast_to(np.asarray(self.normal), positions.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxShape:
    """A box along the axes.

    Parameters
    ----------
    center
        [m].
    half_extents
        Half of its sides [m], > 0.
    """

    kind: ClassVar[str] = "box"
    center: Vector
    half_extents: Vector

    def __post_init__(self) -> None:
        finite_vector(self, "center")
        finite_vector(self, "half_extents")
        if min(self.half_extents) <= 0:
            raise SceneError(f"BoxShape.half_extents must be > 0, found {self.half_extents!r}")

    def signed_distance(self, positions: Array) -> Array:
        """Exact distance to the box."""
        q = np.abs(positions - np.asarray(self.center)) - np.asarray(self.half_extents)
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0)

    def outward_normal(self, positions: Array) -> Array:
        """Towards the nearest surface point from inside, away from it outside."""
        offset = positions - np.asarray(self.center)
        q = np.abs(offset) - np.asarray(self.half_extents)
        sign = np.where(offset < 0, -1.0, 1.0)
        outward = np.maximum(q, 0.0) * sign
        inside = ~(q > 0).any(axis=1)
        rows = np.flatnonzero(inside)
        axis = np.argmax(q[rows], axis=1)
        outward[rows, axis] = sign[rows, axis]
        return outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-300)


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereShape:
    """A ball.

    Parameters
    ----------
    center
        [m].
    radius
        [m], > 0.
    """

    kind: ClassVar[str] = "sphere"
    center: Vector
    radius: float

    def __post_init__(self) -> None:
        finite_vector(self, "center")
        positive(self, "radius")

    def signed_distance(self, positions: Array) -> Array:
        """Distance to the sphere."""
        return np.linalg.norm(positions - np.asarray(self.center), axis=1) - self.radius

    def outward_normal(self, positions: Array) -> Array:
        """Away from the centre; +z at the centre itself."""
        offset = positions - np.asarray(self.center)
        length = np.linalg.norm(offset, axis=1, keepdims=True)
        return np.where(length > 0, offset / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])


SHAPES: dict[str, type[Shape]] = {
    "plane": HalfSpace,
    "box": BoxShape,
    "sphere": SphereShape,
}
