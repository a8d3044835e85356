"""The closed forms themselves, against the equations they are said to solve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gasp_conformance import capability_oracles as exact
from gasp_conformance import oracles
from gasp_conformance.observables import (
    angular_momentum,
    damped_oscillation,
    flights,
    half_height_width,
    kinetic_energy,
    mode_amplitude,
    observed_order,
)
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, minimize


def test_free_fall_has_the_acceleration_of_gravity() -> None:
    gravity = np.array([0.1, -0.3, -9.81])
    h = 1e-3
    places = [oracles.free_fall([1, 2, 3], [0.5, 0.1, 2.0], gravity, 0.7 + k * h) for k in (-1, 0, 1)]
    # A parabola's second difference is exact; rounding is eps x / h^2.
    np.testing.assert_allclose((places[0] - 2 * places[1] + places[2]) / h**2, gravity, atol=1e-8)
    np.testing.assert_array_equal(oracles.free_fall([1, 2, 3], [4, 5, 6], gravity, 0.0), [1, 2, 3])


@pytest.mark.parametrize("count", [1, 10, 1000])
def test_symplectic_euler_is_ahead_by_what_is_said(count: int) -> None:
    step, place, velocity = 1.0 / count, 0.0, 0.0
    for _ in range(count):
        velocity += step * 9.81
        place += step * velocity
    assert place - 9.81 / 2 == pytest.approx(oracles.euler_fall_error(9.81, 1.0, step), rel=1e-11)


def discrete_bar(count: int, clamped: bool) -> np.ndarray:
    """Angular frequencies of a bar of `count` masses and springs, length 1, wave speed 1."""
    h = 1 / count
    stiffness = (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)) / h**2
    stiffness[-1, -1] = 1 / h**2
    # A wall half a spring away from the first mass, or nothing there.
    stiffness[0, 0] = 3 / h**2 if clamped else 1 / h**2
    return np.sqrt(np.maximum(np.linalg.eigvalsh(stiffness), 0))


def test_bar_and_column_frequencies_are_those_of_a_chain_of_masses() -> None:
    # The chain's first modes are (2/h) sin(k h / 2): lower by (k h)^2 / 24.
    free = discrete_bar(200, clamped=False)
    assert free[1] / (2 * math.pi) == pytest.approx(oracles.bar_frequency(1.0, 1.0), rel=1e-4)
    assert free[2] / (2 * math.pi) == pytest.approx(oracles.bar_frequency(1.0, 1.0, mode=2), rel=1e-4)
    assert 2 * math.pi / discrete_bar(200, clamped=True)[0] == pytest.approx(oracles.column_period(1.0, 1.0), rel=1e-4)
    assert oracles.bar_speed(4e5, 1000.0) == 20.0


def test_a_bar_of_two_parts_rings_as_its_equations_have_it() -> None:
    # Of halves of one density, one twice as fast as the other: tan t = -2 tan(t / 2), so tan(t / 2) is the root of 2.
    slow, fast = (3.0, 3.0 * 800), (6.0, 6.0 * 800)
    pulse = 2 * math.atan(math.sqrt(2)) * 3.0 / 0.5
    assert exact.two_part_pulse(0.5, slow, fast) == pytest.approx(pulse, rel=1e-12)
    # One thing all along is a bar, wherever the seam.
    for seam in (0.5, 0.3):
        assert exact.two_part_pulse(seam, slow, slow) == pytest.approx(math.pi * 3.0, rel=1e-12)
    # No gap, equal stresses E u_x = Z c u_x, no stress at either end, and the slope is that of the shape.
    seam, (c1, z1), (c2, z2) = 0.4, slow, (5.0, 900.0)
    hair = 1e-6
    places = np.array([0.0, seam - 1e-12, seam + 1e-12, 1.0, 0.2, 0.2 + hair, 0.7, 0.7 + hair])
    shape, slope = exact.two_part_mode(places, seam, (c1, z1), (c2, z2))
    assert shape[1] == pytest.approx(shape[2], rel=1e-9)
    assert z1 * c1 * slope[1] == pytest.approx(z2 * c2 * slope[2], rel=1e-9)
    assert abs(slope[0]) + abs(slope[3]) < 1e-9
    for at in (4, 6):
        assert (shape[at + 1] - shape[at]) / hair == pytest.approx(slope[at], rel=1e-4)


def test_column_deflection_balances_its_weight() -> None:
    z, h = np.array([0.0, 0.3, 0.9]), 1e-4

    def sinking(height: np.ndarray) -> np.ndarray:
        return oracles.column_deflection(height, 1.2, 1000.0, 9.81, 1e6)

    curvature = (sinking(z + h) - 2 * sinking(z) + sinking(z - h)) / h**2
    np.testing.assert_allclose(1e6 * curvature, -1000 * 9.81, rtol=1e-5)
    assert sinking(np.array([0.0]))[0] == 0
    # No stress at the head.
    assert sinking(np.array([1.2 + h])) == pytest.approx(sinking(np.array([1.2 - h])), rel=1e-12)


def test_column_tip_motion_is_that_of_a_chain_of_masses() -> None:
    count = 100
    h = 1 / count

    def acceleration(_: float, state: np.ndarray) -> np.ndarray:
        u = state[:count]
        # Sinking is counted downwards; the wall is half a spring below the first mass.
        stretch = np.concatenate([[2 * u[0]], np.diff(u), [0.0]]) / h
        return np.concatenate([state[count:], 9.81 + np.diff(stretch) / h])

    times = np.linspace(0, 8.5, 60)
    chain = solve_ivp(acceleration, (0, 8.5), np.zeros(2 * count), t_eval=times, rtol=1e-8, atol=1e-10)
    closed = oracles.column_tip_motion(times, 1.0, 1.0, 9.81)
    # Dispersion rounds the kinks off over some masses' time: kinks of velocity, so second order in that.
    np.testing.assert_allclose(chain.y[count - 1], closed, atol=0.01 * 9.81)
    static = oracles.column_deflection(1.0, 1.0, 1.0, 9.81, 1.0)
    assert oracles.column_tip_motion(2.0, 1.0, 1.0, 9.81) == pytest.approx(2 * static)
    assert oracles.column_tip_motion(4.0, 1.0, 1.0, 9.81) == pytest.approx(0.0, abs=1e-12)


def test_confined_modulus_inverts_hookes_law() -> None:
    modulus, nu = 2e6, 0.3
    compliance = (np.full((3, 3), -nu) + np.eye(3) * (1 + nu)) / modulus
    # Unit strain along one axis and none across: the stress along it.
    stress = np.linalg.solve(compliance, [0.0, 0.0, 1.0])
    assert oracles.confined_modulus(modulus, nu) == pytest.approx(stress[2], rel=1e-12)
    assert oracles.confined_modulus(modulus, 0.0) == modulus


def test_mean_of_a_held_bar_is_that_of_a_chain_of_masses() -> None:
    count = 200
    h = 1 / count
    places = (np.arange(count) + 0.5) * h
    stiffness = (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)) / h**2
    stiffness[-1, -1], stiffness[0, 0] = 1 / h**2, 3 / h**2
    squares, modes = np.linalg.eigh(stiffness)
    start = modes.T @ np.sin(math.pi * places / 2)
    times = np.linspace(0, 6, 30)
    omegas = np.sqrt(squares)
    chain = [float((modes @ (start / omegas * np.sin(omegas * time))).mean()) for time in times]
    # The chain's frequency is lower by (k h)^2 / 24 and its mean a midpoint rule.
    np.testing.assert_allclose(oracles.fixed_free_bar_mean(times, 1.0, 1.0, 1.0), chain, atol=1e-4)


def discrete_cantilever(count: int) -> np.ndarray:
    """Bending stiffness of `count` rigid rods of a beam of length 1 and E I = 1 against the drops of their ends."""
    h = 1 / count
    # Angles from drops, the first rod hinged to the wall by half a rod's spring.
    angles = (np.eye(count) - np.eye(count, k=-1)) / h
    turns = np.eye(count) - np.eye(count, k=-1)
    springs = np.full(count, 1 / h)
    springs[0] = 2 / h
    return angles.T @ turns.T @ np.diag(springs) @ turns @ angles


def test_cantilever_frequency_is_that_of_a_chain_of_rods() -> None:
    count = 400
    h = 1 / count
    masses = np.full(count, h)
    masses[-1] = h / 2
    squares = np.linalg.eigvalsh(discrete_cantilever(count) / np.sqrt(np.outer(masses, masses)))
    # E I = rho A = L = 1 is c H / sqrt(12) = 1.
    expected = oracles.cantilever_frequency(1.0, 0.1, math.sqrt(12) / 0.1)
    # Second order in the rods' length, and the smallest of eigenvalues that reach 1e11 keeps five digits.
    assert math.sqrt(squares[0]) / (2 * math.pi) == pytest.approx(expected, rel=1e-4)
    # verification.md, V6.
    assert oracles.cantilever_frequency(2.0, 0.1, 7.0) == pytest.approx(0.16154 * 0.1 * 7 / 4, rel=1e-5)


def test_cantilever_deflection_balances_its_weight() -> None:
    weight, slenderness = 0.4, 8.0
    x = np.linspace(0, 1, 2001)
    h = x[1]
    # Moment and shear force of the load beyond x, integrated twice and once by the trapezium rule.
    curvature = weight * (1 - x) ** 2 / 2
    slope = np.concatenate([[0], np.cumsum((curvature[1:] + curvature[:-1]) / 2) * h])
    slope += weight * (1 - x) * (2 * 6 / 5) / (12 * slenderness**2)
    drop = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2) * h])
    np.testing.assert_allclose(oracles.cantilever_deflection(x, weight, slenderness), drop, atol=1e-7 * weight)
    # verification.md, V6.
    assert oracles.cantilever_deflection(1.0, 0.4, 8.0) == pytest.approx(0.4 / 8 * (1 + 0.8 / 64), rel=1e-12)
    assert oracles.gravity_parameter(1000, 9.81, 1.0, 0.125, 1.884e7) == pytest.approx(0.4, rel=1e-3)


@pytest.mark.parametrize(("weight", "drop"), [(1.0, 0.12347), (2.0, 0.23851), (10.0, 0.70020)])
def test_heavy_beam_is_a_chain_of_rods_at_its_lowest_energy(weight: float, drop: float) -> None:
    count, h = 200, 1 / 200
    middle = (np.arange(count) + 0.5) * h
    springs = np.full(count, 1 / h)
    springs[0] = 2 / h

    def energy(theta: np.ndarray) -> tuple[float, np.ndarray]:
        turns = np.diff(theta, prepend=0.0)
        beyond = weight * (1 - middle) * h
        gradient = springs * turns - np.append((springs * turns)[1:], 0.0) - beyond * np.cos(theta)
        return float(springs @ turns**2 / 2 - beyond @ np.sin(theta)), gradient

    found = minimize(
        energy,
        np.zeros(count),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 20000, "gtol": 1e-11, "ftol": 1e-16, "maxfun": 40000},
    )
    # Second order in the rods: (K h)^2 at most.
    assert oracles.heavy_beam_drop(1.0, weight)[0] == pytest.approx(np.sin(found.x).sum() * h, rel=1e-3)
    # verification.md, V7.
    assert oracles.heavy_beam_drop(1.0, weight)[0] == pytest.approx(drop, abs=6e-6)


def test_heavy_beam_that_shears_is_a_chain_of_rods_that_stretch_and_slide() -> None:
    weight, slenderness, count = 10.0, 8.0, 100
    h = 1 / count
    middle = (np.arange(count) + 0.5) * h
    springs = np.full(count, 1 / h)
    springs[0] = 2 / h
    # In units of E I / L^2: E A = 12 (L/H)^2, kappa G A = 5 (L/H)^2.
    stiff = np.array([12.0, 5.0]) * slenderness**2
    beyond = weight * (1 - middle) * h

    def energy(state: np.ndarray) -> tuple[float, np.ndarray]:
        theta, stretch, shear = state.reshape(3, count)
        turns = np.diff(theta, prepend=0.0)
        down = (1 + stretch) * np.sin(theta) + shear * np.cos(theta)
        stored = springs @ turns**2 / 2 + h * (stiff[0] * stretch @ stretch + stiff[1] * shear @ shear) / 2
        by_theta = springs * turns - np.append((springs * turns)[1:], 0.0)
        by_theta -= beyond * ((1 + stretch) * np.cos(theta) - shear * np.sin(theta))
        by_stretch = h * stiff[0] * stretch - beyond * np.sin(theta)
        by_shear = h * stiff[1] * shear - beyond * np.cos(theta)
        return float(stored - beyond @ down), np.concatenate([by_theta, by_stretch, by_shear])

    found = minimize(
        energy,
        np.zeros(3 * count),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 20000, "gtol": 1e-10, "ftol": 1e-16, "maxfun": 40000},
    )
    theta, stretch, shear = found.x.reshape(3, count)
    tip = ((1 + stretch) * np.sin(theta) + shear * np.cos(theta)).sum() * h
    # Second order in the rods: (K h)^2 at most, where shear and stretch together make 1.5 %.
    assert oracles.heavy_beam_drop(1.0, weight, slenderness)[0] == pytest.approx(tip, rel=2e-3)
    # So light that it stays nearly straight it is the linear beam, up to the square of its slope.
    light = oracles.heavy_beam_drop(np.array([0.5, 1.0]), 1e-3, slenderness)
    np.testing.assert_allclose(light, oracles.cantilever_deflection([0.5, 1.0], 1e-3, slenderness), rtol=1e-6)


def test_fluid_column_carries_the_mass_above_it() -> None:
    height, density, gravity, bulk = 1.2, 1000.0, 9.81, 5e4

    def share(layer: float) -> float:
        """J at which Cole's equation gives the pressure of the layers above."""
        pressure = density * gravity * (height - layer)
        return brentq(lambda j: bulk / 7 * (j**-7 - 1) - pressure, 0.3, 1.0, xtol=1e-13)

    for layer in (0.3, height):
        expected = quad(share, 0, layer, epsabs=1e-11)[0]
        assert oracles.fluid_column_heights(layer, height, density, gravity, bulk) == pytest.approx(expected, rel=1e-9)
    # So stiff that it hardly sinks, the surface sinks by rho g H^2 / 2K.
    stiff = 1e10
    sunk = height - oracles.fluid_column_heights(height, height, density, gravity, stiff)
    assert sunk == pytest.approx(density * gravity * height**2 / (2 * stiff), rel=1e-4)
    assert oracles.fluid_column_heights(0.0, height, density, gravity, bulk) == 0


