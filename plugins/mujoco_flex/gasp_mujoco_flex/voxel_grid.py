"""Regular lattices of boxes around a cloud."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.stepping.enclosure import enclosed

__all__ = ["Lattice", "fits", "lattice_around", "node_count", "point_distance"]

Array = NDArray[Any]

_LARGEST_LATTICE = 2**24
_TIE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Boxes that fill a box.

    Parameters
    ----------
    lower : (3,) [m]
        Corner of the first one.
    sides : (3,) [m]
        Of one of them.
    shape
        Their numbers along the axes.
    """

    lower: Array
    sides: Array
    shape: tuple[int, int, int]

    def locate(self, positions: Array) -> tuple[Array, Array]:
        """Cell (N, 3) of each position (N, 3) [m], the nearest one outside of them, and place (N, 3) in it [sides]."""
        places = (positions - self.lower) / self.sides
        cells = np.clip(np.floor(places).astype(np.int64), 0, np.array(self.shape) - 1)
        return cells, places - cells

    def refined(self, parts: int) -> Lattice:
        """The lattice that divides every cell into `parts` along each axis."""
        x, y, z = self.shape
        return Lattice(lower=self.lower, sides=self.sides / parts, shape=(x * parts, y * parts, z * parts))


def lattice_around(positions: Array, margin: float, side: float) -> Lattice:
    """The lattice whose outermost faces are `margin` [m] off the cloud (N, 3) [m], of sides of about `side` [m].

    Raises
    ------
    SceneError
        Where the cloud is so wide that the lattice would have more than 2^24 cells.
    """
    lower, upper = positions.min(axis=0) - margin, positions.max(axis=0) + margin
    # What is half a cell between two numbers of them is not left to rounding.
    counts = np.maximum(np.rint((upper - lower) / side * (1 - _TIE)), 1.0)
    if counts.prod() > _LARGEST_LATTICE:
        raise SceneError(
            f"points of one body are up to {float((upper - lower).max()):.3g} m apart, too far for cells of"
            f" {side:.3g} m: drop its floaters, or lower the resolution"
        )
    x, y, z = (int(count) for count in counts)
    return Lattice(lower=lower, sides=(upper - lower) / counts, shape=(x, y, z))


def point_distance(positions: Array, volumes: Array) -> float:
    """Side [m] of the cube that a point (N, 3) [m] of this cloud stands for; points at one place count once."""
    span = np.ptp(positions, axis=0)
    # A millionth of the size is one place.
    keys = ((positions - positions.min(axis=0)) / max(float(span.max()), 1e-300) * 2**20).astype(np.int64)
    places = len(np.unique((keys[:, 0] << 42) | (keys[:, 1] << 21) | keys[:, 2]))
    return float(np.cbrt(volumes.sum() / places))


def fits(lattice: Lattice) -> bool:
    """Whether a lattice is small enough to be held in memory cell by cell."""
    return float(np.prod(np.array(lattice.shape, dtype=float))) <= _LARGEST_LATTICE


def node_count(lattice: Lattice, positions: Array, *, filled: bool) -> int:
    """Nodes of the cells that hold positions (N, 3) [m], and of those that they enclose if these are `filled`."""
    occupied = np.zeros(lattice.shape, dtype=bool)
    occupied[tuple(lattice.locate(positions)[0].T)] = True
    if filled:
        occupied |= enclosed(occupied)
    nodes = np.zeros(tuple(side + 1 for side in lattice.shape), dtype=bool)
    for x, y, z in np.ndindex(2, 2, 2):
        nodes[x : x + occupied.shape[0], y : y + occupied.shape[1], z : z + occupied.shape[2]] |= occupied
    return int(nodes.sum())
