"""Turning of colour: c'(d) = c(R^T d) for every direction, which needs no knowledge of how it is done."""

import numpy as np
import pytest

from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis, material_directions, turn_coefficients


def unit_vectors(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_turned_coefficients_show_the_old_colour_in_the_turned_back_direction(degree):
    rng = np.random.default_rng(degree)
    harmonics = rng.normal(size=(20, (degree + 1) ** 2, 3))
    rotations = rotation_matrices(rng.normal(size=(20, 4)))
    turned = turn_coefficients(harmonics, rotations)
    for _ in range(10):
        directions = unit_vectors(rng, 20)
        now = np.einsum("nk,nkc->nc", basis(directions, degree), turned)
        before = np.einsum("nk,nkc->nc", basis(material_directions(directions, rotations), degree), harmonics)
        # Sums of <= 25 products of order 4, projected once: a few hundred roundings of 1e-16.
        np.testing.assert_allclose(now, before, atol=1e-12)


def test_basis_is_orthonormal():
    """Gauss-Legendre in height times a uniform rule in angle integrates degree 8 exactly."""
    heights, weights = np.polynomial.legendre.leggauss(12)
    angles = 2 * np.pi * np.arange(24) / 24
    z, angle = (grid.ravel() for grid in np.meshgrid(heights, angles, indexing="ij"))
    radius = np.sqrt(1 - z * z)
    values = basis(np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1), 4)
    gram = np.einsum("n,ni,nj->ij", np.repeat(weights, 24) * 2 * np.pi / 24, values, values)
    np.testing.assert_allclose(gram, np.eye(25), atol=1e-12)


def test_identity_changes_no_bit():
    harmonics = np.random.default_rng(1).normal(size=(50, 16, 3)).astype(np.float32)
    rotations = np.broadcast_to(np.eye(3), (50, 3, 3)).copy()
    rotations[:25] += 1e-9
    turned = turn_coefficients(harmonics, rotations)
    assert turned.dtype == np.float32
    np.testing.assert_array_equal(turned, harmonics)
