"""Cameras that see all of a motion without being told where to stand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.footage import Footage
from gasp_core.scene.placement import robust_box

__all__ = ["VIEWS", "frame_box", "motion_box", "turntable"]

Array = NDArray[Any]
Box = tuple[Array, Array]

VIEWS: dict[str, tuple[float, float]] = {
    "three-quarter": (35.0, 18.0),
    "front": (0.0, 8.0),
    "right": (90.0, 8.0),
    "back": (180.0, 8.0),
    "left": (270.0, 8.0),
    "top": (0.0, 89.0),
}
"""Views by name: degrees around from the front (seen along +y) to the right, and degrees above the horizon."""

_MARGIN = 1.1
_FIELD_OF_VIEW = 35.0
_LOOKED_AT = 24
"""Frames whose extent is measured: motion is smooth, and reading all of a long recording takes its time."""
_POSITIONS = 50_000


def motion_box(footage: Footage, frames: Sequence[int] | None = None) -> Box:
    """Corners of the box that the matter stays in over frames (all there are), but for its outermost thousandths.

    Raises
    ------
    RenderingError
        Where there is no frame yet.
    """
    count = footage.frame_count
    chosen = range(count) if frames is None else frames
    if len(chosen) == 0:
        raise RenderingError(f"{footage.path}: holds no frame yet")
    picked = sorted({chosen[round(k)] for k in np.linspace(0, len(chosen) - 1, min(len(chosen), _LOOKED_AT))})
    boxes = [_box(footage.positions(frame)) for frame in picked]
    lower = np.min([box[0] for box in boxes], axis=0)
    upper = np.max([box[1] for box in boxes], axis=0)
    return lower, upper


def frame_box(
    box: Box, *, width: int, height: int, around: float, above: float, field_of_view: float = _FIELD_OF_VIEW
) -> Camera:
    """A camera that sees a whole box, from `around` degrees right of its front and `above` degrees over the horizon."""
    distance = _distance(box, width, height, around, above, field_of_view)
    return _orbiting(box, distance, width, height, around, above, field_of_view)


def turntable(
    box: Box, count: int, *, width: int, height: int, around: float, above: float, field_of_view: float = _FIELD_OF_VIEW
) -> list[Camera]:
    """As many cameras as there are frames, once around a box at a distance from which it fits from everywhere."""
    turns = [around + 360.0 * k / max(count, 1) for k in range(count)]
    distance = max(
        _distance(box, width, height, float(turn), above, field_of_view) for turn in np.arange(0.0, 360.0, 15.0)
    )
    return [_orbiting(box, distance, width, height, turn, above, field_of_view) for turn in turns]


def _box(positions: Array) -> Box:
    finite = positions[:: max(1, len(positions) // _POSITIONS)]
    return robust_box(finite)


def _toward(around: float, above: float) -> Array:
    """Unit vector from the middle of the box to the eye."""
    turn, rise = math.radians(around), math.radians(above)
    return np.array([math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)])


def _orbiting(
    box: Box, distance: float, width: int, height: int, around: float, above: float, field_of_view: float
) -> Camera:
    centre = (box[0] + box[1]) / 2
    return look_at(
        centre + distance * _toward(around, above),
        centre,
        width=width,
        height=height,
        field_of_view=field_of_view,
        near=distance / 1000,
    )


def _distance(box: Box, width: int, height: int, around: float, above: float, field_of_view: float) -> float:
    """From the middle of a box at which all its corners are in the picture."""
    lower, upper = box
    # A single Gaussian has no box; any size will do.
    size = max(float(np.linalg.norm(upper - lower)), 1e-6 * max(1.0, float(np.abs(upper).max())))
    camera = look_at(_toward(around, above), np.zeros(3), width=width, height=height, field_of_view=field_of_view)
    corners = (np.array(np.meshgrid(*zip(lower, upper))).reshape(3, -1).T - (lower + upper) / 2) @ camera.rotation.T
    across = np.abs(corners[:, 0]) * _MARGIN * 2 * camera.focal_x / width
    down = np.abs(corners[:, 1]) * _MARGIN * 2 * camera.focal_y / height
    return max(float((np.maximum(across, down) - corners[:, 2]).max()), size)
