"""Polar rotation and singular columns, in both precisions, of matrices of every kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

__all__ = ["DecompositionTests"]

Array = NDArray[Any]


def _hard_matrices() -> Array:
    """Near identity, sheared, stretched 1e-3..1e3, inverted, singular, repeated singular values; (N, 3, 3)."""
    rng = np.random.default_rng(0)
    near = np.eye(3) + 0.05 * rng.normal(size=(200, 3, 3))
    turned, _ = np.linalg.qr(rng.normal(size=(400, 3, 3)))
    stretched = turned[:200] @ (10 ** rng.uniform(-3, 3, (200, 3, 1)) * turned[200:])
    mirrored = near[:50] @ np.diag([1.0, 1.0, -1.0])
    flat = near[50:100].copy()
    flat[:, :, 1] = flat[:, :, 0]
    return np.concatenate([near, stretched, mirrored, flat, [np.eye(3), -np.eye(3), 2 * np.eye(3)]])


class DecompositionTests:
    """What the decompositions of any engine for explicit MPM owe; a subclass says how its backend computes them."""

    def decompose(self, matrices: Array) -> tuple[Array, Array, Array]:
        """Rotation R, B = F V and V of every matrix F (N, 3, 3), float32 or float64, as the engine computes them."""
        raise NotImplementedError

    @pytest.mark.parametrize("real", [np.float32, np.float64])
    def test_rotation_and_singular_columns(self, real):
        F = _hard_matrices().astype(real)
        R, B, V = (found.astype(np.float64) for found in self.decompose(F))
        F = F.astype(np.float64)
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

    def test_a_matrix_of_rank_one_or_zero_gives_a_rotation(self):
        R, _, _ = self.decompose(np.stack([np.zeros((3, 3)), np.outer([1.0, 2.0, 3.0], [0.0, 1.0, 0.0])]))
        assert np.isfinite(R).all()
        assert np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max() < 1e-12
        assert np.allclose(np.linalg.det(R), 1)
