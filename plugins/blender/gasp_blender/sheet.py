"""A net of quads through a thin body, for cloth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage, build_cage

__all__ = ["build_sheet", "net_edges"]

Array = NDArray[Any]

_FLAT = 1 / 3
"""Of a body's second size, how thick it may be to be a sheet."""


def build_sheet(positions: Array, margin: float, spacing: float, most_quads: int) -> tuple[Cage, float]:
    """The net of one body, and its thickness [m]; parameters as of `build_cage`.

    The body has to lie flat across one of the axes: the net is a layer of voxels pressed into its middle, and points
    keep their height over it. Corners of its quads go round, as Blender's faces do.

    Raises
    ------
    ValueError
        Where the body is no sheet.
    """
    sizes = np.ptp(positions, axis=0) + 2 * margin
    thin = int(np.argmin(sizes))
    thickness = float(sizes[thin])
    if thickness > _FLAT * float(np.sort(sizes)[1]):
        raise ValueError(f"its sizes are {sizes[0]:.3g}, {sizes[1]:.3g} and {sizes[2]:.3g} m")
    middle = (positions.max(axis=0) + positions.min(axis=0))[thin] / 2
    flat = positions.copy()
    # One voxel thick, whatever the spacing.
    flat[:, thin] = middle
    cage = build_cage(flat, margin, max(spacing, 2 * margin), most_quads)
    upper = cage.nodes[:, thin] > middle
    pressed = cage.nodes.copy()
    pressed[:, thin] = middle
    nodes, merged = np.unique(pressed, axis=0, return_inverse=True)
    merged = merged.reshape(-1)
    lower = ~upper[cage.voxels]
    quads = merged[cage.voxels[lower].reshape(-1, 4)][:, [0, 1, 3, 2]]
    return (
        Cage(
            nodes=nodes,
            voxels=quads,
            parity=cage.parity,
            corners=merged[cage.corners],
            weights=cage.weights,
            coarseness=cage.coarseness,
        ),
        thickness,
    )


def net_edges(faces: Array) -> Array:
    """Sides of faces (F, 4), (E, 2), each once. The last corner of a triangle is the one before it."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1), axis=0)
