"""What keeps a cage from being turned inside out.

A spring resists a change of its length, and a block that is pressed through its own middle has the same lengths as
before. So a voxel below a fifth of its volume is pressed no further: its nodes are given equal and opposite impulses
that end the pressing, as an inelastic impact would. They change neither momentum nor angular momentum, as the volume
does not change where a body is shifted or turned.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import CORNERS

__all__ = ["kept_open", "middle_gradients"]

Array = NDArray[Any]

LEAST = 0.2
"""Of its volume."""
_ROUNDS = 40
"""Of relaxation: a voxel gives way to its neighbours."""
_ENOUGH = 1e-3
"""Of what the voxels were pressed with."""


def middle_gradients(nodes: Array, voxels: Array) -> Array:
    """Gradients of the trilinear weights in the middle of each voxel, (C, 8, 3) [1/m], at rest."""
    sizes = nodes[voxels[:, 7]] - nodes[voxels[:, 0]]
    return (2 * CORNERS - 1) / (4 * sizes[:, None, :])


def kept_open(voxels: Array, gradients: Array, masses: Array, places: Array, velocities: Array) -> Array | None:
    """Velocities (V, 3) after voxels that are too small are pressed no further; None where there are none.

    Parameters
    ----------
    voxels : (C, 8)
        Rows of nodes.
    gradients : (C, 8, 3)
        At rest, of the nodes' weights.
    masses : (V,)
        Of the nodes.
    places, velocities : (V, 3)
        In the units of the gradients.
    """
    stretch = places[voxels].transpose(0, 2, 1) @ gradients
    # Columns of the cofactor matrix are cross products of the others' columns.
    x, y, z = stretch[..., 0], stretch[..., 1], stretch[..., 2]
    across = np.cross(y, z)
    small = np.flatnonzero((x * across).sum(axis=1) < LEAST)
    if len(small) == 0:
        return None
    cofactors = np.stack([across[small], np.cross(z[small], x[small]), np.cross(x[small], y[small])], axis=2)
    # How the volume grows with each node's place, and what it costs.
    growth = gradients[small] @ cofactors.transpose(0, 2, 1)
    corners = voxels[small]
    shares = growth / masses[corners][..., None]
    give = (growth * shares).sum(axis=(1, 2))
    crowd = np.bincount(corners.ravel(), minlength=len(masses))[corners].max(axis=1)
    per_voxel = np.where(give > 0, 1 / np.where(give > 0, give, 1.0), 0.0) / crowd
    changed = velocities.copy()
    worst = 0.0
    for _ in range(_ROUNDS):
        rates = (growth * changed[corners]).sum(axis=(1, 2))
        pressed = -float(rates.min())
        worst = max(worst, pressed)
        if pressed <= _ENOUGH * worst:
            break
        impulses = np.maximum(-rates, 0.0) * per_voxel
        np.add.at(changed, corners, shares * impulses[:, None, None])
    return changed
