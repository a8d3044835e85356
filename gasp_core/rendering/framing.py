"""Where matter goes, and from where the points of it are in a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.footage import Moving
from gasp_core.scene.placement import robust_box

__all__ = [
    "Motion",
    "as_near_as_may_be",
    "direction",
    "distance_for",
    "frame_motion",
    "framed",
    "motion_of",
    "orbiting",
]

Array = NDArray[Any]

_MARGIN = 1.15
"""Half a picture over how far from its middle matter may come: a twentieth at each edge, and a little for rounding."""
_FIELD_OF_VIEW = 35.0
_NEAREST = 2e-3
"""Of what is looked at, that it stays away from it at the least."""
_AS_NEAR = 1.5
"""Times as far: what is seen of points is as far away as they are, but for a pixel and for what is in front."""
_FRAMES = 48
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
    frames : (M,)
        Numbers of the frames they are in.
    """

    points: Array
    frames: Array

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
        return _reach(self.lower, self.upper)

    @property
    def size(self) -> float:
        """Largest diagonal [m] of the box of a single frame."""
        return max(float(np.linalg.norm(np.ptp(cloud, axis=0))) for cloud in self.clouds().values())

    def clouds(self) -> dict[int, Array]:
        """Points of each frame, by its number."""
        return {int(frame): self.points[self.frames == frame] for frame in np.unique(self.frames)}

    def later(self, frames: int) -> Motion:
        """The same, in frames that have numbers higher by so much."""
        return Motion(points=self.points, frames=self.frames + frames)

    @staticmethod
    def joined(motions: Sequence[Motion]) -> Motion:
        """All of several."""
        return Motion(
            points=np.concatenate([motion.points for motion in motions]),
            frames=np.concatenate([motion.frames for motion in motions]),
        )


def motion_of(footage: Moving, frames: Sequence[int] | None = None) -> Motion:
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
    clouds = [_core(footage.positions(frame)) for frame in picked]
    points = np.concatenate(clouds)
    if len(points) == 0:
        raise RenderingError(f"{footage.path}: nothing in it has a finite place: there is nothing to see")
    return Motion(points=points, frames=np.repeat(picked, [len(cloud) for cloud in clouds]))


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
    return framed(motion.points, direction(around, above), width=width, height=height)


def framed(points: Array, toward: Array, *, width: int, height: int) -> Camera:
    """The nearest camera that has points (N, 3) of the world in the middle of its picture, looking against `toward`.

    A point is in the picture where |x - e_x| <= s_x (z - e_z), and so in y, with the eye e and the slopes s of what
    counts as its middle. All are where e_x - s_x e_z >= max(x - s_x z) and e_x + s_x e_z <= min(x + s_x z).
    """
    turned = orbiting(np.zeros(3), toward, 1.0, width, height)
    seen = points @ turned.rotation.T
    slopes = np.array([width / turned.focal_x, height / turned.focal_y]) / (2 * _MARGIN)
    above = (seen[:, :2] - slopes * seen[:, 2:]).max(axis=0)
    below = (seen[:, :2] + slopes * seen[:, 2:]).min(axis=0)
    nearest, farthest = float(seen[:, 2].min()), float(seen[:, 2].max())
    reach = _reach(points.min(axis=0), points.max(axis=0))
    ahead = min(float(((below - above) / (2 * slopes)).min()), nearest - _NEAREST * reach)
    eye = np.array([*(above + below) / 2, ahead])
    distance = (nearest + farthest) / 2 - ahead
    return orbiting((eye + [0.0, 0.0, distance]) @ turned.rotation, toward, distance, width, height)


def as_near_as_may_be(camera: Camera, points: Array) -> bool:
    """Whether `framed` lets a camera come no nearer to points (N, 3), or to what is seen of them."""
    depths = camera.project(points)[1]
    return float(depths.min()) <= _AS_NEAR * _NEAREST * _reach(points.min(axis=0), points.max(axis=0))


def _reach(lower: Array, upper: Array) -> float:
    """Diagonal of a box, more than nothing even of a point."""
    return max(float(np.linalg.norm(upper - lower)), 1e-6 * max(1.0, float(np.abs(upper).max())))


def _core(positions: Array) -> Array:
    """A sample of the positions that are not outermost."""
    # What flew apart has no place in this frame; those that do are what there is to see.
    positions = positions[np.isfinite(positions).all(axis=1)]
    if len(positions) == 0:
        return positions
    positions = positions[:: max(1, len(positions) // _POINTS)]
    lower, upper = robust_box(positions)
    return positions[((positions >= lower) & (positions <= upper)).all(axis=1)]


def direction(around: float, above: float) -> Array:
    """Unit vector from what is looked at to the eye, at angles [degrees] as in `gasp_core.scene.settings.VIEWS`."""
    turn, rise = math.radians(around), math.radians(above)
    return np.array([math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)])


def orbiting(aim: Array, toward: Array, distance: float, width: int, height: int) -> Camera:
    """A camera at a distance from what it looks at, toward a unit vector from it."""
    return look_at(
        aim + distance * toward,
        aim,
        width=width,
        height=height,
        field_of_view=_FIELD_OF_VIEW,
        near=distance / 1000,
    )


def distance_for(points: Array, aim: Array, toward: Array, width: int, height: int) -> float:
    """From what is looked at [m], at which points (N, 3) are all in the middle of the picture."""
    camera = orbiting(np.zeros(3), toward, 1.0, width, height)
    seen = (points - aim) @ camera.rotation.T
    across = np.abs(seen[:, 0]) * _MARGIN * 2 * camera.focal_x / width
    down = np.abs(seen[:, 1]) * _MARGIN * 2 * camera.focal_y / height
    return float((np.maximum(across, down) - seen[:, 2]).max())
