"""From the world to the units the browser works in.

viser's keyboard steps, near plane and orbit limits are fixed lengths, made for things about 1 across, and the GPU knows
positions in single precision. So whatever is shown, a beetle or a mountain 1e4 m away, is moved to the origin
and scaled to one size.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.rendering.footage import Footage
from gasp_core.rendering.framing import Motion, frame_motion, motion_of
from gasp_core.scene.settings import CameraChoice

__all__ = ["SIZE", "Stage", "View", "shown_motion", "three_quarter"]

Array = NDArray[Any]

_LOOKED_AT = 24
"""Frames whose extent is measured: motion is smooth, and reading all of a long recording takes its time."""

SIZE = 2.5
"""Diagonal of the box that is shown, in the browser's units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """browser = unit * (world - origin).

    Parameters
    ----------
    origin : (3,) [m]
        Middle of what is shown.
    unit
        The browser's units in a metre.
    """

    origin: Array
    unit: float

    @classmethod
    def of(cls, motion: Motion) -> Stage:
        """The stage on which the box around a motion has the diagonal `SIZE`."""
        return cls(origin=motion.centre, unit=SIZE / motion.reach)

    def place(self, points: Array) -> Array:
        """Points (..., 3) of the world on the stage, float64."""
        return (np.asarray(points, dtype=np.float64) - self.origin) * self.unit

    def world(self, points: Array) -> Array:
        """Points (..., 3) of the stage in the world [m]."""
        return np.asarray(points, dtype=np.float64) / self.unit + self.origin


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where the browser's camera stands at first, in the world.

    Parameters
    ----------
    eye, target : (3,) [m]
    field_of_view
        Vertical [rad].
    """

    eye: Array
    target: Array
    field_of_view: float


def shown_motion(footage: Footage, frame: int) -> Motion:
    """Where matter goes over the frames there are, with room for the size of the Gaussians themselves.

    Parameters
    ----------
    footage
        Damaged frames are passed over.
    frame
        One that is not.
    """
    motions = [motion_of(footage, [frame])]
    for other in np.unique(np.linspace(0, footage.frame_count - 1, _LOOKED_AT).round().astype(int)):
        with suppress(RecordingError):
            motions.append(motion_of(footage, [int(other)]))
    motion = Motion.joined(motions)
    splats = footage.splats(frame)
    if splats.covariances is not None:
        largest = np.sqrt(splats.covariances[:, [0, 3, 5]].max(axis=1))
    else:
        assert splats.scales is not None  # RenderInput refuses to have neither
        largest = splats.scales.max(axis=1)
    # To the means, a single Gaussian is a point.
    room = float(np.median(largest))
    corners = np.array([motion.lower - room, motion.upper + room])
    return Motion.joined([motion, Motion(points=corners, frames=np.full(2, frame))])


def three_quarter(motion: Motion) -> View:
    """The view of a motion from its front right, a little from above."""
    around, above = CameraChoice().direction
    # A square picture: what fits into it fits into every browser window that is wider than high.
    camera = frame_motion(motion, width=1000, height=1000, around=around, above=above)
    forward = camera.rotation[2]
    return View(
        eye=camera.position,
        # What the mouse turns about is in the middle of the picture and as far away as the motion.
        target=camera.position + ((motion.centre - camera.position) @ forward) * forward,
        field_of_view=math.radians(camera.field_of_view),
    )
