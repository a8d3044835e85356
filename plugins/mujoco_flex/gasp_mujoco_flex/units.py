"""The backend's own units: it has absolute tolerances, so a millimetre and a kilometre have to look alike to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Units"]

Array = NDArray[Any]


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
