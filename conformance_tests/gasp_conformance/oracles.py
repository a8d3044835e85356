"""Closed forms the cases are held against. SI units; times [s] and places [m] may be arrays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

__all__ = [
    "bar_frequency",
    "bar_speed",
    "cantilever_deflection",
    "cantilever_frequency",
    "collision_time",
    "column_deflection",
    "column_period",
    "column_tip_motion",
    "confined_modulus",
    "euler_fall_error",
    "fixed_free_bar_mean",
    "fluid_column_heights",
    "free_fall",
    "gravity_parameter",
    "heavy_beam_drop",
    "loaded_bar_frequency",
    "incline_acceleration",
    "manufactured_body_force",
    "manufactured_displacement",
    "neo_hookean_stress",
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


def confined_modulus(youngs_modulus: float, poissons_ratio: float) -> float:
    """Stress over strain where the sides cannot move, M = E (1 - nu) / ((1 + nu)(1 - 2 nu)) [Pa].

    lambda + 2 mu of Hooke's law (Timoshenko and Goodier, "Theory of Elasticity", section 6).
    """
    nu = poissons_ratio
    return youngs_modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


def loaded_bar_frequency(length: float, speed: float, ratio: float) -> float:
    """First frequency [Hz] of a bar held at one end with a weight of `ratio` times its mass at the other.

    u = sin(b x / L) sin(w t), w = b c / L, and M u_tt = -E A u_x at the weight: b tan b = m / M (Graff, "Wave Motion in
    Elastic Solids", 2.3).
    """
    root = brentq(lambda b: b * math.tan(b) - 1 / ratio, 1e-9, math.pi / 2 - 1e-9)
    return root * speed / (2 * math.pi * length)


def fixed_free_bar_mean(time: ArrayLike, length: float, speed: float, start_speed: float) -> Array:
    """Mean displacement [m] of a bar held at X = 0 that starts with v = v0 sin(pi X / 2L).

    u = v0/omega sin(pi X / 2L) sin(omega t) with omega = pi c / 2L solves u_tt = c^2 u_XX with u = 0 at X = 0 and
    u_X = 0 at L (Graff 2.3); the mean of the sine over the bar is 2/pi.
    """
    omega = math.pi * speed / (2 * length)
    return 2 * start_speed / (math.pi * omega) * np.sin(omega * np.asarray(time))


def gravity_parameter(density: float, gravity: float, length: float, thickness: float, modulus: float) -> float:
    """K = rho g A L^3 / (E I) = 12 rho g L^3 / (E H^2): weight over bending stiffness of a beam H thick."""
    return 12 * density * gravity * length**3 / (modulus * thickness**2)


def cantilever_deflection(place: ArrayLike, weight: float, slenderness: float) -> Array:
    """Drop over length of a heavy cantilever at `place` x/L, by bending and by shear.

    K (x^4 - 4 x^3 + 6 x^2)/24 + K (H/L)^2 (x - x^2/2)/5 with x in lengths: Timoshenko's beam, whose bending has
    E I w_xxxx = q and whose shear has kappa G A w_x = q (L - x), with kappa = 5/6 of a rectangle and G = E/2 for nu = 0
    (Timoshenko 1921, 10.1080/14786442108636264). At the tip (K/8)(1 + 0.8 (H/L)^2).

    Parameters
    ----------
    weight
        K, see `gravity_parameter`.
    slenderness
        L / H.
    """
    x = np.asarray(place, dtype=float)
    bending = (x**4 - 4 * x**3 + 6 * x**2) / 24
    shear = (x - x**2 / 2) / (5 * slenderness**2)
    return weight * (bending + shear)


def cantilever_frequency(length: float, thickness: float, speed: float) -> float:
    """First frequency of a slender cantilever [Hz], beta^2 / (2 pi L^2) sqrt(E I / rho A) = 0.16154 H c / L^2.

    beta = 1.8751 is the first root of cos(beta) cosh(beta) = -1 (Graff, "Wave Motion in Elastic Solids", 3.2), and
    sqrt(I/A) = H / sqrt(12).
    """
    beta = brentq(lambda b: math.cos(b) * math.cosh(b) + 1, 1.8, 1.95)
    return beta**2 * thickness * speed / (2 * math.pi * math.sqrt(12) * length**2)


def heavy_beam_drop(place: ArrayLike, weight: float, slenderness: float = math.inf) -> Array:
    """Drop over length of a cantilever under its own weight, at arc length `place` s/L, however far it bends.

    Reissner's beam (1972, 10.1007/BF01602645) with nu = 0: the part beyond s pulls with K (1 - s) downwards, of which
    N = K (1 - s) sin(theta) stretches by e = N (H/L)^2 / 12, Q = K (1 - s) cos(theta) shears by g = Q (H/L)^2 / 5, and
    theta_ss = -((1 + e) Q - g N), theta(0) = 0, theta_s(1) = 0, drop_s = (1 + e) sin(theta) + g cos(theta). A slender
    one is the elastica, theta_ss = -K (1 - s) cos(theta) (Love, "Mathematical Theory of Elasticity", chapter XIX).
    There is no closed form; the curvature at the root is found by shooting.

    Parameters
    ----------
    weight
        K, see `gravity_parameter`.
    slenderness
        L / H.
    """

    def slope(s: float, state: Array) -> list[float]:
        theta, curvature, _ = state
        axial, across = weight * (1 - s) * math.sin(theta), weight * (1 - s) * math.cos(theta)
        stretch, shear = 1 + axial / (12 * slenderness**2), across / (5 * slenderness**2)
        bent = stretch * across - shear * axial
        return [curvature, -bent, stretch * math.sin(theta) + shear * math.cos(theta)]

    def shot(root_curvature: float, at: ArrayLike) -> Array:
        path = solve_ivp(slope, (0, 1), [0.0, root_curvature, 0.0], t_eval=np.atleast_1d(at), rtol=1e-10, atol=1e-12)
        return path.y

    # A beam that stays straight needs K/2 at its root to carry its weight; one that hangs needs less.
    root = brentq(lambda curvature: float(shot(curvature, 1.0)[1, -1]), 0.0, weight / 2, xtol=1e-12)
    return shot(root, place)[2]


def fluid_column_heights(heights: ArrayLike, total_height: float, density: float, gravity: float, bulk: float) -> Array:
    """Where the layers of a fluid column at rest lie, (...) [m], that lay at `heights` Z [m] before it had weight.

    The pressure is that of the mass above, p = rho g (H - Z), and Cole's equation p = K/7 (J^-7 - 1) gives the share
    J = (1 + 7 p / K)^(-1/7) to which each layer is pressed; z is the integral of J from the bottom. For small weight
    the surface sinks by rho g H^2 / 2K.
    """
    load = 7 * density * gravity / bulk
    bottom = (1 + load * total_height) ** (6 / 7)
    return (bottom - (1 + load * (total_height - np.asarray(heights, dtype=float))) ** (6 / 7)) * 7 / (6 * load)


def neo_hookean_stress(stretch: ArrayLike, mu: float, lame: float) -> Array:
    """P11 [Pa] under a stretch F along one axis alone, mu (F - 1/F) + lambda ln F / F.

    Of W = mu (I1 - 3)/2 - mu ln J + lambda ln(J)^2 / 2 with F = diag(F, 1, 1) (Bonet and Wood 2008, 6.28).
    """
    f = np.asarray(stretch, dtype=float)
    return mu * (f - 1 / f) + lame * np.log(f) / f


def manufactured_displacement(place: ArrayLike, time: float, amplitude: float, speed: float) -> Array:
    """u = A cos(pi X) sin(c pi t) [m] of a bar of length 1: starts undeformed, and its ends stay free of stress."""
    return amplitude * np.cos(np.pi * np.asarray(place)) * math.sin(speed * math.pi * time)


def manufactured_body_force(
    place: ArrayLike, time: float, amplitude: float, speed: float, density: float, mu: float, lame: float
) -> Array:
    """Body force [m/s^2] under which a neo-Hookean bar moves as `manufactured_displacement`.

    b = u_tt - (dP/dF) u_XX / rho with u_XX = -pi^2 u and F = 1 + u_X, so
    b = (pi^2 u / rho) [lambda (1 - ln F)/F^2 + mu (1 + 1/F^2) - rho c^2] (method of manufactured solutions, Roache
    2002, 10.1115/1.1436090).
    """
    u = manufactured_displacement(place, time, amplitude, speed)
    f = 1 - amplitude * np.pi * np.sin(np.pi * np.asarray(place)) * math.sin(speed * math.pi * time)
    stiffness = lame * (1 - np.log(f)) / f**2 + mu * (1 + 1 / f**2)
    return np.pi**2 * u / density * (stiffness - density * speed**2)


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
