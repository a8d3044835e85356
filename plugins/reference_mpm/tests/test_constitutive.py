from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gasp_reference_mpm.constitutive import (
    drucker_prager_projection,
    fixed_corotated_stress,
    fluid_deformation,
    fluid_stress,
    hencky_stress,
    neo_hookean_stress,
    polar_rotation,
    snow_hardening,
    snow_projection,
    viscoplastic_projection,
    von_mises_projection,
)
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[Any]
Law = Callable[[Array, float, float], Array]

MU, LAME = 3.0, 2.0
LAWS = [fixed_corotated_stress, neo_hookean_stress, hencky_stress]
seeds = st.integers(0, 2**32 - 1)


def deformations(seed: int, count: int = 20, strain: float = 0.3) -> Array:
    """Random F with det F > 0: an identity disturbed by less than would invert it."""
    rng = np.random.default_rng(seed)
    return np.eye(3) + strain * rng.uniform(-1, 1, (count, 3, 3)) / np.sqrt(3)


def rotations(seed: int, count: int = 20) -> Array:
    q, r = np.linalg.qr(np.random.default_rng(seed).standard_normal((count, 3, 3)))
    q = q * np.sign(np.einsum("nii->ni", r))[:, None, :]
    return q * np.linalg.det(q)[:, None, None]


def corotated_energy(deformation: Array) -> Array:
    stretches = np.linalg.svd(deformation, compute_uv=False)
    stretches[:, 2] *= np.sign(np.linalg.det(deformation))
    return MU * ((stretches - 1) ** 2).sum(axis=1) + LAME / 2 * (stretches.prod(axis=1) - 1) ** 2


def neo_hookean_energy(deformation: Array) -> Array:
    log_ratio = np.log(np.linalg.det(deformation))
    return MU / 2 * ((deformation**2).sum(axis=(1, 2)) - 3) - MU * log_ratio + LAME / 2 * log_ratio**2


def hencky_energy(deformation: Array) -> Array:
    strains = np.log(np.linalg.svd(deformation, compute_uv=False))
    return MU * (strains**2).sum(axis=1) + LAME / 2 * strains.sum(axis=1) ** 2


def gradient(energy: Callable[[Array], Array], deformation: Array, step: float) -> Array:
    slope = np.empty_like(deformation)
    for i, j in np.ndindex(3, 3):
        shift = np.zeros((3, 3))
        shift[i, j] = step
        slope[:, i, j] = (energy(deformation + shift) - energy(deformation - shift)) / (2 * step)
    return slope


@pytest.mark.parametrize(
    ("law", "energy"),
    [
        (fixed_corotated_stress, corotated_energy),
        (neo_hookean_stress, neo_hookean_energy),
        (hencky_stress, hencky_energy),
    ],
)
@given(seed=seeds)
def test_stress_is_the_gradient_of_the_energy(law: Law, energy: Callable[[Array], Array], seed: int) -> None:
    deformation = deformations(seed)
    numeric = gradient(energy, deformation, 1e-5) @ deformation.transpose(0, 2, 1)
    # Central differences: h^2 Psi'''/6 with Psi''' of some hundred moduli at these strains, eps Psi/h beside it: 1e-8.
    np.testing.assert_allclose(law(deformation, MU, LAME), numeric, rtol=0, atol=1e-7 * (2 * MU + LAME))


@given(seed=seeds)
def test_corotated_stress_is_the_gradient_of_the_energy_when_turned_inside_out(seed: int) -> None:
    # Away from |F| with two equal smallest stretches, where the sign changes hands and the energy has a kink.
    deformation = rotations(seed) @ (np.array([1.2, 0.9, -0.3])[:, None] * rotations(seed + 1))
    numeric = gradient(corotated_energy, deformation, 1e-5) @ deformation.transpose(0, 2, 1)
    np.testing.assert_allclose(
        fixed_corotated_stress(deformation, MU, LAME), numeric, rtol=0, atol=1e-7 * (2 * MU + LAME)
    )