def test_neo_hookean_stress_is_the_slope_of_its_energy() -> None:
    mu, lame, h = 3.0, 5.0, 1e-5

    def energy(f: np.ndarray) -> np.ndarray:
        return mu * (f**2 - 1) / 2 - mu * np.log(f) + lame * np.log(f) ** 2 / 2

    f = np.array([0.7, 1.0, 1.4])
    slope = (energy(f + h) - energy(f - h)) / (2 * h)
    np.testing.assert_allclose(oracles.neo_hookean_stress(f, mu, lame), slope, atol=1e-8)


def test_manufactured_body_force_closes_the_equation_of_motion() -> None:
    amplitude, speed, density, mu, lame, time = 0.05, 3.1, 1000.0, 4e3, 6e3, 0.07
    x, h = np.array([0.1, 0.35, 0.8]), 1e-4

    def u(place: np.ndarray, at: float = time) -> np.ndarray:
        return oracles.manufactured_displacement(place, at, amplitude, speed)

    def stress(place: np.ndarray) -> np.ndarray:
        return oracles.neo_hookean_stress(1 + (u(place + h) - u(place - h)) / (2 * h), mu, lame)

    acceleration = (u(x, time + h) - 2 * u(x) + u(x, time - h)) / h**2
    divergence = (stress(x + h) - stress(x - h)) / (2 * h)
    body = oracles.manufactured_body_force(x, time, amplitude, speed, density, mu, lame)
    # Central differences: (pi h)^2 of some m/s^2, and eps u / h^2 of rounding.
    np.testing.assert_allclose(density * acceleration - divergence, density * body, atol=density * 1e-5)
    # The ends bear no stress, and nothing is displaced at the start.
    assert np.abs(stress(np.array([0.0, 1.0]))).max() < mu * 1e-5
    assert not u(x, 0.0).any()


