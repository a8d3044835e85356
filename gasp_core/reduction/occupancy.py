"""Which cells of a lattice points lie in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["cell_volumes", "occupied_cells"]

Array = NDArray[Any]

_FACE = 1e-9
"""Of a spacing: nearer to a face than that, a point is on it."""


def occupied_cells(points: Array, spacing: float) -> Array:
    """Number 0, 1, 2, ... of the occupied cell of the given spacing that each point (P, 3) lies in, (P,)."""
    index = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    # What lies on the last face is in the cell before it: a body N spacings long has N cells, not one more for its end.
    cells = np.ceil(np.ptp(points, axis=0) / spacing - _FACE).astype(np.int64)
    index = np.minimum(index, np.maximum(cells - 1, 0))
    spans = index.max(axis=0) + 1
    if float(np.prod(spans.astype(np.float64))) < 2.0**62:
        keys = (index[:, 0] * spans[1] + index[:, 1]) * spans[2] + index[:, 2]
        _, cell = np.unique(keys, return_inverse=True)
    else:
        _, cell = np.unique(index, axis=0, return_inverse=True)
    return cell.reshape(-1)


def cell_volumes(points: Array, spacing: float) -> Array:
    """Volumes (P,) [m^3] of the points (P, 3) of one body: each cell of the engine's spacing shares its own out.

    V0 = spacing^3 / (points in the cell), so that the mass is that of the occupied cells, however densely the splat
    is sampled there, and coincident points count once.
    """
    cell = occupied_cells(points, spacing)
    return spacing**3 / np.bincount(cell)[cell]