@pytest.mark.parametrize("law", LAWS)
@given(seed=seeds)
def test_stress_turns_with_the_body_and_ignores_turns_of_the_rest_state(law: Law, seed: int) -> None:
    deformation, turn = deformations(seed), rotations(seed + 1)
    stress = law(deformation, MU, LAME)
    # A few matrix products and one decomposition: some ten roundings of numbers of the size of the moduli.
    np.testing.assert_allclose(
        law(turn @ deformation, MU, LAME), turn @ stress @ turn.transpose(0, 2, 1), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(law(deformation @ turn, MU, LAME), stress, rtol=0, atol=1e-12)


@pytest.mark.parametrize("law", LAWS)
@given(seed=seeds)
def test_small_strain_is_hookes_law(law: Law, seed: int) -> None:
    strain = np.random.default_rng(seed).uniform(-1, 1, (10, 3, 3)) * 1e-6
    strain = (strain + strain.transpose(0, 2, 1)) / 2
    hooke = 2 * MU * strain + LAME * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    # The next term of the expansion: some moduli times strain squared.
    np.testing.assert_allclose(law(np.eye(3) + strain, MU, LAME), hooke, rtol=0, atol=50 * (MU + LAME) * 1e-12)


@given(seed=seeds)
def test_polar_rotation_is_a_rotation_even_of_a_mirror_image(seed: int) -> None:
    deformation = deformations(seed) * np.array([1.0, 1.0, -1.0])
    rotation = polar_rotation(deformation)
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(rotation), 1, atol=1e-13)


BULK_MODULUS = LAME + 2 / 3 * MU


def of_mohr_and_coulomb(friction_slope: float, tension: float, stress: Array) -> Array:
    """q - M (p + p_t) (N,) [Pa] of symmetric stresses (N, 3, 3): at most nought is borne."""
    pressure = -np.trace(stress, axis1=1, axis2=2) / 3
    deviator = stress + pressure[:, None, None] * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2)) - friction_slope * (pressure + tension)


@given(seed=seeds, slope=st.floats(0.1, 2.9), loosest=st.floats(0, 0.05))
def test_sand_is_brought_into_the_cone_once(seed: int, slope: float, loosest: float) -> None:
    trial = deformations(seed, 50)
    gain = np.random.default_rng(seed).uniform(0, 0.02, 50)
    projected, left_over = drucker_prager_projection(trial, gain, MU, LAME, slope, loosest)
    trace = np.log(np.linalg.det(projected))
    # Of strains rounding leaves some 1e-13, of stresses the stiffest modulus times as much.
    outside = of_mohr_and_coulomb(slope, BULK_MODULUS * loosest, hencky_stress(projected, MU, LAME))
    assert outside.max() <= 1e-12 * (MU + LAME)
    assert trace.max() <= loosest + 1e-12
    # Shear slips without change of volume, so whatever volume is not elastic is remembered as gain.
    total = np.log(np.linalg.det(trial)) + gain
    np.testing.assert_allclose(trace + left_over, total, rtol=0, atol=1e-12)
    again, _ = drucker_prager_projection(projected, np.zeros(50), MU, LAME, slope, loosest)
    np.testing.assert_allclose(again, projected, rtol=0, atol=1e-12)


def test_sand_inside_the_cone_is_elastic() -> None:
    pressed = 0.99 * np.eye(3)[None]
    projected, gain = drucker_prager_projection(pressed, np.zeros(1), MU, LAME, 1.2, 0.0)
    np.testing.assert_allclose(projected, pressed, rtol=0, atol=1e-15)
    assert gain[0] == 0


