"""How a body has moved as a whole: the rigid motion that is nearest to its points, frame by frame."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gasp_core.contract import KeyframedMotion
from gasp_core.errors import RecordingError
from gasp_core.recording.places import places_at, places_at_start
from gasp_core.recording.reader import Recording

__all__ = ["RigidFit", "rigid_fit"]

Array = NDArray[Any]

_THIN = 1e-3
"""Second largest extent of a body's points over the largest; below it they lie on a line and show no turn about it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidFit:
    """Six numbers a frame: a point of the body that was at X at the start is at p + R (X - c).

    Parameters
    ----------
    times : (F,) [s]
        Of the frames that are there.
    center : (3,) [m]
        c, the mean of the body's points at the start; of one that moves by itself as well, of its Gaussians.
    places : (F, 3) [m]
        p, that mean in each frame.
    quaternions : (F, 4)
        R as (w, x, y, z), of length 1; (1, 0, 0, 0) as at the start. From frame to frame the sign does not jump.
    residuals : (F,) [m]
        Root mean square of what the points are off by: what float32 rounds to, where the body is rigid; how far it is
        deformed, where it is not.
    """

    times: Array
    center: Array
    places: Array
    quaternions: Array
    residuals: Array

    def as_motion(self) -> KeyframedMotion:
        """The same as a motion that a collider may be given."""
        return KeyframedMotion(
            times=tuple(self.times.tolist()),
            places=tuple((x, y, z) for x, y, z in self.places.tolist()),
            quaternions=tuple((w, x, y, z) for w, x, y, z in self.quaternions.tolist()),
            center=(float(self.center[0]), float(self.center[1]), float(self.center[2])),
        )


def rigid_fit(recording: Recording, name: str) -> RigidFit:
    """The rigid motion nearest to a body's points in the sense of least squares (Kabsch 1976), in every frame there is.

    Of what moves by itself as well (`Motion`), points are without that: then to its Gaussians, which is what is seen.

    Raises
    ------
    RecordingError
        Where no object of that name moves, its points lie on a line, or a frame is damaged.
    """
    starts = places_at_start(recording)
    if name not in starts:
        moving = ", ".join(starts) or "none"
        raise RecordingError(f'{recording.path}: nothing of the name "{name}" moves; what moves: {moving}')
    center = starts[name].mean(0)
    arms = starts[name] - center
    extents = np.linalg.svd(arms, compute_uv=False)
    if len(extents) < 2 or not extents[1] > _THIN * extents[0]:
        raise RecordingError(f'{recording.path}: the points of "{name}" lie on a line, which shows no turn about it')
    frames = sorted({*range(recording.frame_count)} - set(recording.lost))
    places, quaternions, residuals = np.empty((len(frames), 3)), np.empty((len(frames), 4)), np.empty(len(frames))
    for row, frame in enumerate(frames):
        moved = places_at(recording, frame, [name])[name]
        places[row] = moved.mean(0)
        with warnings.catch_warnings():
            # Of what is crushed to a line in some frame.
            warnings.simplefilter("ignore", UserWarning)
            turn, distance = Rotation.align_vectors(moved - places[row], arms)[:2]
        quaternions[row] = np.roll(turn.as_quat(), 1)
        if quaternions[row] @ (quaternions[row - 1] if row else (1.0, 0.0, 0.0, 0.0)) < 0:
            quaternions[row] *= -1
        residuals[row] = distance / np.sqrt(len(arms))
    return RigidFit(
        times=recording.times[frames], center=center, places=places, quaternions=quaternions, residuals=residuals
    )
