"""What moves by itself: the protocol, and what all that follow it have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.scene.placement import Placement

__all__ = ["PlacedMotion", "SceneMotion", "velocities"]

Array = NDArray[Any]


class SceneMotion(Protocol):
    """psi: simplices of N Gaussians at any scene time. Row n is the same Gaussian, vertex v the same one, always."""

    @property
    def span(self) -> tuple[float, float]:
        """First and last scene time [s] that may be asked for; infinite where there is no end."""
        ...

    @property
    def step(self) -> float:
        """Scene time [s] over which a difference of simplices gives their velocity."""
        ...

    def __len__(self) -> int:
        """N."""
        ...

    def simplices(self, time: float) -> Array:
        """Simplices (N, V, 3) float64 at a scene time [s] within the span.

        Raises
        ------
        SceneError, SplatFormatError
            Where there are none, with the time.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedMotion:
    """Some rows of a motion in the frame of its file, put into the world but for the translation [m]."""

    motion: SceneMotion
    rows: Array
    placement: Placement

    @property
    def span(self) -> tuple[float, float]:
        """See `SceneMotion`."""
        return self.motion.span

    @property
    def step(self) -> float:
        """See `SceneMotion`."""
        return self.motion.step

    def __len__(self) -> int:
        return len(self.rows)

    def simplices(self, time: float) -> Array:
        """See `SceneMotion`."""
        return self.motion.simplices(time)[self.rows] @ (self.placement.scale * self.placement.rotation.T)


def velocities(motion: SceneMotion, time: float) -> Array:
    """dpsi/ds (N, V, 3) at a scene time [s]: a central difference, one-sided at an end of the span.

    Zero where the span is a single time.
    """
    first, last = motion.span
    before, after = max(time - motion.step, first), min(time + motion.step, last)
    if not after > before:
        return np.zeros_like(motion.simplices(time))
    return (motion.simplices(after) - motion.simplices(before)) / (after - before)
