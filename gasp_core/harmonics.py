"""Colour that depends on the direction of view, and how it turns with the matter it sits on.

The basis is that of 3DGS: real spherical harmonics with the Condon-Shortley phase left in, in the order
l = 0, 1, 2, 3, 4 and m = -l..l. A Gaussian turned by R shows in direction d the colour it showed before in R^T d.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["basis", "material_directions", "spread_directions", "turn_coefficients"]

Array = NDArray[Any]

_UNTURNED = 2.0**-25
"""Turning by less changes no bit of a float32 coefficient."""

_CHUNK = 16_384


def basis(directions: Array, degree: int) -> Array:
    """Real spherical harmonics of the 3DGS basis.

    Parameters
    ----------
    directions : (N, 3)
        Unit vectors.
    degree
        0..4.

    Returns
    -------
    (N, (degree + 1)^2) float64
    """
    x, y, z = np.asarray(directions, dtype=np.float64).T
    columns = [np.full_like(x, 0.28209479177387814)]
    if degree >= 1:
        columns += [-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x]
    xx, yy, zz = x * x, y * y, z * z
    if degree >= 2:
        columns += [
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.31539156525252005 * (2 * zz - xx - yy),
            -1.0925484305920792 * x * z,
            0.5462742152960396 * (xx - yy),
        ]
    if degree >= 3:
        columns += [
            -0.5900435899266435 * y * (3 * xx - yy),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * zz - xx - yy),
            0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
            -0.4570457994644658 * x * (4 * zz - xx - yy),
            1.445305721320277 * z * (xx - yy),
            -0.5900435899266435 * x * (xx - 3 * yy),
        ]
    if degree >= 4:
        columns += [
            2.5033429417967046 * x * y * (xx - yy),
            -1.7701307697799304 * y * z * (3 * xx - yy),
            0.9461746957575601 * x * y * (7 * zz - 1),
            -0.6690465435572892 * y * z * (7 * zz - 3),
            0.10578554691520431 * (zz * (35 * zz - 30) + 3),
            -0.6690465435572892 * x * z * (7 * zz - 3),
            0.47308734787878004 * (xx - yy) * (7 * zz - 1),
            -1.7701307697799304 * x * z * (xx - 3 * yy),
            0.6258357354491761 * (xx * (xx - 3 * yy) - yy * (3 * xx - yy)),
        ]
    return np.stack(columns, axis=1)


def spread_directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere, along the golden spiral (Fibonacci)."""
    step = np.arange(count) + 0.5
    height = 1 - 2 * step / count
    turn = np.pi * (1 + 5**0.5) * step
    radius = np.sqrt(1 - height * height)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


@lru_cache(maxsize=8)
def _sampling(degree: int) -> tuple[Array, Array]:
    """Directions (K, 3) spread over the sphere, and the matrix (2l + 1, K) that projects band `degree` from them."""
    directions = spread_directions(4 * (2 * degree + 1))
    return directions, np.linalg.pinv(basis(directions, degree)[:, degree**2 :])


def turn_coefficients(harmonics: Array, rotations: Array) -> Array:
    """Coefficients of Gaussians turned by rotations: c'(d) = c(R^T d) for all d.

    Each band l turns in itself, so it is enough to look in enough directions and project back. For drawing,
    `material_directions` is cheaper and needs no new coefficients; this is for export.

    Parameters
    ----------
    harmonics : (N, (d + 1)^2, 3)
    rotations : (N, 3, 3)

    Returns
    -------
    (N, (d + 1)^2, 3), dtype kept; bit-equal to the input where the rotation is the identity.
    """
    degree = round(harmonics.shape[1] ** 0.5) - 1
    turned = np.array(harmonics)
    rows = np.flatnonzero(np.abs(rotations - np.eye(3)).max(axis=(1, 2), initial=0.0) > _UNTURNED)
    for start in range(0, len(rows), _CHUNK):
        part = rows[start : start + _CHUNK]
        for band in range(1, degree + 1):
            directions, projection = _sampling(band)
            own = slice(band**2, (band + 1) ** 2)
            # R^T d for every Gaussian and direction, as rows: d^T R.
            seen = (directions @ rotations[part]).reshape(-1, 3)
            values = basis(seen, band)[:, own].reshape(len(part), len(directions), -1)
            turned[part, own] = projection @ (values @ harmonics[part, own].astype(np.float64))
    return turned


def material_directions(directions: Array, rotations: Array) -> Array:
    """R^T d: view directions (N, 3) as material turned by R (N, 3, 3) sees them; they go with the old coefficients."""
    return np.einsum("nji,nj->ni", rotations, directions)
