"""What drives and sticky colliders hold, and where a step takes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, ContactCondition, Drive, Driven, Side
from gasp_core.stepping.forcing import drives_at, rotation_matrix

__all__ = ["TOUCH", "Grip", "grips", "sticking"]

Array = NDArray[Any]

TOUCH = 1e-3
"""In cells: what is this near to a surface counts as on it, however its coordinates were rounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grip:
    """A drive during one step: it takes what is at x in its region to turn x + shift.

    Parameters
    ----------
    drive
        Pinned or driven, and active.
    arm, unturn
        Middle that its region turns about (3,) [m], and rotation (3, 3) back to where the region began.
    turn, shift
        (3, 3), (3,) [m], of the step.
    middle : (3,) [m]
        That it turns about, at the end of the step.
    velocity, spin : (3,) [m/s], [rad/s]
    """

    drive: Drive
    arm: Array
    unturn: Array
    turn: Array
    shift: Array
    middle: Array
    velocity: Array
    spin: Array

    def holds(self, places: Array, room: float) -> Array:
        """Which of the places (N, 3) [m] are in the region, or within `room` [m] of it."""
        if isinstance(self.drive, Driven):
            places = (places - self.arm) @ self.unturn + np.asarray(self.drive.center)
        return self.drive.region.signed_distance(places) <= room

    def taken(self, places: Array) -> Array:
        """Where the step takes places (..., 3) [m]."""
        # What is pinned stays to the last bit.
        return places @ self.turn.T + self.shift if isinstance(self.drive, Driven) else places

    def velocities(self, places: Array) -> Array:
        """Velocities (..., 3) [m/s] of what the step has taken to these places (..., 3) [m]."""
        return self.velocity + np.cross(self.spin, places - self.middle)


def grips(drives: Sequence[Drive], time: float, step: float) -> list[Grip]:
    """Those of the drives that hold something during the step [s] from `time` [s]."""
    found: list[Grip] = []
    for drive in drives_at(drives, time):
        velocity, spin, centre = np.zeros(3), np.zeros(3), np.zeros(3)
        if isinstance(drive, Driven):
            velocity, spin, centre = (np.array(v) for v in (drive.velocity, drive.angular_velocity, drive.center))
        before = centre + velocity * (time - drive.start)
        after = before + velocity * step
        turn = rotation_matrix(spin * step)
        found.append(
            Grip(
                drive=drive,
                arm=before,
                unturn=rotation_matrix(spin * (time - drive.start)),
                turn=turn,
                shift=after - turn @ before,
                middle=after,
                velocity=velocity,
                spin=spin,
            )
        )
    return found


def sticking(colliders: Sequence[Collider], places: Array, room: float) -> Array:
    """Which places (N, 3) [m] touch a sticky collider, to within `room` [m]."""
    touching = np.zeros(len(places), dtype=bool)
    for collider in colliders:
        if collider.contact is ContactCondition.STICK:
            sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
            touching |= sign * collider.shape.signed_distance(places) <= room
    return touching
