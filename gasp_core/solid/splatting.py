"""Gaussians summed up on the nodes of a grid."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid import kernels
from gasp_core.solid.grid import Grid
from gasp_core.stepping.threads import processors

__all__ = ["summed_gaussians"]

Array = NDArray[Any]


def summed_gaussians(grid: Grid, means: Array, covariances: Array, peaks: Array, width: float) -> Array:
    """Sums (F, X, Y, Z) of Gaussians of the given peaks (F, N), their covariances (N, 3, 3) widened by width^2.

    The peaks are those after the widening. Each reaches to three standard deviations.
    """
    out = np.zeros((len(peaks), *grid.shape))
    inverses = np.empty((len(means), 6))
    kernels.inverses_of(covariances, width, grid.spacing**2, inverses)
    variances = np.einsum("nii->ni", covariances) + width**2
    reach = kernels.CUT * np.sqrt(variances) / grid.spacing
    places = grid.places(means)
    # Each thread has rows of its own, and about as many Gaussians; a node's sum is the same however many there are.
    threads = processors()
    bounds = np.quantile(places[:, 0], np.arange(1, threads) / threads, method="nearest") if len(places) else []
    rows = [0, *np.clip(np.rint(bounds), 0, grid.shape[0]).astype(int).tolist(), grid.shape[0]]

    def add(first: int, end: int) -> None:
        kernels.add_gaussians(out, first, end, places, inverses, reach, peaks)

    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(add, rows[:-1], rows[1:]):
            pass
    return out
