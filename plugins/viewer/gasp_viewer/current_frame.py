"""A frame of a footage: each part is read when it is asked for, and once."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import GaspError, RenderingError
from gasp_core.games import choose_vertices, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.recording.drawn import Drawn
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import Footage, RecordedFootage
from gasp_core.rendering.moving_footage import MovingFootage

__all__ = ["Moment", "finite_difference", "first_readable"]

Array = NDArray[Any]


class Moment:
    """A frame of a footage.

    Parameters
    ----------
    footage, frame
        Which.
    """

    def __init__(self, footage: Footage, frame: int) -> None:
        self._footage = footage
        self.frame = frame

    @cached_property
    def splats(self) -> RenderInput:
        """The N Gaussians, in every frame the same ones."""
        return self._footage.splats(self.frame)

    @cached_property
    def drawn(self) -> Drawn:
        """These, and grains of what has flowed."""
        if isinstance(self._footage, RecordedFootage | MovingFootage):
            return self._footage.drawn_frames.at(self.frame)
        return Drawn(splats=self.splats, sources=np.arange(len(self.splats)))

    @cached_property
    def simplices(self) -> list[Array]:
        """Simplices (N_b, V_b, 3) [m], body by body; of a file, those of all its Gaussians."""
        if isinstance(self._footage, RecordedFootage):
            return list(self._footage.recording.simplices(self.frame).values())
        splats = self.splats
        assert splats.quaternions is not None and splats.scales is not None  # files hold both
        gaussians = Gaussians(
            means=splats.means,
            quaternions=splats.quaternions,
            scales=splats.scales,
            opacities=splats.opacities,
            harmonics=splats.harmonics,
        )
        # As many in every frame: what is flat in one need not be in another.
        return [to_simplices(gaussians, choose_vertices(gaussians) if self._footage.frame_count == 1 else 4)]

    @cached_property
    def points(self) -> Array:
        """The engine's points, (P, 3) [m]; of a file, none."""
        return self._footage.recording.points(self.frame) if isinstance(self._footage, RecordedFootage) else _NONE

    @cached_property
    def displacements(self) -> Array:
        """How far the engine's points are from where they started, (P,) [m]."""
        if not isinstance(self._footage, RecordedFootage):
            return _NONE[:, 0]
        return np.linalg.norm(self.points - self._footage.recording.start_points, axis=1)

    @cached_property
    def speeds(self) -> Array:
        """Speeds of the engine's points, (P,) [m/s]: recorded, or else the mean ones since the frame before.

        At frame 0, those until frame 1; zero where there is none.
        """
        if not isinstance(self._footage, RecordedFootage):
            return _NONE[:, 0]
        recording = self._footage.recording
        if recording.has_velocities:
            return np.linalg.norm(recording.velocities(self.frame).astype(np.float64), axis=1)
        if self.frame > 0:
            return finite_difference(recording.points(self.frame - 1), self.points, self._footage.frame_rate)
        if self._footage.frame_count > 1:
            return finite_difference(self.points, recording.points(1), self._footage.frame_rate)
        return np.zeros(len(self.points))


def first_readable(footage: Footage) -> int:
    """The first frame that is not damaged: what is the same in every frame is taken from it.

    Raises
    ------
    RecordingError
        Of the first frame, where all are damaged.
    """
    faults: list[GaspError] = []
    for frame in range(footage.frame_count):
        try:
            footage.splats(frame)
        except GaspError as fault:
            faults.append(fault)
        else:
            return frame
    if faults:
        raise faults[0]
    raise RenderingError(f"{footage.path}: holds no frame yet")


def finite_difference(before: Array, after: Array, frame_rate: float) -> Array:
    """Mean speeds (P,) [m/s] of points (P, 3) [m] from one frame to the next.

    Off by at most half of the largest acceleration times the time between the frames from the speed at either.
    """
    return np.linalg.norm(after - before, axis=1) * frame_rate


_NONE = np.zeros((0, 3))
