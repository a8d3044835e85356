"""The affine velocities that belong to a field of initial velocities.

A cloud that starts with C = 0 loses spin to C in its first steps, 1/(1 + 3 dx^2/a^2) of a block of side a is left. So
the grid is asked what the field's gradient is, again and again, each time with the last answer. Inside the cloud the
first answer is right; near a free surface the error shrinks by 0.6 a pass.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["seeded_affine_velocities"]

Array = NDArray[Any]

_PASSES = 16


def seeded_affine_velocities(cells: Array, masses: Array, velocities: Array) -> Array:
    """C (N, 3, 3), in the velocities' unit per cell, of velocities (N, 3) at places (N, 3) [cells], masses (N,)."""
    found = np.zeros((len(cells), 3, 3))
    if not np.ptp(velocities, axis=0).any():
        return found
    base = np.floor(cells - 0.5).astype(np.int64)
    away = cells - base
    splines = np.stack([0.5 * (1.5 - away) ** 2, 0.75 - (away - 1) ** 2, 0.5 * (away - 0.5) ** 2], axis=1)
    corner = base.min(axis=0)
    shape = base.max(axis=0) - corner + 3
    offsets = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = [np.ravel_multi_index(tuple((base - corner + offset).T), tuple(shape)) for offset in offsets]
    # Only nodes that a point feels: two points may be far apart.
    _, numbered = np.unique(np.concatenate(places), return_inverse=True)
    nodes = numbered.reshape(len(offsets), -1)
    weights = [splines[:, i, 0] * splines[:, j, 1] * splines[:, k, 2] for i, j, k in offsets]
    count = int(nodes.max()) + 1
    mass = sum(np.bincount(at, weight * masses, count) for at, weight in zip(nodes, weights))
    for _ in range(_PASSES):
        momenta = np.zeros((count, 3))
        for at, weight, offset in zip(nodes, weights, offsets):
            carried = velocities + np.einsum("nij,nj->ni", found, offset - away)
            for axis in range(3):
                momenta[:, axis] += np.bincount(at, weight * masses * carried[:, axis], count)
        # Nodes that points touch from so far that the weight is no longer a number have nothing to say.
        speeds = momenta / np.where(mass > 0, mass, 1.0)[:, None]
        found = np.zeros_like(found)
        for at, weight, offset in zip(nodes, weights, offsets):
            found += 4 * weight[:, None, None] * speeds[at][:, :, None] * (offset - away)[:, None, :]
    return found