def test_sand_that_coheres_is_elastic_in_tension_until_it_parts() -> None:
    pulled = np.exp([0.001, 0.02])[:, None, None] * np.eye(3)
    projected, gain = drucker_prager_projection(pulled, np.zeros(2), MU, LAME, 1.2, 0.03)
    np.testing.assert_allclose(projected[0], pulled[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(projected[1], np.exp(0.01) * np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(gain, [0, 0.03], rtol=0, atol=1e-14)


def test_fluid_bulk_modulus_no_tension_no_shape() -> None:
    still = np.zeros((1, 3, 3))
    squeeze = 1e-6
    rest = np.eye(3)[None]
    squeezed = fluid_deformation(rest, np.array([-squeeze]))
    pressure = -np.trace(fluid_stress(squeezed, still, 5.0, 0.0)[0]) / 3
    # p = K (e + 4 e^2 + ...) of compression e.
    assert pressure == pytest.approx(5.0 * squeeze, rel=1e-5)
    stretched = fluid_deformation(rest, np.array([0.1]))
    assert not fluid_stress(stretched, still, 5.0, 0.0).any()
    assert np.linalg.det(stretched)[0] == pytest.approx(1.1, rel=1e-14)


def test_fluid_viscous_stress_is_newtons() -> None:
    shear = np.zeros((1, 3, 3))
    shear[0, 0, 1] = 2.0
    stress = fluid_stress(np.eye(3)[None], shear, 5.0, 0.7)
    assert stress[0, 0, 1] == pytest.approx(1.4, rel=1e-15)
    swelling = fluid_stress(np.eye(3)[None], np.eye(3)[None], 5.0, 0.7)
    np.testing.assert_allclose(swelling, 0, atol=1e-15)


# --- plastic flow at constant volume --------------------------------------------------------------------------------

YIELD = 0.3
"""A strain at yield of 0.3 / sqrt(6) / 3 = 4 %: of the deformations above some yield and some do not."""
hardenings = st.sampled_from([0.0, 0.5, 20.0, -0.1, -1.0, -1000.0])


def equivalent_stress(deformation: Array) -> Array:
    """sqrt(3/2) |dev tau| (N,)."""
    stress = hencky_stress(deformation, MU, LAME)
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2))


def radius(plastic_strain: Array, hardening: float, residual: float) -> Array:
    return np.maximum(YIELD + hardening * plastic_strain, residual)


@given(seed=seeds, hardening=hardenings, share=st.floats(0.05, 1.0))
def test_von_mises_flow_ends_on_the_yield_surface(seed: int, hardening: float, share: float) -> None:
    residual = share * YIELD
    trial, before = deformations(seed, 50), np.random.default_rng(seed).uniform(0, 0.2, 50)
    flowed, after = von_mises_projection(trial, before, MU, YIELD, hardening, residual)
    yields = equivalent_stress(trial) > radius(before, hardening, residual) + 1e-12
    # What does not yield is not touched, not even by rounding.
    assert (flowed[~yields] == trial[~yields]).all()
    assert (after[~yields] == before[~yields]).all()
    # A decomposition and its way back: some ten roundings of numbers of the size of the moduli, times 20 where p is
    # multiplied by that hardening.
    np.testing.assert_allclose(
        equivalent_stress(flowed[yields]), radius(after, hardening, residual)[yields], rtol=0, atol=1e-12
    )
    # At constant volume, along the deviator, and by as much as is remembered.
    np.testing.assert_allclose(np.linalg.det(flowed), np.linalg.det(trial), rtol=1e-13)
    lost = equivalent_stress(trial) - equivalent_stress(flowed)
    np.testing.assert_allclose(3 * MU * (after - before), np.where(yields, lost, 0), rtol=0, atol=1e-12)
    again, still = von_mises_projection(flowed, after, MU, YIELD, hardening, residual)
    np.testing.assert_allclose(again, flowed, rtol=0, atol=1e-12)
    np.testing.assert_allclose(still, after, rtol=0, atol=1e-12)


def pulled(strain: float, hardening: float, residual: float) -> tuple[float, float]:
    """Axial stress and plastic strain of a bar with free sides at a logarithmic strain along x."""

    def state(side: float) -> tuple[Array, float]:
        trial = np.diag(np.exp([strain, side, side]))[None]
        flowed, plastic = von_mises_projection(trial, np.zeros(1), MU, YIELD, hardening, residual)
        return hencky_stress(flowed, MU, LAME)[0], float(plastic[0])

    side = brentq(lambda side: state(side)[0][1, 1], -strain, strain, xtol=1e-15)
    stress, plastic = state(side)
    return stress[0, 0], plastic


E = MU * (3 * LAME + 2 * MU) / (LAME + MU)


@pytest.mark.parametrize("hardening", [0.0, 0.7, 5.0, -0.5])
def test_a_bar_yields_at_its_yield_stress_and_goes_on_along_its_line(hardening: float) -> None:
    # brentq finds the side to 1e-15, which the stress feels with the moduli.
    strain = YIELD / E
    assert pulled(0.999 * strain, hardening, 1e-3) == (pytest.approx(0.999 * YIELD, abs=1e-13), 0.0)
    slope = E * hardening / (E + hardening)
    for beyond in (0.01, 0.1, 0.2):
        stress, plastic = pulled(strain + beyond, hardening, 1e-3)
        assert stress == pytest.approx(YIELD + slope * beyond, abs=1e-12)
        assert plastic == pytest.approx(beyond * E / (E + hardening), abs=1e-12)


def test_what_softens_keeps_its_residual_stress() -> None:
    assert pulled(0.3, -1.0, 0.8 * YIELD)[0] == pytest.approx(0.8 * YIELD, abs=1e-12)
    # Faster than its springs unload, 2/3 |H| > 2 mu: at once.
    strain = YIELD / (2 * np.sqrt(3) * MU)  # sqrt(3/2) |2 mu dev e| of diag(e, -e, 0)
    for share, left in ((1.01, 0.5 * YIELD), (0.99, 0.99 * YIELD)):
        sheared = np.diag(np.exp(np.array([1, -1, 0]) * share * strain))[None]
        flowed, _ = von_mises_projection(sheared, np.zeros(1), MU, YIELD, -3.1 * MU, 0.5 * YIELD)
        assert equivalent_stress(flowed)[0] == pytest.approx(left, abs=1e-12)


@given(seed=seeds)
def test_foam_without_viscosity_is_metal_that_does_not_harden(seed: int) -> None:
    trial = deformations(seed)
    metal, _ = von_mises_projection(trial, np.zeros(len(trial)), MU, YIELD, 0.0, YIELD)
    np.testing.assert_allclose(viscoplastic_projection(trial, MU, YIELD, 0.0, 1e-3), metal, rtol=0, atol=1e-14)


@given(seed=seeds, viscosity=st.floats(1e-2, 1e2), step=st.floats(1e-4, 1e1))
def test_overstress_flows_off_at_its_rate(seed: int, viscosity: float, step: float) -> None:
    trial = deformations(seed)
    flowed = viscoplastic_projection(trial, MU, YIELD, viscosity, step)
    excess = np.maximum(equivalent_stress(trial) - YIELD, 0)
    left = excess / (1 + 2 * MU * step / viscosity)
    np.testing.assert_allclose(np.maximum(equivalent_stress(flowed) - YIELD, 0), left, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(flowed), np.linalg.det(trial), rtol=1e-13)
    assert (flowed[excess == 0] == trial[excess == 0]).all()


def test_foam_in_steady_shear_is_a_bingham_fluid() -> None:
    yield_stress, viscosity, rate, step = 1e-3, 0.5, 2e-3, 1e-2
    shear = np.zeros((1, 3, 3))
    shear[0, 0, 1] = rate
    deformation = np.eye(3)[None]
    # Ten times as long as the excess takes to settle, eta / (2 mu).
    for _ in range(int(10 * viscosity / (2 * MU) / step)):
        grown = deformation + step * shear @ deformation
        deformation = viscoplastic_projection(grown, MU, yield_stress, viscosity, step)
    found = hencky_stress(deformation, MU, LAME)[0, 0, 1]
    expected = yield_stress / np.sqrt(3) + viscosity * rate / 2
    # e^-10 of the excess is left, and the elastic strain, some stress / mu, turns the axes by as much.
    assert found == pytest.approx(expected, rel=np.exp(-10) + expected / MU)


@given(seed=seeds, hardening=hardenings)
def test_flow_turns_with_the_body_and_ignores_turns_of_the_rest_state(seed: int, hardening: float) -> None:
    trial, turn, zero = deformations(seed), rotations(seed + 1), np.zeros(20)

    def metal(f: Array) -> Array:
        return von_mises_projection(f, zero, MU, YIELD, hardening, 0.1 * YIELD)[0]

    def foam(f: Array) -> Array:
        return viscoplastic_projection(f, MU, YIELD, 2.0, 0.1)

    def snow(f: Array) -> Array:
        return snow_projection(f, zero, 0.025, 0.0075)[0]

    for flow in (metal, foam, snow):
        np.testing.assert_allclose(flow(turn @ trial), turn @ flow(trial), rtol=0, atol=1e-12)
        np.testing.assert_allclose(flow(trial @ turn), flow(trial) @ turn, rtol=0, atol=1e-12)


@given(seed=seeds, hardening=hardenings)
def test_a_closed_cycle_gives_no_energy(seed: int, hardening: float) -> None:
    """Work along straight pieces of F is the gain of elastic energy up to the trial; flow must only take from that."""
    rng = np.random.default_rng(seed)
    # Out through ten random deformations and back to where it began.
    way = [np.eye(3), *deformations(seed, 10), np.eye(3)]
    metal, foam, plastic = np.eye(3)[None], np.eye(3)[None], np.zeros(1)
    work = {"metal": 0.0, "foam": 0.0}
    for here, there in itertools.pairwise(way):
        change = there @ np.linalg.inv(here)
        trial = change @ metal
        work["metal"] += hencky_energy(trial)[0] - hencky_energy(metal)[0]
        metal, plastic = von_mises_projection(trial, plastic, MU, YIELD, hardening, 0.1 * YIELD)
        trial = change @ foam
        work["foam"] += hencky_energy(trial)[0] - hencky_energy(foam)[0]
        foam = viscoplastic_projection(trial, MU, YIELD, 1.0, rng.uniform(0, 1))
    # What was put in is at least what is stored, but for the rounding of twenty energies of some moduli.
    assert work["metal"] >= hencky_energy(metal)[0] - 1e-13
    assert work["foam"] >= hencky_energy(foam)[0] - 1e-13
    assert plastic[0] > 0


# --- snow -----------------------------------------------------------------------------------------------------------


@given(seed=seeds, compression=st.floats(0, 1), stretch=st.floats(0, 0.5))
def test_snow_is_kept_in_its_box_and_remembers_its_volume(seed: int, compression: float, stretch: float) -> None:
    trial = deformations(seed)
    before = np.random.default_rng(seed).uniform(-0.5, 0.5, len(trial))
    kept, after = snow_projection(trial, before, compression, stretch)
    stretches, were = (np.linalg.svd(f, compute_uv=False) for f in (kept, trial))
    assert (stretches >= 1 - compression - 1e-14).all()
    assert (stretches <= 1 + stretch + 1e-14).all()
    np.testing.assert_allclose(np.log(np.linalg.det(kept)) + after, np.log(np.linalg.det(trial)) + before, atol=1e-13)
    inside = ((were > 1 - compression + 1e-14) & (were < 1 + stretch - 1e-14)).all(axis=1)
    assert (kept[inside] == trial[inside]).all()
    assert (after[inside] == before[inside]).all()


def test_snow_hardens_by_the_exponent_of_the_paper_and_vanishes_when_it_is_gone() -> None:
    ratios = np.array([1.0, 0.86, 0.5, 1.3])
    np.testing.assert_allclose(snow_hardening(np.log(ratios), 6.0), np.exp(6.0 * (1 - ratios)), rtol=1e-14)
    # However far it was torn, and whether or not it hardens, it is a number.
    assert snow_hardening(np.array([1e3, 1e300]), 10.0).tolist() == [0.0, 0.0]
    assert snow_hardening(np.array([-1e3, 1e3, 1e300]), 0.0).tolist() == [1.0, 1.0, 1.0]


@given(seed=seeds)
def test_what_is_turned_inside_out_is_upright_after_its_flow(seed: int) -> None:
    trial = rotations(seed) @ (np.array([1.2, 0.9, -0.3])[:, None] * rotations(seed + 1))
    zero = np.zeros(len(trial))
    results = [
        von_mises_projection(trial, zero, MU, YIELD, 1.0, YIELD)[0],
        # So strong that it does not flow.
        von_mises_projection(trial, zero, MU, 1e9, 1.0, 1e9)[0],
        viscoplastic_projection(trial, MU, YIELD, 1e9, 1e-9),
        snow_projection(trial, zero, 0.025, 0.0075)[0],
        snow_projection(trial, zero, 1.0, 9.0)[0],
    ]
    for flowed in results:
        assert (np.linalg.det(flowed) > 0).all()
        assert np.isfinite(hencky_stress(flowed, MU, LAME)).all()
    for crushed in (np.zeros((1, 3, 3)), np.diag([1.0, 1.0, 0.0])[None]):
        flowed, plastic = von_mises_projection(crushed, np.zeros(1), MU, YIELD, 1.0, YIELD)
        assert np.isfinite(flowed).all()
        assert np.isfinite(plastic).all()
