"""What a body of points weighs against turning, and how it turns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["inertia_of_cubes", "shown_spin"]

Array = NDArray[Any]

_ALONE = 1e-9
"""Of the largest moment that points show about their centre: what turns less is not seen to turn at all."""


def inertia_of_cubes(masses: Array, arms: Array, volumes: Array) -> Array:
    """Inertia (3, 3) [kg m^2] about a point from which cubes of these volumes (N,) [m^3] are at `arms` (N, 3) [m].

    Cubes and not points, so that even one alone has an inertia.
    """
    return _of_points(masses, arms) + masses @ np.cbrt(volumes) ** 2 / 6 * np.eye(3)


def shown_spin(masses: Array, arms: Array, velocities: Array) -> Array:
    """Angular velocity (3,) [rad/s] of the rigid motion with the angular momentum that points show.

    The spin of a cube about itself is not seen in the velocity of its point: what the points show is kept.

    Parameters
    ----------
    masses : (N,) [kg]
    arms : (N, 3) [m]
        From the centre of mass.
    velocities : (N, 3) [m/s]
        Relative to it.
    """
    turning = np.einsum("n,ni->i", masses, np.cross(arms, velocities))
    return np.linalg.lstsq(_of_points(masses, arms), turning, rcond=_ALONE)[0]


def _of_points(masses: Array, arms: Array) -> Array:
    squares = np.einsum("n,ni,nj->ij", masses, arms, arms)
    return np.trace(squares) * np.eye(3) - squares
