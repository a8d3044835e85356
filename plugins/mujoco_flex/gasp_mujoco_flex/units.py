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
    """Lengths and masses of about 1, and an origin near the matter; seconds stay seconds.

    Parameters
    ----------
    origin : (3,) [m]
    length
        [m]
    mass
        [kg]
    """

    origin: Array
    length: float
    mass: float

    def place(self, positions: Array) -> Array:
        """Positions (..., 3) [m] in the backend's frame."""
        return (np.asarray(positions) - self.origin) / self.length
