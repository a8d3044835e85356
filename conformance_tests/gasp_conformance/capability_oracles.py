"""Closed forms that the checks of single capabilities are held against. SI units."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import exp1

from gasp_core.contract import FrictionCone

__all__ = [
    "Turns",
    "carried_by_wind",
    "drucker_prager_friction",
    "grid_dispersion",
    "lame_frequency",
    "lame_shape",
    "lame_relaxing",
    "lame_viscous_decay",
    "large_wave",
    "radial_frequency",
    "radial_shape",
    "rigid_motion",
    "snow_pressing_work",
    "snow_stiffening",
    "snow_tearing_work",
    "snow_volume_ratio",
    "turns_of_a_viscoplastic_bar",
    "turns_of_a_yielding_bar",
    "two_part_mode",
    "two_part_pulse",
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


def two_part_pulse(seam: float, first: tuple[float, float], second: tuple[float, float]) -> float:
    """First angular frequency [rad/s] of a free bar, 1 m long, that is one thing up to `seam` [m] and another beyond.

    Between free ends displacements are cos(w x / c1) and cos(w (1 - x) / c2), each times a constant; at the seam they
    and the stresses are equal where Z1 tan(w s / c1) + Z2 tan(w (1 - s) / c2) = 0 (Graff, "Wave Motion in Elastic
    Solids", chapter 2).

    Parameters
    ----------
    first, second
        Speed c [m/s] and impedance Z = rho c [kg/m^2/s] of either part.
    """
    (c1, z1), (c2, z2) = first, second

    def mismatch(w: float) -> float:
        a, b = w * seam / c1, w * (1 - seam) / c2
        return z1 * math.sin(a) * math.cos(b) + z2 * math.cos(a) * math.sin(b)

    # In the part that waves take longer to cross lies a quarter of a wave to half of one; a hair is for rounding.
    slower = max(seam / c1, (1 - seam) / c2)
    return float(brentq(mismatch, 0.499 * math.pi / slower, 0.999 * math.pi / slower))


def two_part_mode(
    places: Array, seam: float, first: tuple[float, float], second: tuple[float, float]
) -> tuple[Array, Array]:
    """Displacement (N,), 1 at x = 0, and strain (N,) [1/m] of that mode at places x (N,) [m]; the rest as above."""
    (c1, z1), (c2, z2) = first, second
    w = two_part_pulse(seam, first, second)
    # Equal stresses at the seam.
    share = -(z1 * math.sin(w * seam / c1)) / (z2 * math.sin(w * (1 - seam) / c2))
    before, beyond = w * places / c1, w * (1 - places) / c2
    return (
        np.where(places < seam, np.cos(before), share * np.cos(beyond)),
        np.where(places < seam, -w / c1 * np.sin(before), share * w / c2 * np.sin(beyond)),
    )


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


def drucker_prager_friction(friction_angle: float, cone: FrictionCone = FrictionCone.SIMPLE_SHEAR) -> float:
    """Friction coefficient of sand in simple shear under pressure, M / sqrt(3), `friction_angle` in degrees.

    In simple shear at constant volume normal stresses are alike and q = M p is tau = M / sqrt(3) p. In triaxial
    compression Mohr and Coulomb's law is q = M p with M = 6 sin phi / (3 - sin phi) (Klar et al. 2016, section 7.3).
    In plane strain it is (s1 - s3) / 2 = sin phi (s1 + s3) / 2 of the largest and the least stress: on the left is tau,
    and (s1 + s3) / 2 is p, since at constant volume the third stress is their mean.
    """
    sine = math.sin(math.radians(friction_angle))
    match cone:
        case FrictionCone.SIMPLE_SHEAR:
            return math.tan(math.radians(friction_angle))
        case FrictionCone.PLANE_STRAIN:
            return sine
        case FrictionCone.TRIAXIAL_COMPRESSION:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Turns:
    """A bar between frictionless walls that was pressed and swings back, where its ends stand still.

    Parameters
    ----------
    pressed
        -ln of its stretch when it is shortest.
    stretched
        ln of its stretch when it is longest after that.
    """

    pressed: float
    stretched: float


def turns_of_a_yielding_bar(
    work: float, bulk_modulus: float, shear_modulus: float, yield_stress: float, hardening: float, residual: float
) -> Turns:
    """Where a bar between walls turns that obeys sqrt(3/2) |dev tau| <= max(Y + H p, R) and is pressed by `work`.

    Hencky's tau = 2 mu e + lambda tr(e) I works tau : d(ln F) per volume at rest. Of a bar whose sides are held let x
    be the logarithm of its stretch, and q the difference of tau along it and across, so |q| = sqrt(3/2) |dev tau|. Its
    sides gain -dp/2 of plastic strain each where its length gains dp, so q = 2 mu (x - 3/2 p), and tau along it is
    K x + 2/3 q. While it flows q changes by H dp, which is h dx with h = 2 mu H / (3 mu + H), until R is reached. So
    the work is K x^2 / 2 in volume, and in shear 2/3 of the area under straight lines: 2 mu up to where it yields, h,
    and 0. It turns where that is all the work there was; hardening is isotropic, so it yields the other way at the q
    it had. (Simo and Hughes 1998, "Computational inelasticity", sections 1.2 and 2.2, there of one dimension.)

    Parameters
    ----------
    work
        Per volume at rest [J/m^3].
    yield_stress, hardening, residual
        Y, H > -3 mu and R <= Y [Pa].
    """
    slope = 2 * shear_modulus * hardening / (3 * shear_modulus + hardening)

    def sheared(way: float, begin: float, limit: float) -> tuple[float, float, float]:
        """Work in shear of a way in x that begins at q = `begin` and yields at `limit`; q and limit at its end."""
        unyielding = min(way, (limit - begin) / (2 * shear_modulus))
        flowing = way - unyielding
        on_line = min(flowing, (limit - residual) / -slope) if slope < 0 else flowing
        area = (begin + shear_modulus * unyielding) * unyielding
        area += (limit + slope / 2 * on_line) * on_line + residual * (flowing - on_line)
        return 2 / 3 * area, begin + 2 * shear_modulus * unyielding + slope * on_line, limit + slope * on_line

    def unspent(way: float) -> float:
        return work - bulk_modulus * way**2 / 2 - sheared(way, 0.0, yield_stress)[0]

    pressed = float(brentq(unspent, 0.0, math.sqrt(2 * work / bulk_modulus)))
    _, stress, limit = sheared(pressed, 0.0, yield_stress)

    def left(way: float) -> float:
        return bulk_modulus / 2 * (pressed**2 - (way - pressed) ** 2) - sheared(way, -stress, limit)[0]

    # Its springs push at first; as long as it was short it could be where nothing was lost, and no longer.
    return Turns(pressed=pressed, stretched=float(brentq(left, 1e-3 * pressed, 2.001 * pressed)) - pressed)


def turns_of_a_viscoplastic_bar(
    work: float, bulk_modulus: float, shear_modulus: float, yield_stress: float, viscosity: float, mass: float
) -> Turns:
    """`turns_of_a_yielding_bar` where |d e_P / dt| = (|dev tau| - sqrt(2/3) Y) / eta as long as that is above 0.

    With sqrt(2/3) |d e_P| = dp and |dev tau| = sqrt(2/3) |q| that is dp/dt = 2/3 (|q| - Y) / eta: at rest the
    overstress falls as exp(-2 mu t / eta). Solved numerically; the force per area at rest is tau / F.

    Parameters
    ----------
    viscosity
        eta [Pa s].
    mass
        Of what presses it, per cross-section and length [kg/m^3].
    """

    def rates(_: float, state: Array) -> list[float]:
        stretch, speed, plastic = state
        shear = 2 * shear_modulus * (math.log(stretch) - 1.5 * plastic)
        force = (bulk_modulus * math.log(stretch) + 2 / 3 * shear) / stretch
        flow = 2 / 3 * max(0.0, abs(shear) - yield_stress) / viscosity
        return [speed, -force / mass, math.copysign(flow, shear)]

    def turned(_: float, state: Array) -> float:
        return float(state[1])

    turned.terminal = 2
    start, period = [1.0, -math.sqrt(2 * work / mass), 0.0], 2 * math.pi * math.sqrt(mass / bulk_modulus)
    run = solve_ivp(rates, (0, 2 * period), start, "LSODA", events=turned, rtol=1e-8, atol=1e-10, max_step=period / 200)
    shortest, longest = (float(state[0]) for state in run.y_events[0][:2])
    return Turns(pressed=-math.log(shortest), stretched=math.log(longest))


def lame_relaxing(times: Array, frequency: float, relaxation: float) -> Array:
    """Amplitude (T,) [s] of Lame's mode over the velocity that it starts with, where all stress relaxes.

    Maxwell's solid: with the elastic part z of the amplitude a, a'' = -w^2 z and z' = a' - z / theta, so that
    z'' + z' / theta + w^2 z = 0, z(0) = 0, z'(0) = v. Then a' = v - w^2 times the integral of z: it comes to rest at
    v / (w^2 theta).

    Parameters
    ----------
    frequency
        w / (2 pi), without relaxation [Hz].
    relaxation
        theta [s].
    """
    pulse = 2 * math.pi * frequency
    roots = np.roots([1.0, 1 / relaxation, pulse**2]).astype(complex)
    first, second = roots
    # z = v (exp(r1 t) - exp(r2 t)) / (r1 - r2) = a' + z / theta, integrated; r1 r2 = w^2 and r1 + r2 = -1 / theta.
    z = (np.exp(first * times) - np.exp(second * times)) / (first - second)
    area = (np.expm1(first * times) / first - np.expm1(second * times) / second) / (first - second)
    return np.real(z + area / relaxation)


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
