"""Affine fits over clusters of simplices, one for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.moments import known_inverses
from gasp_core.reduction.clusters import averages, scatter

__all__ = ["AffineFits", "affine_fits"]

Array = NDArray[Any]

_THIN = 1e-9
"""Least share of a cluster's shortest axis squared in its longest one squared for a slope along it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AffineFits:
    """Fits of C clusters, in the sense of least squares.

    Parameters
    ----------
    centres : (C, 3) [m]
    means : (C, 3)
        Of the values.
    slopes : (C, 3, 3)
        Of them, along the axes that are known.
    axes : (C, 3, 3)
        Principal ones, columns, the shortest first.
    known : (C, 3) bool
        Those that the vertices extend along.
    """

    centres: Array
    means: Array
    slopes: Array
    axes: Array
    known: Array

    def at(self, corners: Array, slopes: Array | None = None) -> Array:
        """Values (C V, 3) at the corners (C, V, 3) [m] of each cluster's core; with other slopes, if they are given."""
        arms = corners - self.centres[:, None]
        ways = np.einsum("cij,cvj->cvi", self.slopes if slopes is None else slopes, arms)
        return (self.means[:, None] + ways).reshape(-1, 3)


def affine_fits(rest: Array, values: Array, labels: Array) -> AffineFits:
    """Of the values (N, V, 3) of vertices at (N, V, 3) [m], of simplices in clusters (N,)."""
    places, values = rest.reshape(-1, 3), values.reshape(-1, 3)
    owners = np.repeat(labels, rest.shape[1])
    ones = np.ones(len(owners))
    counts, centres, covariances = scatter(places, owners, ones)
    means = np.stack([np.bincount(owners, column) / counts for column in values.T], axis=1)
    products = averages(values[:, :, None] * (places - centres[owners])[:, None], owners, ones)
    inverses, axes, known = known_inverses(covariances, _THIN)
    return AffineFits(centres=centres, means=means, slopes=products @ inverses, axes=axes, known=known)
