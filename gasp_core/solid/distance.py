"""From a field whose zero level is a surface to the signed distance to it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid.grid import interpolated
from gasp_core.solid.morphology import nearest_in, shell_of
from gasp_core.stepping.threads import processors

__all__ = ["signed_distance"]

Array = NDArray[Any]

_DISC = 0.8
"""Radius, in spacings, of the tangent discs that the surface is made of: smaller ones leave gaps between them, larger
ones stand out beyond edges."""
_BESIDE = 2
"""Nodes from the surface within which the nearest disc is looked for."""


def signed_distance(inside: Array, spacing: float) -> Array:
    """Distance (X, Y, Z) to the zero level of a field (X, Y, Z), negative where the field is positive.

    The surface is discs where it cuts the edges of the grid, across the field's gradient there. Far from it the disc
    of the nearest node beside it will do. Without any surface the distance is that to the far end of the grid.
    """
    from scipy.spatial import KDTree

    sign = inside > 0
    feet, normals = _discs(inside)
    if not len(feet):
        return np.full(inside.shape, spacing * float(np.linalg.norm(inside.shape)) * (-1 if sign.all() else 1))
    beside = shell_of(sign, _BESIDE)
    nodes = np.argwhere(beside)
    tree: Any = KDTree(feet)
    foot = np.zeros(inside.shape, dtype=np.int64)
    foot[beside] = tree.query(nodes, workers=processors())[1]
    nearest = foot[nearest_in(beside)].reshape(-1)
    ways = np.indices(inside.shape).reshape(3, -1).T - feet[nearest]
    across = np.einsum("ni,ni->n", ways, normals[nearest])
    along = np.sqrt(np.maximum(np.einsum("ni,ni->n", ways, ways) - across**2, 0.0))
    lengths = spacing * np.hypot(across, np.maximum(along - _DISC, 0.0))
    return lengths.reshape(inside.shape) * np.where(sign, -1.0, 1.0)


def _discs(inside: Array) -> tuple[Array, Array]:
    """Where a field's zero level cuts the edges of the grid, (F, 3) in spacings, and unit normals (F, 3) there."""
    found: list[Array] = []
    for axis in range(3):
        first, second = [slice(None)] * 3, [slice(None)] * 3
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        low, high = inside[tuple(first)], inside[tuple(second)]
        cut = np.argwhere((low > 0) != (high > 0))
        below, above = low[tuple(cut.T)], high[tuple(cut.T)]
        feet = cut.astype(np.float64)
        feet[:, axis] += below / (below - above)
        found.append(feet)
    feet = np.concatenate(found)
    normals = interpolated([*np.gradient(inside)], feet)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return feet, normals / np.where(lengths > 0, lengths, 1.0)
