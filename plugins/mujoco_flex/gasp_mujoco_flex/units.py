"""The backend's own units: it has absolute tolerances, so a millimetre and a kilometre have to look alike to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.simulation.monitor import sound_speed
from gasp_mujoco_flex.cage import Cage
from gasp_mujoco_flex.rigid import RigidBody

__all__ = ["Units", "fastest_sound", "units_of"]

Array = NDArray[Any]

_SLOWEST = 1e4
"""Times in which sound crosses the largest body, at most, in the unit of time: stiffness is then within bounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """Lengths, masses and accelerations of about 1, and an origin near the matter.

    Parameters
    ----------
    origin : (3,) [m]
    length
        [m]
    mass
        [kg]
    time
        [s]
    """

    origin: Array
    length: float
    mass: float
    time: float

    @property
    def speed(self) -> float:
        """[m/s]"""
        return self.length / self.time

    @property
    def acceleration(self) -> float:
        """[m/s^2]"""
        return self.speed / self.time

    @property
    def force(self) -> float:
        """[N]"""
        return self.mass * self.acceleration

    def place(self, positions: Array) -> Array:
        """Positions (..., 3) [m] in the backend's frame."""
        return (np.asarray(positions) - self.origin) / self.length


def units_of(problem: PointProblem, cages: Sequence[Cage], bodies: Sequence[RigidBody]) -> Units:
    """The largest body is 1 long, and a mean node or body has mass 1; it falls with 1, or sound crosses it in 1."""
    clouds = [part.matter.positions for part in (*cages, *bodies)]
    low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0)
    high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0)
    lengths = [float((cage.grid.sides * cage.grid.shape).max()) for cage in cages]
    lengths += [float(np.cbrt(body.matter.volumes.sum())) for body in bodies]
    masses = np.concatenate([*(cage.masses for cage in cages), [body.matter.mass for body in bodies]])
    length, gravity, sound = max(lengths), math.hypot(*problem.gravity), fastest_sound(problem)
    crossing = length / sound if sound > 0 else 1.0
    time = min(math.sqrt(length / gravity), _SLOWEST * crossing) if gravity > 0 else crossing
    return Units(origin=(low + high) / 2, length=length, mass=float(masses.mean()), time=time)


def fastest_sound(problem: PointProblem) -> float:
    """Of what a scene is made of [m/s]; 0 where nothing in it has a speed of sound."""
    used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
    return max((speed for speed in map(sound_speed, used) if math.isfinite(speed)), default=0.0)
