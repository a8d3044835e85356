"""Motions with a formula, of a splat that stands still."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.scene.motions import Bend, Motion, Swing, Wave

__all__ = ["AnalyticMotion", "analytic_motion"]

Array = NDArray[Any]
_Field = Callable[[Array, float], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalyticMotion:
    """A field (points (M, 3), scene time) -> (M, 3), applied to every vertex at rest (N, V, 3)."""

    rest: Array
    field: _Field
    step: float
    span: tuple[float, float] = (-math.inf, math.inf)

    def __len__(self) -> int:
        return len(self.rest)

    def simplices(self, time: float) -> Array:
        """See `SceneMotion`."""
        return self.field(self.rest.reshape(-1, 3), time).reshape(self.rest.shape)


def analytic_motion(choice: Motion, rest: Array, origin: Array) -> AnalyticMotion | None:
    """The motion that a choice asks for; None where it has no formula.

    Parameters
    ----------
    choice
        In world coordinates.
    rest : (N, V, 3) [m]
        The simplices, about the origin.
    origin : (3,) [m]
        In the world.
    """
    if isinstance(choice, Swing):
        pivot, axis = np.asarray(choice.pivot) - origin, np.asarray(choice.axis)
        share = _bending(choice, pivot) if isinstance(choice, Bend) else _whole

        def swing(points: Array, time: float) -> Array:
            angle = math.radians(choice.amplitude) * _phase(choice, time)
            return pivot + _turned(points - pivot, axis, angle * share(points))

        return AnalyticMotion(rest=rest, field=swing, step=_step(choice.frequency))
    if isinstance(choice, Wave):
        pivot, axis, direction = np.asarray(choice.pivot) - origin, np.asarray(choice.axis), choice.direction

        def wave(points: Array, time: float) -> Array:
            turns = choice.frequency * time - (points - pivot) @ np.asarray(direction) / choice.wavelength
            heights = choice.amplitude * np.sin(2 * math.pi * turns + math.radians(choice.phase))
            return points + heights[:, None] * axis

        return AnalyticMotion(rest=rest, field=wave, step=_step(choice.frequency))
    return None


def _step(frequency: float) -> float:
    """Of a difference that is off by (2 pi 1e-4)^2 / 6 = 7e-8 of the velocity."""
    return 1e-4 / frequency


def _phase(choice: Swing, time: float) -> float:
    return math.sin(2 * math.pi * choice.frequency * time + math.radians(choice.phase))


def _whole(points: Array) -> Array:
    return np.ones(len(points))


def _bending(choice: Bend, pivot: Array) -> Callable[[Array], Array]:
    direction = np.asarray(choice.direction) / choice.length
    return lambda points: np.maximum((points - pivot) @ direction, 0.0) ** 2


def _turned(arms: Array, axis: Array, angles: Array) -> Array:
    """Arms (M, 3) turned about an axis (3,) by angles (M,) [rad]: Rodrigues' formula."""
    cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
    along = (arms @ axis)[:, None] * axis
    return along + cosines * (arms - along) + sines * np.cross(axis, arms)
