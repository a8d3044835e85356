from __future__ import annotations

from typing import Any

import numpy as np
from gasp_reference_mpm.substep import seeded_affine_velocities
from gasp_reference_mpm.transfer import carried, gather, inverse_inertia, local_means, scatter, stencil_around
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gasp_core.stepping.mpm import presence

Array = NDArray[Any]

SPACING = 0.2
seeds = st.integers(0, 2**32 - 1)


def one_body(positions):
    return stencil_around(positions, SPACING, np.zeros(len(positions), dtype=int))


def spin(matrices: Array) -> Array:
    """The axial vector e_ijk M_kj of the antisymmetric part, (..., 3)."""
    return np.stack(
        [
            matrices[..., 2, 1] - matrices[..., 1, 2],
            matrices[..., 0, 2] - matrices[..., 2, 0],
            matrices[..., 1, 0] - matrices[..., 0, 1],
        ],
        axis=-1,
    )


@given(seed=seeds)
def test_weights_are_a_partition_with_the_same_inertia_everywhere(seed: int) -> None:
    stencil = one_body(np.random.default_rng(seed).uniform(-2, 2, (30, 3)))
    np.testing.assert_allclose(stencil.weights.sum(axis=1), 1, rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.einsum("nk,nki->ni", stencil.weights, stencil.arms), 0, atol=1e-15)
    inertia = np.einsum("nk,nki,nkj->nij", stencil.weights, stencil.arms, stencil.arms)
    np.testing.assert_allclose(inertia * inverse_inertia(SPACING), np.tile(np.eye(3), (30, 1, 1)), atol=1e-13)
    # What stress gives to the nodes is no momentum and no angular momentum, and an affine field's gradient is exact.
    np.testing.assert_allclose(stencil.gradients.sum(axis=1), 0, atol=1e-13 / SPACING)
    np.testing.assert_allclose(
        np.einsum("nki,nkj->nij", stencil.gradients, stencil.arms), np.tile(np.eye(3), (30, 1, 1)), atol=1e-13
    )


@given(seed=seeds)
def test_affine_fields_survive_the_round_trip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 1, (40, 3))
    masses = rng.uniform(0.1, 2, 40)
    gradient, velocity = rng.uniform(-1, 1, (3, 3)), rng.uniform(-1, 1, 3)
    velocities = positions @ gradient.T + velocity
    stencil = one_body(positions)
    everywhere = np.tile(gradient, (40, 1, 1))
    grid = scatter(stencil, SPACING, masses, velocities, everywhere, np.zeros((40, 3, 3)))
    back, affine, gradients = gather(stencil, SPACING, grid.nodes, grid.momentum / grid.mass[:, None])
    # Some hundred roundings of numbers of order one; the gradient's are divided by the spacing.
    np.testing.assert_allclose(back, velocities, rtol=0, atol=1e-13)
    np.testing.assert_allclose(affine, everywhere, rtol=0, atol=1e-12)
    np.testing.assert_allclose(gradients, everywhere, rtol=0, atol=1e-12)


