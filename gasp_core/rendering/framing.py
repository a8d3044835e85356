"""Cameras that see all of a motion without being told where to stand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.footage import Footage
from gasp_core.scene.placement import robust_box

__all__ = ["VIEWS", "Motion", "frame_motion", "motion_of", "turntable"]

Array = NDArray[Any]

VIEWS: dict[str, tuple[float, float]] = {
    "three-quarter": (35.0, 18.0),
    "front": (0.0, 8.0),
    "right": (90.0, 8.0),
    "back": (180.0, 8.0),
    "left": (270.0, 8.0),
    "top": (0.0, 89.0),
}
"""Views by name: degrees around from the front (seen along +y) to the right, and degrees above the horizon."""

_MARGIN = 1.08
_FIELD_OF_VIEW = 35.0
_FRAMES = 24
"""Frames whose extent is measured: motion is smooth, and reading all of a long recording takes its time."""
_POINTS = 4_000
"""Of a frame: what a picture's edge cuts off beside them cannot be seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Where matter goes, but for what is outermost.

    Parameters
    ----------
    points : (M, 3) [m]
        A sample of all places.
    """

    points: Array

    @property
    def lower(self) -> Array:
        """Lower corner of the box around them, (3,)."""
        return self.points.min(axis=0)

    @property
    def upper(self) -> Array:
        """Upper corner."""
        return self.points.max(axis=0)

    @property
    def centre(self) -> Array:
        """Middle of the box."""
        return (self.lower + self.upper) / 2

    @property
    def reach(self) -> float:
        """Length of the box's diagonal [m], more than nothing even for one point."""
        return max(float(np.linalg.norm(self.upper - self.lower)), 1e-6 * max(1.0, float(np.abs(self.upper).max())))

    def moved(self, shift: Array) -> Motion:
        """The same, and as much again elsewhere."""
        return Motion(points=np.concatenate([self.points, self.points + shift]))


def motion_of(footage: Footage, frames: Sequence[int] | None = None) -> Motion:
    """Where the matter of frames (all there are) goes, each but for its outermost thousandths.

    Raises
    ------
    RenderingError
        Where there is no frame yet, or nothing in them is where it could be seen.
    """
    chosen = range(footage.frame_count) if frames is None else frames
    if len(chosen) == 0:
        raise RenderingError(f"{footage.path}: holds no frame yet")
    picked = sorted({chosen[round(k)] for k in np.linspace(0, len(chosen) - 1, min(len(chosen), _FRAMES))})
    points = np.concatenate([_core(footage.positions(frame)) for frame in picked])
    if len(points) == 0:
        raise RenderingError(f"{footage.path}: nothing in it has a finite place: there is nothing to see")
    return Motion(points=points)


def frame_motion(motion: Motion, *, width: int, height: int, around: float, above: float) -> Camera:
    """A camera that sees all of a motion.

    Parameters
    ----------
    motion
        What is to be in the picture.
    width, height [px]
        Of the picture.
    around, above [degrees]
        From the front to the right, and over the horizon.
    """
    toward = _toward(around, above)
    aim, distance = motion.centre, motion.reach
    # Nearer things look larger: the middle of what is seen is found from where it is seen.
    for _ in range(3):
        distance = _distance(motion, aim, toward, width, height)
        camera = _orbiting(aim, toward, distance, width, height)
        seen = (motion.points - camera.position) @ camera.rotation.T
        slopes = seen[:, :2] / seen[:, 2:]
        middle = (slopes.min(axis=0) + slopes.max(axis=0)) / 2
        aim = aim + (distance * middle) @ camera.rotation[:2]
    return _orbiting(aim, toward, _distance(motion, aim, toward, width, height), width, height)


def turntable(motion: Motion, count: int, *, width: int, height: int, around: float, above: float) -> list[Camera]:
    """As many cameras as there are pictures, once around a motion at a distance from which it fits from everywhere."""
    aim = motion.centre
    distance = max(
        _distance(motion, aim, _toward(float(turn), above), width, height) for turn in np.arange(0.0, 360.0, 15.0)
    )
    turns = [around + 360.0 * k / max(count, 1) for k in range(count)]
    return [_orbiting(aim, _toward(turn, above), distance, width, height) for turn in turns]


def _core(positions: Array) -> Array:
    """A sample of the positions that are not outermost."""
    # What flew apart has no place in this frame; those that do are what there is to see.
    positions = positions[np.isfinite(positions).all(axis=1)]
    if len(positions) == 0:
        return positions
    positions = positions[:: max(1, len(positions) // _POINTS)]
    lower, upper = robust_box(positions)
    return positions[((positions >= lower) & (positions <= upper)).all(axis=1)]


def _toward(around: float, above: float) -> Array:
    """Unit vector from what is looked at to the eye."""
    turn, rise = math.radians(around), math.radians(above)
    return np.array([math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)])


def _orbiting(aim: Array, toward: Array, distance: float, width: int, height: int) -> Camera:
    return look_at(
        aim + distance * toward,
        aim,
        width=width,
        height=height,
        field_of_view=_FIELD_OF_VIEW,
        near=distance / 1000,
    )


def _distance(motion: Motion, aim: Array, toward: Array, width: int, height: int) -> float:
    """From what is looked at, at which all points are in the picture."""
    camera = _orbiting(np.zeros(3), toward, 1.0, width, height)
    points = (motion.points - aim) @ camera.rotation.T
    across = np.abs(points[:, 0]) * _MARGIN * 2 * camera.focal_x / width
    down = np.abs(points[:, 1]) * _MARGIN * 2 * camera.focal_y / height
    return max(float((np.maximum(across, down) - points[:, 2]).max()), 0.1 * motion.reach)
