"""Nodes of a regular grid, and what is between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Grid", "interpolated"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """The nodes origin + spacing (i, j, k).

    Parameters
    ----------
    origin : (3,)
        The first of them.
    spacing
        > 0.
    shape
        Their numbers along the axes.
    """

    origin: Array
    spacing: float
    shape: tuple[int, int, int]

    @classmethod
    def around(cls, lower: Array, upper: Array, spacing: float, level: float) -> Grid:
        """The smallest grid that holds a box, with a layer of nodes half a spacing above the height `level`."""
        first = level + spacing / 2
        start = np.array([lower[0], lower[1], first - np.ceil(max(first - lower[2], 0.0) / spacing) * spacing])
        x, y, z = (int(count) for count in np.ceil((upper - start) / spacing).astype(int) + 1)
        return cls(origin=start, spacing=spacing, shape=(x, y, z))

    def above(self, row: int) -> Grid:
        """Without the lowest so many layers; a negative number adds some."""
        x, y, z = self.shape
        lifted = self.origin + np.array([0.0, 0.0, row * self.spacing])
        return Grid(origin=lifted, spacing=self.spacing, shape=(x, y, z - row))

    def places(self, points: Array) -> Array:
        """Points (N, 3) counted in spacings from the first node."""
        return (points - self.origin) / self.spacing

    def heights(self) -> Array:
        """Of the layers of nodes, (Z,)."""
        return self.origin[2] + self.spacing * np.arange(self.shape[2])

    def resampled(self, field: Array, other: Grid) -> Array:
        """A field on these nodes, at those of another grid; beyond the outermost nodes as there."""
        if other.shape == self.shape and other.spacing == self.spacing and np.array_equal(other.origin, self.origin):
            return field
        axes = [
            (other.origin[axis] + other.spacing * np.arange(other.shape[axis]) - self.origin[axis]) / self.spacing
            for axis in range(3)
        ]
        return interpolated([field], np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))[..., 0]


def interpolated(fields: Sequence[Array], places: Array) -> Array:
    """Fields on nodes, trilinear at places (..., 3) in spacings, (..., F); beyond the nodes as at the nearest."""
    from scipy import ndimage

    rows = np.moveaxis(places, -1, 0)
    found = [ndimage.map_coordinates(field, rows, order=1, mode="nearest") for field in fields]
    return np.stack(found, axis=-1)