@given(seed=seeds)
def test_mass_linear_and_angular_momentum_go_both_ways(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions, velocities = rng.uniform(0, 1, (40, 3)), rng.uniform(-1, 1, (40, 3))
    gradients, masses = rng.uniform(-1, 1, (40, 3, 3)), rng.uniform(0.1, 2, 40)
    tensions = rng.uniform(-1, 1, (40, 3, 3))
    tensions += tensions.transpose(0, 2, 1)

    def momenta(v: Array, c: Array) -> tuple[Array, Array]:
        own = spin(masses[:, None, None] * c).sum(axis=0) / inverse_inertia(SPACING)
        return masses @ v, masses @ np.cross(positions, v) + own

    stencil = one_body(positions)
    grid = scatter(stencil, SPACING, masses, velocities, gradients, tensions)
    linear, angular = momenta(velocities, gradients)
    # Sums of 40 x 27 products of numbers of order one.
    np.testing.assert_allclose(grid.mass.sum(), masses.sum(), rtol=1e-14)
    np.testing.assert_allclose(grid.momentum.sum(axis=0), linear, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.cross(grid.positions, grid.momentum).sum(axis=0), angular, rtol=0, atol=1e-12)
    after = gather(stencil, SPACING, grid.nodes, grid.momentum / grid.mass[:, None])[:2]
    for found, wanted in zip(momenta(*after), (linear, angular)):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def test_seeding_finds_the_gradient_of_a_spin_and_none_for_lone_points() -> None:
    axis = (np.arange(8) + 0.5) * SPACING / 2
    positions = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    masses = np.ones(len(positions))
    velocities = np.cross([0.3, -0.2, 1.0], positions)
    exact = np.array([[0, -1.0, -0.2], [1.0, 0, -0.3], [0.2, 0.3, 0]])
    error = (
        seeded_affine_velocities(positions, SPACING, np.zeros(len(positions), dtype=int), masses, velocities) - exact
    )
    # The first answer is wrong by half the spin at corners, and the error shrinks by 0.61 a pass: 0.5 * 0.61^15.
    assert np.abs(error).max() < 5e-4
    assert np.abs(error.mean(axis=0)).max() < 2e-4
    lone = seeded_affine_velocities(
        positions[:1], SPACING, np.zeros(1, dtype=int), masses[:1], np.array([[3.0, 2.0, 1.0]])
    )
    # w (v + w v + ...) r sums to zero up to rounding of v / dx.
    assert np.abs(lone).max() < 1e-13 * 3 / SPACING


@given(seed=seeds)
def test_the_work_of_the_stress_is_what_the_rate_of_deformation_takes(seed: int) -> None:
    # Forces and strains by the same kernel: what leaves the points' elastic energy arrives in the nodes' motion.
    rng = np.random.default_rng(seed)
    positions, tensions = rng.uniform(0, 1, (40, 3)), rng.uniform(-1, 1, (40, 3, 3))
    stencil = one_body(positions)
    still = np.zeros((40, 3, 3))
    grid = scatter(stencil, SPACING, np.ones(40), np.zeros((40, 3)), still, tensions)
    velocities = rng.uniform(-1, 1, grid.momentum.shape)
    _, _, gradients = gather(stencil, SPACING, grid.nodes, velocities)
    # Sums of 40 x 27 products of numbers of order 1/dx.
    np.testing.assert_allclose(np.sum(grid.momentum * velocities), -np.sum(tensions * gradients), rtol=0, atol=1e-10)


@given(seed=seeds)
def test_local_means_are_of_an_energy_below_that_of_the_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    stencil = one_body(rng.uniform(0, 1, (40, 3)))
    rows, volumes = np.arange(5, 40), rng.uniform(0.1, 2, 35)
    means = np.stack([local_means(stencil, rows, volumes, unit) for unit in np.eye(35)], axis=1)
    # A constant is its own mean.
    np.testing.assert_allclose(means.sum(axis=1), 1, rtol=0, atol=1e-13)
    # V A is symmetric, so A is the gradient of an energy; its values are those of means, between 0 and 1.
    energy = volumes[:, None] * means
    np.testing.assert_allclose(energy, energy.T, rtol=0, atol=1e-13)
    share = np.linalg.eigvalsh(energy / np.sqrt(volumes[:, None] * volumes))
    assert share.min() > -1e-12 and share.max() < 1 + 1e-12


def test_a_lone_point_is_its_own_mean() -> None:
    stencil = one_body(np.array([[0.13, -0.21, 0.07]]))
    np.testing.assert_allclose(local_means(stencil, np.array([0]), np.array([3.0]), np.array([0.7])), 0.7, rtol=1e-14)


@given(seed=seeds)
def test_tracers_go_with_what_is_near_and_rest_where_nothing_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 1, (40, 3))
    stencil = one_body(positions)
    velocity, gradient = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, (3, 3))
    masses, still = rng.uniform(0.1, 2, 40), np.zeros((40, 3, 3))
    places = np.concatenate([positions, rng.uniform(-1, 2, (40, 3)), [[1e300, 0, 0], [0, -1e9, 0]]])

    grid = scatter(stencil, SPACING, masses, np.tile(velocity, (40, 1)), still, still)
    found = carried(
        stencil,
        SPACING,
        grid.nodes,
        presence(grid.mass, float(masses.mean())),
        grid.momentum / grid.mass[:, None],
        places,
        np.zeros(len(places), dtype=int),
    )
    apart = np.abs(places[:, None] - positions).max(axis=2).min(axis=1)
    moving = found.any(axis=1)
    # A node is within 1.5 cells of what gives to it and of what takes from it.
    assert not moving[apart > 3 * SPACING].any()
    assert moving[:40].all()
    # A mean of equal numbers, to some roundings.
    np.testing.assert_allclose(found[moving], np.tile(velocity, (int(moving.sum()), 1)), rtol=0, atol=1e-13)

    # Where every node is fully present, an affine field is exact.
    filled = np.stack(np.meshgrid(*[np.arange(12) * SPACING / 2] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    stencil = one_body(filled)
    alike, none = np.ones(len(filled)), np.zeros((len(filled), 3, 3))
    grid = scatter(stencil, SPACING, alike, filled @ gradient.T, np.tile(gradient, (len(filled), 1, 1)), none)
    inside = rng.uniform(0.3, 0.7, (40, 3))
    found = carried(
        stencil,
        SPACING,
        grid.nodes,
        presence(grid.mass, 1.0),
        grid.momentum / grid.mass[:, None],
        inside,
        np.zeros(len(inside), dtype=int),
    )
    np.testing.assert_allclose(found, inside @ gradient.T, rtol=0, atol=1e-13)
