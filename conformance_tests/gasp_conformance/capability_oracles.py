"""Closed forms that the checks of single capabilities are held against. SI units."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import exp1

__all__ = [
    "carried_by_wind",
    "drucker_prager_friction",
    "grid_dispersion",
    "lame_frequency",
    "lame_shape",
    "lame_viscous_decay",
    "large_wave",
    "radial_frequency",
    "radial_shape",
    "rigid_motion",
    "snow_pressing_work",
    "snow_stiffening",
    "snow_tearing_work",
    "snow_volume_ratio",
    "von_mises_yield_strain",
]

Array = NDArray[Any]


def lame_shape(places: Array, side: float) -> Array:
    """Lame's mode of a square block, (N, 3): u = (cos kx sin ky, -sin kx cos ky, 0), k = pi / side.

    Places (N, 3) [m] are from a corner of the square; the third axis is along its thickness. It is free of divergence
    and of traction on all six faces, whatever the thickness and Poisson's ratio: e_xx = -e_yy = -k sin kx sin ky
    vanishes on the sides, e_xy everywhere (Lame 1852; Auld, "Acoustic Fields and Waves in Solids" II, 10.J).
    """
    x, y = (places[:, :2] * math.pi / side).T
    return np.stack([np.cos(x) * np.sin(y), -np.sin(x) * np.cos(y), np.zeros_like(x)], axis=1)


def lame_frequency(side: float, shear_modulus: float, density: float) -> float:
    """Frequency [Hz] of Lame's mode, sqrt(mu / rho) / (sqrt(2) side).

    u_tt = c_s^2 (u_xx + u_yy) = -2 k^2 c_s^2 u with k = pi / side.
    """
    return math.sqrt(shear_modulus / density) / (math.sqrt(2) * side)


def lame_viscous_decay(side: float, viscosity: float, density: float) -> float:
    """Rate [1/s] at which a slow viscous flow in the shape of Lame's mode dies away, 2 eta pi^2 / (rho side^2).

    Stokes flow: rho v_t = eta (v_xx + v_yy) = -2 eta k^2 v; no traction on any face, no pressure.
    """
    return 2 * viscosity * math.pi**2 / (density * side**2)


def radial_shape(places: Array, radius: float, root: float) -> Array:
    """Radial mode of a ball, (N, 3): u_r = j_1(root r / radius), of unit size at small r / radius.

    Places (N, 3) [m] are from the centre.
    """
    argument = root * np.linalg.norm(places, axis=1) / radius
    x = np.maximum(argument, 1e-3)  # 3 j_1(x) / x = 1 - x^2/10 + ...
    return places / radius * (3 * (np.sin(x) / x**2 - np.cos(x) / x) / x)[:, None]


def radial_frequency(radius: float, shear_modulus: float, lame_lambda: float, density: float) -> tuple[float, float]:
    """Frequency [Hz] of a ball that breathes, and the root x = omega radius / c_p that belongs to it.

    u_r = j_1(x r / R) leaves no radial stress at R: M x j_0(x) = 4 mu j_1(x) with M = lambda + 2 mu (Lamb 1882, "On the
    Vibrations of an Elastic Sphere").
    """
    modulus = lame_lambda + 2 * shear_modulus
    q = 4 * shear_modulus / modulus
    root = float(brentq(lambda x: math.sin(x) * (1 - q / x**2) + q * math.cos(x) / x, 1e-2, math.pi))
    return root * math.sqrt(modulus / density) / (2 * math.pi * radius), root


def grid_dispersion(wave_number: float, spacing: float) -> float:
    """What second-order differences over cells of `spacing` may leave of relative error in a frequency.

    1.5 (k dx / pi)^2: verification's bound for a bar's first mode, 1.5 (dx / L)^2, where k = pi / L.
    """
    return 1.5 * (wave_number * spacing / math.pi) ** 2


def large_wave(
    stress: Callable[[Array], Array], speed: float, places: Array, amplitude: float, time: float, cells: int = 400
) -> Array:
    """Displacements (N,) [m] in a free bar, 1 m long, thrown with v = pi A c cos(pi X), at `time` [s].

    Solves x_tt = c^2 P(F)_X, P = 0 at both ends, by masses and springs and the leapfrog scheme: second order in
    1 / cells.

    Parameters
    ----------
    stress
        P / E of a stretch F.
    speed
        c = sqrt(E / rho) [m/s].
    places : (N,) [m]
        X, from one end.
    """
    h = 1 / cells
    middles = (np.arange(cells) + 0.5) * h
    steps = math.ceil(speed * time / (0.2 * h))
    step = speed * time / steps
    moved, velocity = np.zeros(cells), math.pi * amplitude * np.cos(math.pi * middles)

    def pull() -> Array:
        return np.diff(np.concatenate([[0.0], stress(1 + np.diff(moved) / h), [0.0]])) / h

    for _ in range(steps):
        velocity = velocity + step / 2 * pull()
        moved = moved + step * velocity
        velocity = velocity + step / 2 * pull()
    return np.interp(places, middles, moved)


def drucker_prager_friction(friction_angle: float) -> float:
    """Friction coefficient of sand in simple shear under pressure, M / sqrt(3), `friction_angle` in degrees.

    Klar et al. 2016 fit the Drucker-Prager cone to Mohr-Coulomb in triaxial compression: q = M p with
    M = 6 sin phi / (3 - sin phi). In simple shear of an isotropic pressure, q = sqrt(3) tau.
    """
    sine = math.sin(math.radians(friction_angle))
    return 6 * sine / (3 - sine) / math.sqrt(3)


def snow_stiffening(plastic_ratio: float, hardening: float) -> float:
    """Factor exp(xi (1 - J_P)) on both of snow's Lame parameters at a plastic volume ratio J_P.

    Stomakhin et al. 2013, "A material point method for snow simulation" (10.1145/2461912.2461948), section 5:
    Psi = mu(F_P) |F_E - R_E|^2 + lambda(F_P) / 2 (J_E - 1)^2 of the volume at rest, F = F_E F_P, with the principal
    stretches of F_E held within [1 - theta_c, 1 + theta_s] and what is beyond given to F_P.

    In a bar that is stretched along its axis alone (free sides and nu = 0, or sides that are held), all of this is
    scalar: F = F_E J_P, and the force per area at rest is P = dPsi/dF = h(J_P) M (F_E - 1) / J_P with M = E, or
    M = lambda + 2 mu where the sides are held. At a given J_P that is a spring of stiffness h(J_P) M / J_P^2: it swings
    sqrt(h(J_P)) / J_P times as fast as the bar that was never pressed, about J_P times its length.
    """
    return math.exp(hardening * (1 - plastic_ratio))


def snow_pressing_work(plastic_ratio: float, critical_compression: float, hardening: float) -> float:
    """Work, per volume at rest and over M, of pressing a bar of snow until its plastic volume ratio is J_P < 1.

    The integral of P dF over `snow_stiffening`'s P: theta^2 / 2 up to yield; beyond, F_E = 1 - theta stays and
    dF = (1 - theta) dJ_P, so theta (1 - theta) times the integral of exp(xi (1 - j)) / j from J_P to 1, which is
    exp(xi) (E_1(xi J_P) - E_1(xi)), or -ln J_P where nothing hardens.
    """
    theta = critical_compression
    if hardening == 0:
        return theta**2 / 2 - theta * (1 - theta) * math.log(plastic_ratio)
    flow = math.exp(hardening) * float(exp1(hardening * plastic_ratio) - exp1(hardening))
    return theta**2 / 2 + theta * (1 - theta) * flow


def snow_volume_ratio(work: float, critical_compression: float, hardening: float) -> float:
    """Plastic volume ratio J_P to which `work`, per volume at rest and over M, presses a bar of snow.

    The inverse of `snow_pressing_work`: 1 where the work does not reach the yield strain, and not below a thousandth.
    """
    least = 1e-3

    def missing(ratio: float) -> float:
        return snow_pressing_work(ratio, critical_compression, hardening) - work

    if missing(1.0) >= 0:
        return 1.0
    return float(brentq(missing, least, 1.0)) if missing(least) > 0 else least


def snow_tearing_work(critical_stretch: float, hardening: float) -> float:
    """Work, per volume at rest and over M, that pulls a bar of snow apart evenly; no other way takes more.

    As `snow_pressing_work`, from J_P = 1 to infinity: theta^2 / 2 + theta (1 + theta) exp(xi) E_1(xi), xi > 0. Snow
    softens as it is pulled, so it tears in one place, and the rest of it never goes that way.
    """
    theta = critical_stretch
    return theta**2 / 2 + theta * (1 + theta) * math.exp(hardening) * float(exp1(hardening))


def von_mises_yield_strain(yield_stress: float, shear_modulus: float) -> float:
    """Strain e at which diag(-e, e, 0) yields: sqrt(3/2) |2 mu dev e| = 2 sqrt(3) mu e = yield stress."""
    return yield_stress / (2 * math.sqrt(3) * shear_modulus)


def carried_by_wind(velocity: ArrayLike, air: ArrayLike, drag: float, time: float) -> Array:
    """How far (..., 3) [m] matter of initial `velocity` is carried in `time` [s] by air that drags it.

    dv/dt = k (u - v): x = u t + (v0 - u) (1 - exp(-k t)) / k.
    """
    u = np.asarray(air, dtype=float)
    return u * time + (np.asarray(velocity) - u) * -math.expm1(-drag * time) / drag


def rigid_motion(places: Array, center: ArrayLike, velocity: ArrayLike, spin: ArrayLike, time: float) -> Array:
    """Places (N, 3) [m] after `time` [s] of turning at `spin` [rad/s] about a centre that moves at `velocity` [m/s].

    Rodrigues' rotation by |spin| time.
    """
    axis = np.asarray(spin, dtype=float)
    rate = float(np.linalg.norm(axis))
    arm = places - np.asarray(center)
    if rate > 0:
        n, angle = axis / rate, rate * time
        along = (arm @ n)[:, None] * n
        arm = along + (arm - along) * math.cos(angle) + np.cross(n, arm) * math.sin(angle)
    return arm + np.asarray(center) + np.asarray(velocity) * time
