"""The closed forms themselves, against the equations they are said to solve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gasp_conformance import oracles
from gasp_conformance.observables import (
    angular_momentum,
    damped_oscillation,
    half_height_width,
    mode_amplitude,
    observed_order,
)
from scipy.integrate import solve_ivp


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
    frequency, mean = damped_oscillation(times, values, 1.6)
    assert frequency == pytest.approx(1.55, rel=1e-6)
    assert mean == pytest.approx(0.05, rel=1e-5)
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
