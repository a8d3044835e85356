"""Where the body is: a field that is one inside and none outside, from oriented surfels and from light.

The screened Poisson reconstruction of Kazhdan and Hoppe (2013, 10.1145/2487228.2487237), screened here by what light
tells: chi minimises

    integral |grad chi + V|^2 + a chi^2 + b (1 - chi)^2,   V = the normals of the surfels, as a density of area,

a where a place is known to be air, b where it is known to be dark: -laplace chi + (a + b) chi = div V + b. Nothing
flows through the faces of the grid, so that what lies on its lowest one goes on below as a mirror image.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["indicator"]

Array = NDArray[Any]

_TOLERANCE = 1e-3
"""Of the largest residual at the start, where chi goes from 0 to 1."""
_MOST_STEPS = 100


def indicator(normals: Array, air: Array, dark: Array) -> Array:
    """chi (X, Y, Z) on the nodes of a grid; all in spacings.

    Parameters
    ----------
    normals : (3, X, Y, Z)
        Area of surface per volume times its outward normal.
    air, dark : (X, Y, Z)
        Weights >= 0 of what is known, somewhere > 0.

    By conjugate gradients, preconditioned by the same equation with one weight for all places, which the cosine
    transform solves.
    """
    from scipy import fft

    transform, back = cast("list[Any]", [fft.dctn, fft.idctn])
    screen = air + dark
    right = sum(np.gradient(normals[axis], axis=axis) for axis in range(3)) + dark
    eigenvalues = sum(
        np.meshgrid(
            *(2 - 2 * np.cos(np.pi * np.arange(count) / count) for count in right.shape), indexing="ij", sparse=True
        )
    )
    shifted = eigenvalues + screen.mean()

    def nearly_solved(residual: Array) -> Array:
        return back(transform(residual, type=2, norm="ortho") / shifted, type=2, norm="ortho")

    found = nearly_solved(right)
    residual = right - _applied(found, screen)
    bound = _TOLERANCE * float(np.abs(right).max())
    step = ready = nearly_solved(residual)
    product = float((residual * ready).sum())
    for _ in range(_MOST_STEPS):
        if float(np.abs(residual).max()) <= bound:
            break
        image = _applied(step, screen)
        length = product / float((step * image).sum())
        found = found + length * step
        residual = residual - length * image
        ready = nearly_solved(residual)
        product, before = float((residual * ready).sum()), product
        step = ready + product / before * step
    return found


def _applied(field: Array, screen: Array) -> Array:
    """-laplace field + screen field, no flow through the faces of the grid."""
    out = screen * field
    for axis in range(3):
        slopes = np.diff(field, axis=axis)
        upper, lower = [slice(None)] * 3, [slice(None)] * 3
        upper[axis], lower[axis] = slice(1, None), slice(None, -1)
        out[tuple(upper)] += slopes
        out[tuple(lower)] -= slopes
    return out
