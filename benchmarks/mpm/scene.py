"""The scene of the comparison: a cube of jittered points, eight a cell, that flies, twists and swells above a floor.

NumPy alone, so that every engine's own environment can make it. The cube fills the middle of a unit box; nothing
reaches a wall while it is timed, so that engines with other walls do the same work and end in the same place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "DENSITY",
    "GRAVITY",
    "POISSONS_RATIO",
    "STEP",
    "YOUNGS_MODULUS",
    "jittered_cube",
    "points_per_axis",
    "velocities_of",
]

Array = NDArray[Any]

STEP = 1e-4
DENSITY, YOUNGS_MODULUS, POISSONS_RATIO = 1000.0, 1e5, 0.2
GRAVITY = (0.0, 0.0, -9.81)
_MARGIN = 5
"""Cells between the cube and the box: engines with a fixed box keep some for their walls."""


def points_per_axis(points: int, cells: int) -> int:
    """Points along a side of the cube of about so many points, as far as it fits a box of `cells` cells."""
    return min(round(points ** (1 / 3)), 2 * (cells - 2 * _MARGIN))


def jittered_cube(points: int, cells: int) -> Array:
    """Positions (N, 3) [m], N about `points`, two along every axis of a cell of 1/`cells` m."""
    side = points_per_axis(points, cells)
    index = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    offset = np.random.default_rng(0).uniform(-0.3, 0.3, index.shape)
    return ((index + 0.5 + offset) - side / 2) / (2 * cells) + 0.5


def velocities_of(positions: Array) -> Array:
    """(N, 3) [m/s]: a fall at 1 m/s, a turn and a stretch."""
    rates = np.array([[2.0, -3.0, 0.0], [3.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    return (positions - 0.5) @ rates.T + np.array([0.0, 0.0, -1.0])
