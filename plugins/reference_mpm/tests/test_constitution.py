from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gasp_reference_mpm.constitution import (
    drucker_prager_projection,
    fixed_corotated_stress,
    fluid_deformation,
    fluid_stress,
    hencky_stress,
    neo_hookean_stress,
    polar_rotation,
)
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

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


def yield_value(deformation: Array, friction_angle: float) -> tuple[Array, Array]:
    """How far outside the cone (at most 0 is inside) and trace of the strain."""
    strains = np.log(np.linalg.svd(deformation, compute_uv=False))
    trace = strains.sum(axis=1)
    sine = np.sin(np.radians(friction_angle))
    slope = np.sqrt(2 / 3) * 2 * sine / (3 - sine)
    deviator = np.linalg.norm(strains - trace[:, None] / 3, axis=1)
    return deviator + (3 * LAME + 2 * MU) / (2 * MU) * trace * slope, trace


@given(seed=seeds, angle=st.floats(5, 60))
def test_sand_is_brought_into_the_cone_once(seed: int, angle: float) -> None:
    trial = deformations(seed, 50)
    gain = np.random.default_rng(seed).uniform(0, 0.02, 50)
    projected, left_over = drucker_prager_projection(trial, gain, MU, LAME, angle)
    outside, trace = yield_value(projected, angle)
    assert outside.max() <= 1e-12
    assert trace.max() <= 1e-12
    # Shear slips without change of volume, so whatever volume is not elastic is remembered as gain.
    total = np.log(np.linalg.det(trial)) + gain
    np.testing.assert_allclose(trace + left_over, total, rtol=0, atol=1e-12)
    again, _ = drucker_prager_projection(projected, np.zeros(50), MU, LAME, angle)
    np.testing.assert_allclose(again, projected, rtol=0, atol=1e-12)


def test_sand_inside_the_cone_is_elastic() -> None:
    pressed = 0.99 * np.eye(3)[None]
    projected, gain = drucker_prager_projection(pressed, np.zeros(1), MU, LAME, 35.0)
    np.testing.assert_allclose(projected, pressed, rtol=0, atol=1e-15)
    assert gain[0] == 0


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
