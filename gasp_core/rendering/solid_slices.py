"""Slices through the solid behind a splat, as a picture: what is filled, what is a sheet, and where it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.atomic import replacing
from gasp_core.scene.placed_solid import PlacedSolid

__all__ = ["draw_slices"]

Array = NDArray[Any]

_CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Of the way through what is there, along each axis."""
_PIXELS = 220
"""Along the longest side of a slice."""
_INCHES = 2.6
_DOTS = 4_000
"""Gaussians drawn in one slice at most."""


def draw_slices(path: Path, body: PlacedSolid, means: Array, unit: str) -> None:
    """Write a PNG: a row for each axis, blue inside, orange sheets, grey the centres of the Gaussians near the slice.

    Parameters
    ----------
    path
        Of the picture.
    body
        What is cut.
    means : (N, 3)
        Of the Gaussians, in the world.
    unit
        For the axes: "m", or nothing.

    Raises
    ------
    SplatFormatError
        Where it cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lower, upper = np.percentile(means, [0.5, 99.5], axis=0)
    occupied = np.concatenate([body.nodes_inside(), body.sheet_positions()])
    if len(occupied):
        lower, upper = np.minimum(lower, occupied.min(axis=0)), np.maximum(upper, occupied.max(axis=0))
    margin = 0.03 * float((upper - lower).max()) or 1.0
    lower, upper = lower - margin, upper + margin
    size = (_INCHES * len(_CUTS), _INCHES * 3)
    figure = Figure(figsize=size, dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid: Any = figure.subplots(3, len(_CUTS), squeeze=False)
    for axis in range(3):
        for column, cut in enumerate(_CUTS):
            at = lower[axis] + cut * (upper[axis] - lower[axis])
            _slice(grid[axis][column], body, means, axis, at, lower, upper)
            grid[axis][column].set_title(f"{'xyz'[axis]} = {at:.3g} {unit}".rstrip(), fontsize=8)
    with replacing(path) as stream:
        figure.savefig(stream, format="png")


def _slice(plot: Any, body: PlacedSolid, means: Array, axis: int, at: float, lower: Array, upper: Array) -> None:
    across = [other for other in range(3) if other != axis]
    step = float((upper - lower).max()) / _PIXELS
    first, second = (np.arange(lower[other], upper[other], step) for other in across)
    points = np.empty((len(first), len(second), 3))
    points[..., axis] = at
    points[..., across[0]], points[..., across[1]] = np.meshgrid(first, second, indexing="ij")
    distances = body.distance_at(points.reshape(-1, 3)).reshape(len(first), len(second))
    # A wall that is thinner than a pixel is one pixel thick.
    filled = distances < max((step - body.wall) / 2, 0.0)
    extent = (first[0], first[-1], second[0], second[-1])
    plot.imshow(filled.T, origin="lower", extent=extent, cmap="Blues", vmin=0, vmax=1.6)
    sheets = body.sheet_positions()
    near = np.abs(sheets[:, axis] - at) < body.detail / 2
    plot.scatter(sheets[near][:, across[0]], sheets[near][:, across[1]], s=1.5, c="#D55E00", linewidths=0)
    near = np.flatnonzero(np.abs(means[:, axis] - at) < body.detail / 2)
    near = near[:: -(-len(near) // _DOTS) or 1]
    plot.scatter(means[near][:, across[0]], means[near][:, across[1]], s=0.3, c="#444444", linewidths=0)
    plot.set_xlim(extent[0], extent[1])
    plot.set_ylim(extent[2], extent[3])
    plot.tick_params(labelsize=6)
