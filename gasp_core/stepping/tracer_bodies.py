"""Which body carries a tracer, for engines in which bodies have velocities of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointCloud

__all__ = ["tracer_bodies"]


def tracer_bodies(points: PointCloud) -> NDArray[Any]:
    """Numbers (M,) of the bodies whose matter carries the tracers: each that of the point nearest at the start."""
    if points.tracer_positions is None:
        return np.zeros(0, dtype=np.int32)
    if not points.body_ids.any():
        return np.zeros(len(points.tracer_positions), dtype=np.int32)
    from sklearn.neighbors import NearestNeighbors  # only where it is needed: importing it takes half a second

    nearest = NearestNeighbors(n_neighbors=1).fit(points.reference_positions)
    _, rows = nearest.kneighbors(points.tracer_positions)
    return points.body_ids[rows[:, 0]]
