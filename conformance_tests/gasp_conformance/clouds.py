"""Clouds of points with known shape: boxes and balls cut from a lattice of equal cells, one point in each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.contract import PointCloud

__all__ = ["POINTS_PER_CELL", "ball_of_points", "box_of_points", "cloud_of", "jittered", "point_volume"]

Array = NDArray[Any]

POINTS_PER_CELL = 2
"""Along each axis: what bulk matter needs, and all it profits from (four changed nothing measurable)."""


def point_volume(spacing: float) -> float:
    """Volume of the part of a body that a point stands for, at a grid of `spacing` [m]; [m^3]."""
    return (spacing / POINTS_PER_CELL) ** 3


def box_of_points(corner: ArrayLike, cells: tuple[int, int, int], spacing: float) -> Array:
    """Centres, (N, 3) [m], of the equal parts of a box of whole grid cells of `spacing` [m]."""
    step = spacing / POINTS_PER_CELL
    axes = [(np.arange(count * POINTS_PER_CELL) + 0.5) * step for count in cells]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + np.asarray(corner)


def ball_of_points(corner: ArrayLike, cells: int, spacing: float) -> Array:
    """Those of the box of `cells` cells a side whose place is within the ball that fits into it, (N, 3) [m]."""
    box = box_of_points((0.0, 0.0, 0.0), (cells, cells, cells), spacing)
    radius = cells * spacing / 2
    inside = np.linalg.norm(box - radius, axis=1) <= radius
    return box[inside] + np.asarray(corner)


def jittered(positions: Array, spacing: float, share: float, seed: int) -> Array:
    """Points (N, 3) [m] moved at random by up to `share` of their distance, so that they have no symmetry left."""
    reach = share * spacing / POINTS_PER_CELL
    return positions + np.random.default_rng(seed).uniform(-reach, reach, positions.shape)


def cloud_of(
    bodies: Sequence[Array], velocities: Sequence[ArrayLike], spacing: float, materials: Sequence[int] | None = None
) -> PointCloud:
    """Bodies of points of one lattice, each with its velocity, (3,) or (N, 3) [m/s], and its row of the materials.

    Where no rows are given all are of material 0.
    """
    positions = np.concatenate(bodies)
    sizes = [len(body) for body in bodies]
    return PointCloud(
        reference_positions=positions,
        initial_velocities=np.concatenate(
            [np.broadcast_to(np.asarray(own, dtype=float), body.shape) for body, own in zip(bodies, velocities)]
        ),
        reference_volumes=np.full(len(positions), point_volume(spacing)),
        material_ids=np.repeat([0] * len(bodies) if materials is None else list(materials), sizes),
        body_ids=np.repeat(np.arange(len(bodies)), sizes),
    )
