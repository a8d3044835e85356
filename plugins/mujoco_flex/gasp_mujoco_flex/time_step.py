"""How large a step is."""

from __future__ import annotations

import math

from gasp_core.contract import EngineAccuracy

__all__ = ["step_size"]

_FEWEST, _MOST = 10, 40
"""Steps in what one advance asks for. Frames show what happens in them: fewer would damp what they can show. And where
sound crosses a cell faster than so many steps can follow, it is what frames cannot show, and may be damped."""
_FALL = 0.1
"""Of the time in which the largest body falls its own length: an advance that is longer is no reason for longer steps,
by which all that falls or slides is off."""
_CROSSING = 0.3125
"""Of the time in which sound crosses a cell, on top of `substep_fraction`: four steps in all of it by default. Two
would damp a bar of 48 cells by 1 % in a quarter of its period."""
_FLIGHT = 0.5
"""In cells: no node goes further in a step, so that none passes through what is a cell thick."""


def step_size(
    accuracy: EngineAccuracy, *, span: float, size: float, side: float, sound: float, speed: float, acceleration: float
) -> float:
    """The step [s] to take: the override, or what resolves motion, sound and flight.

    Any step is stable, elasticity being implicit in the places; but a mode of angular frequency w loses a share
    w dt / 2 of its amplitude in a radian (backward Euler).

    Parameters
    ----------
    span
        Of the advance [s].
    size
        Of the largest body [m].
    side
        Of the smallest cell [m]; infinite where there is none.
    sound
        Largest speed of sound [m/s].
    speed
        Of the fastest node [m/s].
    acceleration
        Of gravity [m/s^2].
    """
    if accuracy.substep is not None:
        return accuracy.substep
    frame = min(span, _FALL * math.sqrt(2 * size / acceleration)) if acceleration > 0 else span
    crossing = accuracy.substep_fraction * _CROSSING * side / sound if sound > 0 else math.inf
    way = _FLIGHT * side
    rate = speed + math.sqrt(speed**2 + 4 * acceleration * way) if math.isfinite(way) else 0.0
    flight = 2 * way / rate if rate > 0 else math.inf
    return min(frame / _FEWEST, max(crossing, frame / _MOST), flight)
