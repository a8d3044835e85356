"""A region of space that no formula describes: signed distances on the nodes of a grid."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.shapes import BoxShape, Shape, Vector
from gasp_core.contract.validation import finite, finite_vector, frozen_array, positive
from gasp_core.errors import SceneError

__all__ = ["SignedDistanceField"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SignedDistanceField:
    """A closed region of space: distances to its surface on a grid along the world's axes, trilinear in between.

    Beyond the grid the distance is that of its nearest place and the way there. The normal is the gradient over one
    spacing, by central differences: that of the interpolation itself would jump from cell to cell.

    Parameters
    ----------
    origin
        Of the first node [m].
    spacing
        Between nodes [m].
    values : (X, Y, Z) [m]
        Kept in single precision; negative inside, > 0 on all outermost nodes. Near the surface they should be
        distances; farther off their sign and a slope of about one are enough.
    error
        Within how much 95 % of the surface lie of where it should be [m], as whoever made it knows; 0: nothing is said.

    Raises
    ------
    SceneError
        Where the grid has fewer than 2 nodes along an axis, a number is not finite, nothing is inside, or what is
        inside reaches the outermost nodes.
    """

    kind: ClassVar[str] = "signed distance field"
    origin: Vector
    spacing: float
    values: Array
    error: float = 0.0

    def __post_init__(self) -> None:
        finite_vector(self, "origin")
        positive(self, "spacing")
        finite(self, "error", low=0.0)
        values = frozen_array(self, "values", (None, None, None), np.float32)
        if min(values.shape) < 2:
            raise SceneError(f"SignedDistanceField.values has shape {values.shape}: 2 nodes along each axis at least")
        if not (values < 0).any():
            raise SceneError("SignedDistanceField.values are nowhere negative: nothing is inside")
        outermost = (face for axis in range(3) for face in (values.take(0, axis), values.take(-1, axis)))
        if not all((face > 0).all() for face in outermost):
            raise SceneError(
                "SignedDistanceField.values must be > 0 on the outermost nodes: give the grid a margin around the body"
            )

    @classmethod
    def sampled(cls, shape: Shape, lower: Vector, upper: Vector, spacing: float) -> Self:
        """The part of another shape within a box, on a grid with a margin of two nodes around that.

        Parameters
        ----------
        shape
            Any, also one without an end.
        lower, upper
            Corners of the box [m].
        spacing
            Between nodes [m].
        """
        low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
        counts = np.ceil((high - low) / spacing).astype(int) + 5
        origin = (low + high - spacing * (counts - 1)) / 2
        nodes = origin + spacing * np.indices(tuple(counts)).reshape(3, -1).T
        box = BoxShape(center=tuple((low + high) / 2), half_extents=tuple((high - low) / 2))
        values = np.maximum(shape.signed_distance(nodes), box.signed_distance(nodes))
        return cls(origin=tuple(origin), spacing=spacing, values=values.reshape(counts))

    def signed_distance(self, positions: Array) -> Array:
        """Interpolated distance."""
        places = (np.asarray(positions, dtype=np.float64) - self.origin) / self.spacing
        return self._at(places)

    def outward_normal(self, positions: Array) -> Array:
        """Gradient over one spacing; +z where there is none."""
        places = (np.asarray(positions, dtype=np.float64) - self.origin) / self.spacing
        slopes = np.stack([self._at(places + half) - self._at(places - half) for half in np.eye(3) / 2], axis=1)
        length = np.linalg.norm(slopes, axis=1, keepdims=True)
        return np.where(length > 0, slopes / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])

    def _at(self, places: Array) -> Array:
        """Distances (N,) [m] at places (N, 3) counted in spacings from the first node."""
        shape = np.array(self.values.shape)
        within = np.clip(places, 0.0, shape - 1.0)
        low = np.minimum(within.astype(np.int64), shape - 2)
        x, y, z = (within - low).T
        first = np.ravel_multi_index(tuple(low.T), self.values.shape)
        flat, (along, across) = self.values.reshape(-1), (shape[1] * shape[2], shape[2])
        lines = [
            (1.0 - z) * flat[first + line] + z * flat[first + line + 1] for line in (0, across, along, along + across)
        ]
        found = (1.0 - x) * ((1.0 - y) * lines[0] + y * lines[1]) + x * ((1.0 - y) * lines[2] + y * lines[3])
        return found + self.spacing * np.linalg.norm(places - within, axis=1)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SignedDistanceField):
            return NotImplemented
        return (self.origin, self.spacing, self.error) == (other.origin, other.spacing, other.error) and np.array_equal(
            self.values, other.values
        )

    def __hash__(self) -> int:
        return hash((self.origin, self.spacing, self.values.shape))

    def __repr__(self) -> str:
        """With a digest of the values: what is printed alike is alike, and short."""
        digest = hashlib.sha256(self.values.tobytes()).hexdigest()[:16]
        x, y, z = self.values.shape
        return (
            f"SignedDistanceField(origin={self.origin!r}, spacing={self.spacing!r}, values={x} x {y} x {z} {digest},"
            f" error={self.error!r})"
        )
