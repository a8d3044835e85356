"""The renderer "numba": a tile rasteriser on all processors."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import Picture
from gasp_renderer.binning import count_pairs, list_pairs
from gasp_renderer.blending import blend
from gasp_renderer.inputs import checked_inputs, checked_occluders
from gasp_renderer.memory import refuse_beyond_memory
from gasp_renderer.projection import FIELDS, SPANS, TILE, View, project
from gasp_renderer.sorting import front_to_back

__all__ = ["NumbaRenderer", "empty_picture", "first_rays", "tile_lists"]

Array = NDArray[Any]

_BYTES_PER_PIXEL = 24
"""Colour, alpha, depth and an occluder."""
_BYTES_PER_GAUSSIAN = 4 * (FIELDS + SPANS) + 8 + 8 + 24
"""Ellipse, span, depth, box, and two keys and rows while sorting."""


class NumbaRenderer:
    """Draws splats on the CPU; keeps what it needs per Gaussian from picture to picture.

    The picture is that of `gasp_core.rendering.contract` but for rounding and for what the last `blending.OPAQUE` of
    the light would show. It is the same, bit for bit, for any number of threads (``NUMBA_NUM_THREADS``).
    """

    def __init__(self) -> None:
        self._ellipses = np.empty((0, FIELDS), np.float32)
        self._spans = np.empty((0, SPANS), np.float32)
        self._depths = np.empty(0, np.float64)
        self._boxes = np.empty((0, 4), np.int16)

    def render(self, splats: RenderInput, camera: Camera, *, occluders: Array | None = None) -> Picture:
        """Draw splats on a transparent ground; see `SplatRenderer.render`."""
        walls = checked_occluders(occluders, camera)
        inputs = checked_inputs(splats)
        load = f"{camera.width} x {camera.height} pixels and {len(splats):,} Gaussians"
        needed = _BYTES_PER_PIXEL * camera.width * camera.height + _BYTES_PER_GAUSSIAN * len(splats)
        refuse_beyond_memory(needed, load, "draw a smaller picture or fewer Gaussians")
        try:
            ellipses, spans, depths, boxes = self._scratch(len(splats), occluded=len(walls) > 0)
            pairs = project(View.of(camera), *inputs, ellipses, spans, depths, boxes)
            refuse_beyond_memory(
                4 * pairs,
                f"{len(splats):,} Gaussians that touch {pairs:,} tiles of {TILE} x {TILE} pixels",
                "draw a smaller picture or from farther away, or leave out the largest Gaussians",
            )
            starts, lists = tile_lists(front_to_back(depths), boxes, camera)
            picture = empty_picture(camera)
            blend(
                ellipses, spans, starts, lists, first_rays(camera), walls, picture.colour, picture.alpha, picture.depth
            )
        except MemoryError as error:
            raise RenderingError(f"{load} do not fit in memory: draw a smaller picture or fewer Gaussians") from error
        return picture

    def _scratch(self, count: int, *, occluded: bool) -> tuple[Array, Array, Array, Array]:
        if count > len(self._depths):
            self._ellipses = np.empty((count, FIELDS), np.float32)
            self._depths = np.empty(count, np.float64)
            self._boxes = np.empty((count, 4), np.int16)
        if occluded and count > len(self._spans):
            self._spans = np.empty((count, SPANS), np.float32)
        return self._ellipses[:count], self._spans[: count * occluded], self._depths[:count], self._boxes[:count]


def first_rays(camera: Camera) -> tuple[float, float, float, float]:
    """x / z of the first column of pixels and its step, y / z of the first row and its step."""
    across, down = 1 / float(camera.focal_x), 1 / float(camera.focal_y)
    return (0.5 - float(camera.center_x)) * across, across, (0.5 - float(camera.center_y)) * down, down


def tile_lists(order: Array, boxes: Array, camera: Camera) -> tuple[Array, Array]:
    """Which Gaussians each tile of a picture has, nearest first.

    Parameters
    ----------
    order : (M,) int32
        From `front_to_back`.
    boxes : (N, 4) int16
        From `project`.
    camera

    Returns
    -------
    starts : (tiles + 1,) int64, lists : (pairs,) int32
    """
    columns, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    bands = min(numba.get_num_threads(), rows)
    starts = np.zeros(columns * rows + 1, np.int64)
    np.cumsum(count_pairs(order, boxes, columns, rows, bands), out=starts[1:])
    lists = np.empty(starts[-1], np.int32)
    list_pairs(order, boxes, columns, rows, bands, starts, lists)
    return starts, lists


def empty_picture(camera: Camera) -> Picture:
    """A picture of the camera's size, not yet written to."""
    height, width = camera.height, camera.width
    return Picture(
        colour=np.empty((height, width, 3), np.float32),
        alpha=np.empty((height, width), np.float32),
        depth=np.empty((height, width), np.float32),
    )