def test_spin_kept_is_what_verification_says() -> None:
    kept = [oracles.spin_kept_by_affine_start_at_rest(1.0, 1 / cells) for cells in (4, 8, 16)]
    # Printed there with four digits, of a square of points: r_g^2 = a^2/6 but for the points' own size.
    np.testing.assert_allclose(kept, [0.8400, 0.9551, 0.9884], atol=3e-3)


def test_bars_of_masses_and_springs_part_after_the_collision_time() -> None:
    # Two chains, a little apart, with a spring between them that only pushes.
    count, velocity, gap = 60, 1e-3, 5e-4
    h = 1 / count

    def acceleration(_: float, state: np.ndarray) -> np.ndarray:
        x = state[: 2 * count]
        stretch = np.diff(x) / h
        stretch[count - 1] = min(0.0, stretch[count - 1] + gap / h)
        force = np.concatenate([[0.0], stretch, [0.0]])
        return np.concatenate([state[2 * count :], np.diff(force) / h])

    start = np.concatenate([np.zeros(2 * count), np.full(count, velocity), np.full(count, -velocity)])
    times = np.linspace(0, 4, 2001)
    run = solve_ivp(acceleration, (0, 4), start, t_eval=times, rtol=1e-7, atol=1e-10, max_step=h)
    momentum = run.y[2 * count : 3 * count].mean(axis=0)
    force = -np.gradient(momentum, times)
    width = half_height_width(times[::20], np.convolve(force, np.full(40, 1 / 40), "same")[::20], velocity)
    # Dispersion rounds both ends of the pulse off over some masses' time.
    assert width == pytest.approx(oracles.collision_time(1.0, 1.0), rel=0.05)


