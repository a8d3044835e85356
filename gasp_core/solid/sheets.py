"""Matter that is too thin for a solid: surfels that stand off it, as pieces of a sheet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid.grid import Grid, interpolated
from gasp_core.solid.morphology import dilated
from gasp_core.solid.solid import Sheets, Solid
from gasp_core.solid.surfels import OPAQUE, Surfels, counted_once

__all__ = ["sheets_outside"]

Array = NDArray[Any]

_OFF = 2.5
"""Details off the solid at which opaque matter is none of the fuzz of its surface."""
_LAYER = 1.0
"""Standard deviation in details over which surfels are one layer."""
_PIECE = 0.5
"""Side of a piece in details."""
_MOST_PIECES = 256
"""Of one surfel."""
_EVENLY = np.array([0.7548776662466927, 0.5698402909980532])
"""1/p and 1/p^2 of the plastic number p: multiples of both fill a square evenly, however many there are (Roberts 2018,
"The unreasonable effectiveness of quasirandom sequences")."""


def sheets_outside(solid: Solid, surfels: Surfels, depth: Array, grid: Grid) -> Sheets:
    """The surfels that are opaque together and stand off the solid, cut into pieces.

    Parameters
    ----------
    solid
        What there is already.
    surfels
        Of the same object.
    depth, grid
        Their optical depth (X, Y, Z) on a grid whose spacing is the detail.
    """
    distance = solid.grid.resampled(solid.distance.astype(np.float64), grid)
    thin = (depth > OPAQUE) & (distance > 0.5 * solid.detail)
    off = thin & (distance > _OFF * solid.detail)
    # Down to the surface, where a leaf hangs on.
    reached = dilated(off, 2, within=thin)
    rows = np.flatnonzero(interpolated([reached.astype(np.float64)], grid.places(surfels.means))[:, 0] > 0.5)
    if not len(rows):
        return Sheets.none()
    areas = counted_once(surfels, surfels.areas, grid, _LAYER * solid.detail, solid.detail)
    return _in_pieces(surfels.select(rows), areas[rows], solid.detail)


def _in_pieces(surfels: Surfels, areas: Array, detail: float) -> Sheets:
    """The surfels as points, spread as their densities are, and those in one small cube as one."""
    from scipy.special import ndtri

    side = _PIECE * detail
    reach = 2 * np.pi * np.sqrt(surfels.variances[:, 1] * surfels.variances[:, 2])
    counts = np.clip(np.ceil(reach / side**2), 1, _MOST_PIECES).astype(np.int64)
    owners = np.repeat(np.arange(len(surfels)), counts)
    number = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    quantiles = (0.5 + np.outer(number, _EVENLY)) % 1.0
    _, axes = np.linalg.eigh(surfels.covariances)
    offsets = ndtri(np.clip(quantiles, 0.02, 0.98)) * np.sqrt(surfels.variances[owners, 1:])
    points = surfels.means[owners] + np.einsum("nik,nk->ni", axes[owners][:, :, 1:], offsets)
    return _merged(points, (areas / counts)[owners], side, detail)


def _merged(points: Array, areas: Array, side: float, thickness: float) -> Sheets:
    """What is in one cube of this side is one piece."""
    cubes = np.floor(points / side).astype(np.int64)
    _, piece = np.unique(cubes, axis=0, return_inverse=True)
    piece = piece.reshape(-1)
    total = np.bincount(piece, areas)
    positions = np.stack([np.bincount(piece, areas * column) / total for column in points.T], axis=1)
    return Sheets(positions=positions, areas=total, thickness=thickness)
