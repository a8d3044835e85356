"""Nodes of a grid as rigid bodies meet them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["NO_NODES", "GridNodes"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class GridNodes:
    """Nodes of a grid where matter of other bodies is near rigid ones, K of them.

    Parameters
    ----------
    rigid : (K,)
        Rigid bodies, by their place among these.
    others : (K,)
        Whose matter it is, as in `PointCloud.body_ids`.
    places : (K, 3) [m]
    velocities : (K, 3) [m/s]
    masses : (K,) [kg]
    led : (K,) of bool
        Whether nothing changes their velocities.
    normals : (K, 3)
        Out of the rigid body.
    gaps : (K,) [m]
        From its surface to that of the matter.
    welded : (K,) of bool
        Whether body and matter are one piece.
    wanted : (K, 3) [m/s]
        With which welded matter comes back to where it was on the body.
    held_together
        Gap at which what sticks or slips still does [m].
    """

    rigid: Array
    others: Array
    places: Array
    velocities: Array
    masses: Array
    led: Array
    normals: Array
    gaps: Array
    welded: Array
    wanted: Array
    held_together: float

    def __len__(self) -> int:
        return len(self.rigid)


_NONE = np.zeros(0, dtype=np.int64)
NO_NODES = GridNodes(
    rigid=_NONE,
    others=_NONE,
    places=np.zeros((0, 3)),
    velocities=np.zeros((0, 3)),
    masses=np.zeros(0),
    led=np.zeros(0, dtype=np.bool_),
    normals=np.zeros((0, 3)),
    gaps=np.zeros(0),
    welded=np.zeros(0, dtype=np.bool_),
    wanted=np.zeros((0, 3)),
    held_together=0.0,
)
"""Of a scene without a grid."""
