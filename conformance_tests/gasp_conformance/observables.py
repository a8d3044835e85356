"""What is read off point positions and velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit

__all__ = [
    "Arc",
    "Oscillation",
    "angular_momentum",
    "damped_oscillation",
    "flights",
    "half_height_width",
    "kinetic_energy",
    "mode_amplitude",
    "observed_order",
]

Array = NDArray[Any]

_FEWEST_FRAMES = 8
"""A parabola has three numbers, and a flight of a few frames more would fit any."""


class Arc:
    """A parabola z = peak - g (t - t_peak)^2 / 2 through a flight.

    Parameters
    ----------
    times : (F,) [s]
    heights : (F,) [m]
    """

    def __init__(self, times: Array, heights: Array) -> None:
        middle = float(times.mean())
        square, slope, height = np.polyfit(times - middle, heights, 2)
        self.gravity = -2 * float(square)
        """[m/s^2]"""
        self.peak = float(height - slope**2 / (4 * square))
        """[m]"""


def flights(times: Array, heights: Array, flying: Array) -> list[Arc]:
    """The arcs of a body's centre (F,) [m] over the frames where it is `flying` (F,), in order; short ones left out."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flying, [False]]).astype(int)))
    spans = [slice(first, last) for first, last in zip(edges[::2], edges[1::2])]
    return [Arc(times[span], heights[span]) for span in spans if span.stop - span.start >= _FEWEST_FRAMES]


def mode_amplitude(displacements: Array, shape: Array) -> float:
    """Amplitude of a mode in displacements (N,), by least squares against its shape (N,)."""
    return float(displacements @ shape / (shape @ shape))


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """a exp(-gamma t) sin(2 pi f t + phi) + m: its frequency f [Hz], mean m and decay gamma [1/s]."""

    frequency: float
    mean: float
    decay: float


def damped_oscillation(times: Array, values: Array, frequency: float) -> Oscillation:
    """The decaying oscillation, near `frequency`, that values (T,) at times (T,) [s] are.

    What is none is NaN, which keeps no bound.
    """
    nothing = Oscillation(frequency=math.nan, mean=math.nan, decay=math.nan)

    def model(t: Array, amplitude: float, f: float, decay: float, phase: float, mean: float) -> Array:
        return amplitude * np.exp(-decay * t) * np.sin(2 * np.pi * f * t + phase) + mean

    mean = float(np.mean(values))
    amplitude = float(np.ptp(values)) / 2
    if not amplitude > 0:
        return nothing
    phase = math.asin(max(-1.0, min(1.0, (float(values[0]) - mean) / amplitude)))
    try:
        found, _ = curve_fit(model, times, values, p0=[amplitude, frequency, 0.0, phase, mean])
    except RuntimeError:
        return nothing
    return Oscillation(frequency=float(found[1]), mean=float(found[4]), decay=float(found[2]))


def half_height_width(times: Array, pulse: Array, height: float) -> float:
    """Time between the first rise of a pulse through `height` / 2 and its last fall through it [s], by interpolation.

    No pulse at all has no width.

    Raises
    ------
    ValueError
        Where the pulse does not begin and end within the times.
    """
    above = pulse > height / 2
    if not above.any():
        return 0.0
    if above[0] or above[-1]:
        raise ValueError("the pulse does not rise and fall within the times given")
    first = int(np.argmax(above))
    last = len(above) - 1 - int(np.argmax(above[::-1]))

    def crossing(low: int, high: int) -> float:
        share = (height / 2 - pulse[low]) / (pulse[high] - pulse[low])
        return float(times[low] + share * (times[high] - times[low]))

    return crossing(last, last + 1) - crossing(first - 1, first)


def angular_momentum(masses: Array, positions: Array, velocities: Array) -> Array:
    """sum m (x - x_com) x v, (3,) [kg m^2/s]."""
    center = masses @ positions / masses.sum()
    return masses @ np.cross(positions - center, velocities)


def kinetic_energy(masses: Array, velocities: Array) -> float:
    """sum m v^2 / 2 [J]."""
    return 0.5 * float(masses @ np.sum(velocities**2, axis=1))


def observed_order(sizes: Array, errors: Array) -> float:
    """Slope of log(error) over log(cell size), by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(np.abs(errors)), 1)[0])
