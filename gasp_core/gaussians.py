"""The Gaussians of a splat: arrays, nothing else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.notebooks import ShownInNotebooks

__all__ = ["Gaussians", "rotation_matrices", "rotation_quaternions"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaussians(ShownInNotebooks):
    """N anisotropic 3D Gaussians with colour, as a trained splat holds them.

    The frame is whatever the file or the caller uses; scenes turn it into metres and +z up in one place.

    Parameters
    ----------
    means : (N, 3)
        Centres.
    quaternions : (N, 4)
        Rotations, w x y z. Need not be normalised: files are not.
    scales : (N, 3)
        Standard deviations along the rotated axes, linear (not logarithms), >= 0.
    opacities : (N,)
        In 0..1 (not logits).
    harmonics : (N, (d + 1)^2, 3)
        Spherical-harmonic colour coefficients of degree d = 0..4 in the 3DGS basis, the constant one first.

    Raises
    ------
    SplatFormatError
        Where the shapes do not belong together.
    """

    means: Array
    quaternions: Array
    scales: Array
    opacities: Array
    harmonics: Array

    def __post_init__(self) -> None:
        for name in ("means", "quaternions", "scales", "opacities", "harmonics"):
            object.__setattr__(self, name, np.asarray(getattr(self, name)))
        count = self.means.shape[0] if self.means.ndim else 0
        expected = {"means": (count, 3), "quaternions": (count, 4), "scales": (count, 3), "opacities": (count,)}
        for name, shape in expected.items():
            found = getattr(self, name).shape
            if found != shape:
                raise SplatFormatError(f"Gaussians.{name} has shape {found}, expected {shape}")
        shape = self.harmonics.shape
        if len(shape) != 3 or shape[0] != count or shape[2] != 3 or shape[1] not in (1, 4, 9, 16, 25):
            raise SplatFormatError(
                f"Gaussians.harmonics has shape {shape}, expected ({count}, K, 3) with K = 1, 4, 9, 16 or 25"
            )

    def __len__(self) -> int:
        return int(self.means.shape[0])

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics."""
        return round(self.harmonics.shape[1] ** 0.5) - 1

    def covariances(self) -> Array:
        """Covariance matrices R S^2 R^T, (N, 3, 3), float64."""
        axes = rotation_matrices(self.quaternions) * self.scales.astype(np.float64)[:, None, :]
        return axes @ axes.transpose(0, 2, 1)

    def select(self, rows: ArrayLike) -> Gaussians:
        """The Gaussians of the given rows (indices or a mask), in that order."""
        index = np.asarray(rows)
        # An empty list becomes an array of floats, which selects nothing but an error.
        index = index.astype(np.intp) if index.size == 0 and index.dtype != bool else index
        return Gaussians(
            means=self.means[index],
            quaternions=self.quaternions[index],
            scales=self.scales[index],
            opacities=self.opacities[index],
            harmonics=self.harmonics[index],
        )

    def with_(self, **arrays: Array) -> Gaussians:
        """A copy with some arrays exchanged."""
        return replace(self, **arrays)


def rotation_matrices(quaternions: ArrayLike) -> Array:
    """Rotation matrices of quaternions.

    Parameters
    ----------
    quaternions : (N, 4)
        w x y z, of any length but zero; a zero or non-finite one gives the identity.

    Returns
    -------
    (N, 3, 3) float64, det +1; column k is the k-th rotated axis.
    """
    q = np.asarray(quaternions, dtype=np.float64)
    # Dividing by the largest entry first keeps the norm of 1e-200 from underflowing to zero.
    largest = np.max(np.abs(q), axis=1, keepdims=True)
    usable = np.isfinite(largest) & (largest > 0)
    q = np.where(usable, q, [1.0, 0.0, 0.0, 0.0]) / np.where(usable, largest, 1.0)
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    w, x, y, z = q.T
    matrices = np.empty((len(q), 3, 3))
    matrices[:, 0, 0] = 1 - 2 * (y * y + z * z)
    matrices[:, 0, 1] = 2 * (x * y - w * z)
    matrices[:, 0, 2] = 2 * (x * z + w * y)
    matrices[:, 1, 0] = 2 * (x * y + w * z)
    matrices[:, 1, 1] = 1 - 2 * (x * x + z * z)
    matrices[:, 1, 2] = 2 * (y * z - w * x)
    matrices[:, 2, 0] = 2 * (x * z - w * y)
    matrices[:, 2, 1] = 2 * (y * z + w * x)
    matrices[:, 2, 2] = 1 - 2 * (x * x + y * y)
    return matrices


def rotation_quaternions(matrices: ArrayLike) -> Array:
    """Unit quaternions w x y z, (N, 4) float64 with w >= 0, of rotation matrices (N, 3, 3)."""
    m = np.asarray(matrices, dtype=np.float64)
    # Shepperd's method (J. Guidance and Control 1, 1978): divide by the largest of the four, never by a small one.
    diagonal = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    trace = diagonal.sum(axis=1)
    choice = np.argmax(np.concatenate([trace[:, None], diagonal], axis=1), axis=1)
    q = np.empty((len(m), 4))
    rows = choice == 0
    q[rows, 0] = 1 + trace[rows]
    q[rows, 1] = (m[:, 2, 1] - m[:, 1, 2])[rows]
    q[rows, 2] = (m[:, 0, 2] - m[:, 2, 0])[rows]
    q[rows, 3] = (m[:, 1, 0] - m[:, 0, 1])[rows]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows = choice == i + 1
        q[rows, 0] = (m[:, k, j] - m[:, j, k])[rows]
        q[rows, 1 + i] = (1 + 2 * diagonal[:, i] - trace)[rows]
        q[rows, 1 + j] = (m[:, j, i] + m[:, i, j])[rows]
        q[rows, 1 + k] = (m[:, k, i] + m[:, i, k])[rows]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q[q[:, 0] < 0] *= -1
    return q
