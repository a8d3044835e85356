"""Gaussians summed up on the nodes of a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid import kernels
from gasp_core.solid.grid import Grid

__all__ = ["summed_gaussians"]

Array = NDArray[Any]


def summed_gaussians(grid: Grid, means: Array, covariances: Array, peaks: Array, width: float) -> Array:
    """Sum (X, Y, Z) of Gaussians of the given peaks (N,), their covariances (N, 3, 3) widened by width^2.

    The peaks are those after the widening. Each reaches to three standard deviations.
    """
    out = np.zeros(grid.shape)
    wide = covariances + width**2 * np.eye(3)
    inverses = np.linalg.inv(wide).reshape(-1, 9)[:, (0, 1, 2, 4, 5, 8)] * grid.spacing**2
    reach = kernels.CUT * np.sqrt(np.einsum("nii->ni", wide)) / grid.spacing
    kernels.add_gaussians(out, grid.places(means), inverses, reach, peaks)
    return out
