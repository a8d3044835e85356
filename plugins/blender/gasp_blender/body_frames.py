"""What each body does as a whole, in float64 and outside Blender, which steps the rest.

Blender keeps places and velocities in float32: at a speed of a hundredth of a voxel a step, thirty voxels from where it
started, each step is rounded by a ten-thousandth, mostly the same way. So each body is stepped about an origin of its
own that flies and falls with it. Springs pull one end as much as they pull the other: what Blender's rounding adds to
the momentum of a body, or takes from it, is given back to its origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Frames"]

Array = NDArray[Any]

_OFF = 0.25
"""In voxels: a body whose middle is farther from its origin is moved back to it when it is next written."""


@dataclass(slots=True)
class Frames:
    """Origins of bodies.

    Parameters
    ----------
    bodies : (V,)
        Of nodes, 0 to B - 1.
    masses : (V,)
        Of nodes, in any unit.
    places : (B, 3) [m]
    velocities : (B, 3) [m/s]
    length
        A voxel [m].
    unit
        Blender's unit of time [s].
    """

    bodies: Array
    masses: Array
    places: Array
    velocities: Array
    length: float
    unit: float

    def places_of(self, state: Array) -> Array:
        """Of nodes [m], (V, 3), in a state (V, 6) in voxels and voxels per unit of time."""
        return state[:, :3].astype(np.float64) * self.length + self.places[self.bodies]

    def velocities_of(self, state: Array) -> Array:
        """Of nodes [m/s], (V, 3)."""
        return state[:, 3:].astype(np.float64) * (self.length / self.unit) + self.velocities[self.bodies]

    def place_within(self, places: Array, rows: Array) -> Array:
        """Places [m] (R, 3) of nodes `rows` as Blender has them."""
        return (places - self.places[self.bodies[rows]]) / self.length

    def velocity_within(self, velocities: Array, rows: Array) -> Array:
        """Velocities [m/s] (R, 3) of nodes `rows` as Blender has them."""
        return (velocities - self.velocities[self.bodies[rows]]) * (self.unit / self.length)

    def fly(self, before: Array, after: Array, gravity: Array, step: float) -> None:
        """A step [s] of the origins, in which Blender has made one state (V, 6) of another by inner forces.

        The middle of a body goes as symplectic Euler has it: v' = v + g dt, x' = x + v' dt.
        """
        middle, end = self._means(before), self._means(after)
        speed = self.length / self.unit
        velocities = self.velocities + middle[:, 3:] * speed + gravity * step
        self.places = self.places + (middle[:, :3] - end[:, :3]) * self.length + velocities * step
        self.velocities = velocities - end[:, 3:] * speed

    def recentred(self, state: Array) -> Array:
        """The same state about origins that have gone over to the middles of their bodies."""
        middle = self._means(state)
        middle[:, :3] *= np.abs(middle[:, :3]) > _OFF
        moved = (state - middle[self.bodies]).astype(np.float32)
        # What was really taken, rounding included.
        taken = self._means(state.astype(np.float64) - moved)
        self.places = self.places + taken[:, :3] * self.length
        self.velocities = self.velocities + taken[:, 3:] * (self.length / self.unit)
        return moved

    def _means(self, state: Array) -> Array:
        """Of bodies (B, 6), weighted by mass."""
        count = len(self.places)
        sums = [np.bincount(self.bodies, self.masses * column, count) for column in state.T]
        return np.stack(sums, axis=1) / np.bincount(self.bodies, self.masses, count)[:, None]
