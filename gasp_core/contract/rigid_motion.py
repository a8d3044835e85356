"""Rigid motions that are prescribed: steady, or given at moments and interpolated between them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

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
        Where the center is then [m]; without them it stays.
    quaternions
        The orientations, (w, x, y, z), of any length but 0; (1, 0, 0, 0) as in the scene, which they are without.
    center
        What is moved to the places and turned about [m], in the scene.
    """

    times: tuple[float, ...]
    places: tuple[Vector, ...] = ()
    quaternions: tuple[Quaternion, ...] = ()
    center: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        finite_vector(self, "center")
        times = _numbers(self.times, "times", 1)
        if len(times) == 0:
            raise SceneError("KeyframedMotion.times must have at least one moment")
        places = _numbers(self.places, "places", 3) if len(self.places) else (self.center,) * len(times)
        upright = ((1.0, 0.0, 0.0, 0.0),) * len(times)
        quaternions = _numbers(self.quaternions, "quaternions", 4) if len(self.quaternions) else upright
        if not len(times) == len(places) == len(quaternions):
            raise SceneError(
                "KeyframedMotion needs as many places and quaternions as times:"
                f" found {len(times)} times, {len(places)} places, {len(quaternions)} quaternions"
            )
        for number, (time, place, quaternion) in enumerate(zip(times, places, quaternions)):
            if not all(math.isfinite(value) for value in (*time, *place, *quaternion)):
                raise SceneError(f"KeyframedMotion: moment {number} must have finite numbers")
            if not 1e-150 < math.hypot(*quaternion) < 1e150:
                raise SceneError(f"KeyframedMotion: the quaternion {quaternion} of moment {number} is no rotation")
        for number, ((one,), (other,)) in enumerate(pairwise(times)):
            if not one < other:
                raise SceneError(f"KeyframedMotion.times must rise, moment {number + 1} is at {other!r} after {one!r}")
        for name, rows in (
            ("times", tuple(time for (time,) in times)),
            ("places", places),
            ("quaternions", quaternions),
        ):
            object.__setattr__(self, name, rows)


def _numbers(values: Iterable[Any], name: str, width: int) -> tuple[tuple[float, ...], ...]:
    """Rows of `width` floats, of tuples as of an array."""
    rows: list[tuple[float, ...]] = []
    for number, value in enumerate(values):
        try:
            row = tuple(float(one) for one in ((value,) if width == 1 else value))
        except (TypeError, ValueError, OverflowError):
            row = ()
        if len(row) != width:
            wanted = "a number" if width == 1 else f"{width} numbers"
            raise SceneError(f"KeyframedMotion.{name}: moment {number} must have {wanted}, found {value!r}")
        rows.append(row)
    return tuple(rows)


RigidMotion = SteadyMotion | KeyframedMotion
