"""Polar rotation and singular columns, in both precisions, of matrices of every kind."""

import numpy as np
import pytest
import warp as wp
from gasp_warp_mpm import runtime
from gasp_warp_mpm.decompositions import algebra, make_decompositions


def hard_matrices():
    """Near identity, sheared, stretched 1e-3..1e3, inverted, singular, repeated singular values; (N, 3, 3)."""
    rng = np.random.default_rng(0)
    near = np.eye(3) + 0.05 * rng.normal(size=(200, 3, 3))
    turned, _ = np.linalg.qr(rng.normal(size=(400, 3, 3)))
    stretched = turned[:200] @ (10 ** rng.uniform(-3, 3, (200, 3, 1)) * turned[200:])
    mirrored = near[:50] @ np.diag([1.0, 1.0, -1.0])
    flat = near[50:100].copy()
    flat[:, :, 1] = flat[:, :, 0]
    return np.concatenate([near, stretched, mirrored, flat, [np.eye(3), -np.eye(3), 2 * np.eye(3)]])


def decompose(matrices, real):
    """Rotation, B and V of every matrix as the engine computes them."""
    double = real is np.float64
    kind = wp.float64 if double else wp.float32
    tolerance = kind(1e-15 if double else 1e-7)
    mat33 = algebra(kind).mat33
    functions = make_decompositions(kind)
    cofactors, determinant_with = functions.cofactors, functions.determinant_with
    rotation_of, singular_columns = functions.rotation_of, functions.singular_columns

    @wp.kernel(module="unique", enable_backward=False)
    def work(
        given: wp.array(dtype=mat33),
        rotation: wp.array(dtype=mat33),
        columns: wp.array(dtype=mat33),
        right: wp.array(dtype=mat33),
    ):
        p = wp.tid()
        F = given[p]
        K = cofactors(F)
        rotation[p] = rotation_of(F, K, determinant_with(F, K), tolerance, tolerance)
        B, V = singular_columns(F, tolerance)
        columns[p] = B
        right[p] = V

    device = runtime.device_for("cpu")
    given = matrices.astype(real)
    results = [wp.zeros(len(given), dtype=mat33, device=device) for _ in range(3)]
    wp.launch(work, dim=len(given), inputs=[wp.array(given, dtype=mat33, device=device), *results], device=device)
    return given.astype(np.float64), *[result.numpy().astype(np.float64) for result in results]


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_rotation_and_singular_columns(real):
    F, R, B, V = decompose(hard_matrices(), real)
    eps = np.finfo(real).eps
    identity = np.eye(3)
    # A handful of sweeps of three rotations, each rounding to a few ulps.
    assert np.abs(V.transpose(0, 2, 1) @ V - identity).max() < 60 * eps
    size = np.linalg.norm(F, axis=(1, 2))
    assert (np.abs(F @ V - B).max(axis=(1, 2)) < 60 * eps * size).all()
    found = np.sort(np.linalg.norm(B, axis=1), axis=1)[:, ::-1]
    expected = np.linalg.svd(F, compute_uv=False)
    assert (np.abs(found - expected).max(axis=1) < 60 * eps * size).all()

    assert np.abs(R.transpose(0, 2, 1) @ R - identity).max() < 200 * eps
    assert (np.linalg.det(R) > 0).all()
    # R^T F is symmetric, and of all rotations R has the largest tr(R^T F): s1 + s2 + sign(det F) s3.
    stretch = R.transpose(0, 2, 1) @ F
    best = expected[:, 0] + expected[:, 1] + np.sign(np.linalg.det(F)) * expected[:, 2]
    # Newton's inverse loses up to the condition number, about 1e3 where it is used.
    assert (np.abs(np.trace(stretch, axis1=1, axis2=2) - best) < 1e4 * eps * size).all()


def test_a_matrix_of_rank_one_or_zero_gives_a_rotation():
    matrices = np.stack([np.zeros((3, 3)), np.outer([1.0, 2.0, 3.0], [0.0, 1.0, 0.0])])
    _, R, _, _ = decompose(matrices, np.float64)
    assert np.isfinite(R).all()
    assert np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max() < 1e-12
    assert np.allclose(np.linalg.det(R), 1)
