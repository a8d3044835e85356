"""How much matter an impulse strikes: soft and rigid bodies share it in proportion to their mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Impulse, PointProblem

__all__ = ["Struck"]

Array = NDArray[Any]


class _Part(Protocol):
    def positions(self) -> Array: ...


class Struck:
    """Mass in the region of each impulse of a problem, as it strikes.

    Parameters
    ----------
    problem
        With its drives.
    """

    def __init__(self, problem: PointProblem) -> None:
        self._problem = problem
        self._parts: Sequence[tuple[Array, _Part]] = ()
        self.masses: Array = np.full(len(problem.drives), np.nan)
        """By drive [kg]; NaN before it strikes."""

    def look_at(self, parts: Sequence[tuple[Array, _Part]]) -> None:
        """Where the matter is: parts, with the rows of their points."""
        self._parts = parts

    def kick(self, number: int, impulse: Impulse) -> Array:
        """Velocity (3,) [m/s] that it gives what it strikes; asked for before any part has moved on."""
        if np.isnan(self.masses[number]):
            masses = self._problem.masses
            self.masses[number] = sum(
                float(masses[rows][impulse.region.signed_distance(part.positions()) <= 0].sum())
                for rows, part in self._parts
            )
        mass = float(self.masses[number])
        return np.asarray(impulse.impulse) / mass if mass > 0 else np.zeros(3)
