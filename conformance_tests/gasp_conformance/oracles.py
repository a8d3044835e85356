"""Closed forms the cases are held against. SI units; times [s] and places [m] may be arrays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "bar_frequency",
    "bar_speed",
    "collision_time",
    "column_deflection",
    "column_period",
    "column_tip_motion",
    "euler_fall_error",
    "free_fall",
    "incline_acceleration",
    "spin_kept_by_affine_start_at_rest",
]

Array = NDArray[Any]


def free_fall(start: ArrayLike, velocity: ArrayLike, gravity: ArrayLike, time: float) -> Array:
    """x0 + v0 t + g t^2 / 2 (Galilei)."""
    return np.asarray(start) + np.asarray(velocity) * time + 0.5 * np.asarray(gravity) * time**2


def euler_fall_error(gravity: float, time: float, step: float) -> float:
    """How far symplectic Euler with equal steps is ahead of free fall [m].

    x_n = sum_k k g dt^2 = g dt^2 n (n + 1) / 2, so it is ahead by g t dt / 2 exactly (Hairer, Lubich, Wanner,
    "Geometric Numerical Integration", I.1.2, applied to a constant force).
    """
    return gravity * time * step / 2


def bar_speed(youngs_modulus: float, density: float) -> float:
    """Speed of longitudinal waves in a bar with free sides, sqrt(E/rho) [m/s]."""
    return math.sqrt(youngs_modulus / density)


def bar_frequency(length: float, speed: float, mode: int = 1) -> float:
    """Frequency of a bar with both ends free, mode c / 2L [Hz].

    u = cos(k pi X/L) sin(k pi c t/L) solves u_tt = c^2 u_XX with u_X = 0 at both ends (Graff, "Wave Motion in Elastic
    Solids", 2.3).
    """
    return mode * speed / (2 * length)


def column_deflection(height: ArrayLike, total_height: float, density: float, gravity: float, modulus: float) -> Array:
    """Static sinking u(z) = rho g (H z - z^2/2) / M of a column under its own weight, at `height` z [m].

    Integrates M u' = rho g (H - z) from the clamped foot; M is E where the sides are free and nu = 0.
    """
    z = np.asarray(height, dtype=float)
    return density * gravity * (total_height * z - z**2 / 2) / modulus


def column_period(total_height: float, speed: float) -> float:
    """Period of the first mode of a column with its foot clamped and its head free, 4 H / c [s] (Graff 2.3)."""
    return 4 * total_height / speed


def column_tip_motion(time: ArrayLike, total_height: float, speed: float, gravity: float) -> Array:
    """Sinking [m] of the head of a column whose weight sets in at t = 0.

    The head falls freely until it hears of the foot at H/c; the reflected wave then turns its acceleration round every
    2H/c. So it moves between nothing and twice the static value, with period 4H/c (d'Alembert).
    """
    period = column_period(total_height, speed)
    phase = np.mod(np.asarray(time, dtype=float), period)
    quarter = period / 4
    # Parabolas of curvature g, -g, g over a quarter, a half, a quarter of the period.
    rising = gravity * phase**2 / 2
    turning = gravity * quarter**2 - gravity * (phase - 2 * quarter) ** 2 / 2
    falling = gravity * (phase - period) ** 2 / 2
    return np.where(phase < quarter, rising, np.where(phase < 3 * quarter, turning, falling))


def spin_kept_by_affine_start_at_rest(side: float, spacing: float) -> float:
    """Share of angular momentum left in point velocities by an affine transfer that starts with C = 0.

    Of a spinning square of side a, r_g^2 = a^2/6 about its axis. Each point's own affine field takes m D (C - C^T) of
    the spin, with D = dx^2/4 for quadratic B-splines: 1 / (1 + dx^2 / (2 r_g^2)).
    """
    return 1 / (1 + spacing**2 / (2 * side**2 / 6))


def collision_time(length: float, speed: float) -> float:
    """How long two equal bars that run into each other stay in contact, 2 L / c [s].

    Both are stopped by a compression wave, which comes back from the free ends as a release and leaves each with the
    other's velocity (St. Venant 1867; Graff 2.5.1).
    """
    return 2 * length / speed


def incline_acceleration(angle: float, friction: float, gravity: float) -> float:
    """g (sin theta - mu cos theta) [m/s^2] of a body sliding down an incline of `angle` [rad]; 0 where it sticks."""
    return max(0.0, gravity * (math.sin(angle) - friction * math.cos(angle)))
