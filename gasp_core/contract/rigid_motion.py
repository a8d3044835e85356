"""Rigid motions that are prescribed: steady, or given at moments and interpolated between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from gasp_core.contract.shapes import Vector
from gasp_core.contract.validation import finite, finite_vector
from gasp_core.errors import SceneError

__all__ = ["KeyframedMotion", "RigidMotion", "SteadyMotion"]

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyMotion:
    """From `start` to `end` with one velocity and one angular velocity; at rest before and after.

    Parameters
    ----------
    velocity
        Of the center [m/s].
    angular_velocity
        About the center [rad/s].
    center
        Where it is at the start [m].
    start, end
        [s]
    """

    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    center: Vector = (0.0, 0.0, 0.0)
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        for name in ("velocity", "angular_velocity", "center"):
            finite_vector(self, name)
        finite(self, "start", low=0.0)
        if not self.end > self.start:
            raise SceneError(f"SteadyMotion.end must be > start ({self.start!r}), found {self.end!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframedMotion:
    """A place and an orientation at moments; at rest before the first and after the last of them.

    In between the place goes straight and the orientation turns about one axis, both evenly, so that velocities are
    constant from moment to moment. Something that is at x in the scene is at p + R (x - center) at a moment with the
    place p and the orientation R.

    Parameters
    ----------
    times
        Moments [s], rising.
    places
        Where the center is then [m].
    quaternions
        The orientations, (w, x, y, z), of any length but 0; (1, 0, 0, 0) as in the scene.
    center
        What is moved to the places and turned about [m], in the scene.
    """

    times: tuple[float, ...]
    places: tuple[Vector, ...]
    quaternions: tuple[Quaternion, ...]
    center: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        finite_vector(self, "center")
        if not self.times or not len(self.times) == len(self.places) == len(self.quaternions):
            raise SceneError(
                "KeyframedMotion needs as many places and quaternions as times, at least one: found"
                f" {len(self.times)} times, {len(self.places)} places, {len(self.quaternions)} quaternions"
            )
        for number, (time, place, quaternion) in enumerate(zip(self.times, self.places, self.quaternions)):
            if len(place) != 3 or len(quaternion) != 4:
                raise SceneError(f"KeyframedMotion: moment {number} must have 3 numbers as place, 4 as quaternion")
            if not all(math.isfinite(value) for value in (time, *place, *quaternion)):
                raise SceneError(f"KeyframedMotion: moment {number} must have finite numbers")
            if not 1e-150 < math.hypot(*quaternion) < 1e150:
                raise SceneError(f"KeyframedMotion: the quaternion {quaternion} of moment {number} is no rotation")
        for number, (one, other) in enumerate(pairwise(self.times)):
            if not one < other:
                raise SceneError(f"KeyframedMotion.times must rise, moment {number + 1} is at {other!r} after {one!r}")


RigidMotion = SteadyMotion | KeyframedMotion
