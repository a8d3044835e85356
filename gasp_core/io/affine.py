"""Gaussians where an affine map of a file's nodes puts them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.harmonics import turn_coefficients

__all__ = ["flattens", "moved"]

Array = NDArray[Any]

_FLAT = 1e-9
"""Smallest over largest stretch of a map that leaves no third dimension."""
_LARGEST = 1e18
"""Stretch or way that no file means; the square is still a number of float32."""
_ALIKE = 1e-6
"""Difference of stretches that is rounding: files hold matrices as float32."""
_CHUNK = 1 << 14


def flattens(matrix: Array) -> bool:
    """Whether a map (4, 4) squeezes space to a plane or a point, or blows it up beyond all bounds."""
    if not np.all(np.abs(matrix) < _LARGEST):
        return True
    stretches = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return not stretches[2] > max(_FLAT * stretches[0], 1 / _LARGEST)


def moved(gaussians: Gaussians, matrix: Array) -> Gaussians:
    """Gaussians under x -> A x + b, their covariances A Sigma A^T to rounding.

    Harmonics turn with the orthogonal matrix nearest to A, a mirror where A is one. The identity changes no bit.

    Parameters
    ----------
    gaussians
        Rows that are not finite stay such.
    matrix : (4, 4)
        A and b above (0, 0, 0, 1); `flattens` is not true of it.

    Returns
    -------
    Gaussians
        Means in float64, as a map may take them far from the origin; all else float32.
    """
    if np.array_equal(matrix, np.eye(4)):
        return gaussians
    linear = matrix[:3, :3]
    left, stretches, right = np.linalg.svd(linear)
    nearest = left @ right
    with np.errstate(invalid="ignore", over="ignore"):
        means = gaussians.means.astype(np.float64) @ linear.T + matrix[:3, 3]
        if stretches[0] - stretches[2] <= _ALIKE * stretches[0]:
            # The covariance does not tell R from -R, and one of the two is a rotation.
            turn = nearest * np.sign(np.linalg.det(nearest))
            quaternions = _product(rotation_quaternions(turn[None])[0], gaussians.quaternions)
            scales = gaussians.scales.astype(np.float64) * stretches.mean()
        else:
            quaternions, scales = _stretched(gaussians, linear)
        harmonics = _turned(gaussians.harmonics, nearest)
        return Gaussians(
            means=means,
            quaternions=quaternions.astype(np.float32),
            scales=scales.astype(np.float32),
            opacities=gaussians.opacities,
            harmonics=harmonics,
        )


def _turned(harmonics: Array, turn: Array) -> Array:
    """Harmonics (N, K, 3) of Gaussians that are all turned, or mirrored, by one orthogonal matrix; float32."""
    count = harmonics.shape[1]
    # Where one of them goes, others aside, is a row.
    ways = np.repeat(np.eye(count)[:, :, None], 3, axis=2)
    ways = turn_coefficients(ways, np.broadcast_to(turn, (count, 3, 3)))[:, :, 0]
    turned = np.empty(harmonics.shape, np.float32)
    for start in range(0, len(harmonics), _CHUNK):
        part = slice(start, start + _CHUNK)
        turned[part] = ways.T @ harmonics[part].astype(np.float64)
    return turned


def _product(turn: Array, quaternions: Array) -> Array:
    """Quaternions (N, 4), w x y z, behind which one more is turned; lengths stay."""
    a, u = turn[0], turn[1:]
    w, v = quaternions[:, :1].astype(np.float64), quaternions[:, 1:].astype(np.float64)
    return np.concatenate([a * w - v @ u[:, None], a * v + w * u + np.cross(u, v)], axis=1)


def _stretched(gaussians: Gaussians, linear: Array) -> tuple[Array, Array]:
    """Principal axes (N, 4) and deviations (N, 3) of covariances A Sigma A^T."""
    quaternions, scales = np.empty((len(gaussians), 4)), np.full((len(gaussians), 3), np.nan)
    for start in range(0, len(gaussians), _CHUNK):
        part = slice(start, start + _CHUNK)
        own = gaussians.quaternions[part]
        edges = linear @ (rotation_matrices(own) * gaussians.scales[part].astype(np.float64)[:, None])
        whole = np.asarray(np.isfinite(edges).all(axis=(1, 2)) & np.isfinite(own).all(axis=1))
        # A decomposition of what is not finite does not end well.
        axes, found, _ = np.linalg.svd(np.where(whole[:, None, None], edges, 0.0))
        axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, None]
        quaternions[part] = np.where(whole[:, None], rotation_quaternions(axes), own)
        scales[part][whole] = found[whole]
    return quaternions, scales