def test_incline() -> None:
    # verification.md, V12.
    acceleration = oracles.incline_acceleration(math.radians(24), math.tan(math.radians(15)), 9.81)
    assert acceleration / 2 == pytest.approx(0.79438, abs=5e-6)
    assert oracles.incline_acceleration(math.radians(10), math.tan(math.radians(15)), 9.81) == 0


def test_observables_find_what_was_put_in() -> None:
    times = np.linspace(0, 2, 81)[1:]
    values = 0.3 * np.exp(-0.2 * times) * np.sin(2 * np.pi * 1.55 * times + 0.1) + 0.05
    swing = damped_oscillation(times, values, 1.6)
    assert swing.frequency == pytest.approx(1.55, rel=1e-6)
    assert swing.mean == pytest.approx(0.05, rel=1e-5)
    assert swing.decay == pytest.approx(0.2, rel=1e-5)
    shape = np.cos(np.linspace(0, 3, 20))
    assert mode_amplitude(0.7 * shape, shape) == pytest.approx(0.7, rel=1e-14)
    assert observed_order(np.array([1.0, 0.5, 0.25]), -np.array([1.0, 0.25, 0.0625])) == pytest.approx(2, rel=1e-12)
    ramp = np.interp(np.linspace(0, 10, 101), [2, 3, 5, 6], [0, 1, 1, 0], left=0, right=0)
    assert half_height_width(np.linspace(0, 10, 101), ramp, 1.0) == pytest.approx(3.0, rel=1e-12)
    with pytest.raises(ValueError, match="does not rise and fall"):
        half_height_width(np.arange(3.0), np.array([1.0, 1.0, 0.0]), 1.0)
    corners = np.array([[1.0, 0, 0], [-1.0, 0, 0]]) + 5
    spin = np.cross([0, 0, 2.0], corners - 5) + 3
    np.testing.assert_allclose(angular_momentum(np.ones(2), corners, spin), [0, 0, 4], atol=1e-14)
    assert kinetic_energy(np.array([2.0, 3.0]), np.array([[1.0, 2.0, 2.0], [0.0, 0.0, 1.0]])) == pytest.approx(10.5)


def test_flights_are_the_parabolas_between_contacts() -> None:
    times = np.linspace(0, 2, 201)
    heights = np.where(times < 1, 5 * times * (1 - times), 3 * (times - 1) * (2 - times)) + 0.2
    arcs = flights(times, heights, heights > 0.3)
    # z = 5 t - 5 t^2 has gravity 10 and its peak at 1.25, the second 6 and 0.75: polynomials, up to rounding.
    np.testing.assert_allclose([arc.gravity for arc in arcs], [10, 6], rtol=1e-10)
    np.testing.assert_allclose([arc.peak for arc in arcs], [1.45, 0.95], rtol=1e-10)
    # A few frames are no flight.
    assert flights(times, heights, (times > 0.5) & (times < 0.55)) == []
