"""Clouds of points with known shape: boxes filled with equal cells, one point at the centre of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.engine.contract import PointCloud

__all__ = ["POINTS_PER_CELL", "box_of_points", "cloud_of"]

Array = NDArray[Any]

POINTS_PER_CELL = 2
"""Along each axis: what bulk matter needs, and all it profits from (four changed nothing measurable)."""


def box_of_points(corner: ArrayLike, cells: tuple[int, int, int], spacing: float) -> Array:
    """Centres, (N, 3) [m], of the equal parts of a box of whole grid cells of `spacing` [m]."""
    step = spacing / POINTS_PER_CELL
    axes = [(np.arange(count * POINTS_PER_CELL) + 0.5) * step for count in cells]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + np.asarray(corner)


def cloud_of(bodies: Sequence[Array], velocities: Sequence[ArrayLike], spacing: float) -> PointCloud:
    """Bodies of points from `box_of_points`, each with its velocity, (3,) or (N, 3) [m/s]; material 0 throughout."""
    positions = np.concatenate(bodies)
    return PointCloud(
        reference_positions=positions,
        initial_velocities=np.concatenate(
            [np.broadcast_to(np.asarray(own, dtype=float), body.shape) for body, own in zip(bodies, velocities)]
        ),
        reference_volumes=np.full(len(positions), (spacing / POINTS_PER_CELL) ** 3),
        material_ids=np.zeros(len(positions), dtype=np.int32),
        body_ids=np.repeat(np.arange(len(bodies)), [len(body) for body in bodies]),
    )
