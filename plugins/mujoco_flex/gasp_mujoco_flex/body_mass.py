"""What a body is made of: its points, and what they enclose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.stepping.enclosure import enclosed
from gasp_core.stepping.voxel_cage import VoxelGrid

__all__ = ["Matter", "affine_fit", "matter_of"]

Array = NDArray[Any]

_FINEST = 8
"""Parts of a cell, along an axis, by which hollows are looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Matter:
    """Quadrature points of a body: those given, and behind them those of its filled inside.

    Parameters
    ----------
    rows : (G,)
        The given ones, as rows of the scene's cloud.
    positions, velocities : (N, 3) [m], [m/s]
        N >= G.
    masses, volumes : (N,) [kg], [m^3]
    materials : (N,)
        Rows of the scene's materials.
    """

    rows: Array
    positions: Array
    velocities: Array
    masses: Array
    volumes: Array
    materials: Array

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self.masses.sum())

    @property
    def centre(self) -> Array:
        """Of mass, (3,) [m]."""
        start = self.positions[0]
        return start + self.masses @ (self.positions - start) / self.mass


def matter_of(problem: PointProblem, rows: Array, grid: VoxelGrid, spacing: float, *, filled: bool) -> Matter:
    """The points in `rows`, and the empty parts of a grid's cells that they enclose.

    Parameters
    ----------
    spacing
        About the size [m] of the parts looked at: what a scene's volumes were counted in.
    filled
        Whether to fill them; they are then of the material that most of the body is made of.
    """
    points = problem.points
    positions, velocities = points.reference_positions[rows], points.initial_velocities[rows]
    volumes, materials = points.reference_volumes[rows], points.material_ids[rows]
    inside = _hollows(grid, positions, spacing) if filled else (np.zeros((0, 3)), 0.0)
    count = len(inside[0])
    if count:
        shares = np.bincount(materials, weights=volumes)
        centre, mean, gradient = affine_fit(positions, velocities, volumes)
        positions = np.concatenate([positions, inside[0]])
        velocities = np.concatenate([velocities, mean + (inside[0] - centre) @ gradient])
        volumes = np.concatenate([volumes, np.full(count, inside[1])])
        materials = np.concatenate([materials, np.full(count, int(np.argmax(shares)))])
    densities = np.array([material.density for material in problem.materials])
    return Matter(
        rows=rows,
        positions=positions,
        velocities=velocities,
        masses=densities[materials] * volumes,
        volumes=volumes,
        materials=materials,
    )


def _hollows(grid: VoxelGrid, positions: Array, spacing: float) -> tuple[Array, float]:
    """Middles (M, 3) [m] of what is empty and enclosed, and the volume [m^3] of each."""
    parts = int(np.clip(np.rint(grid.sides.max() / spacing), 1, _FINEST))
    while parts > 1 and not grid.refined(parts).is_small:
        parts -= 1
    fine = grid.refined(parts)
    occupied = np.zeros(fine.shape, dtype=bool)
    occupied[tuple(fine.locate(positions)[0].T)] = True
    found = np.argwhere(enclosed(occupied))
    return fine.lower + (found + 0.5) * fine.sides, float(fine.sides.prod())


def affine_fit(positions: Array, values: Array, weights: Array) -> tuple[Array, Array, Array]:
    """The affine field nearest to values (N, 3): centre (3,), value there (3,), and gradient (3, 3).

    The field is mean + (x - centre) @ gradient; where the cloud has no extent, the gradient is zero.
    """
    share = weights / weights.sum()
    centre = positions[0] + share @ (positions - positions[0])
    mean = values[0] + share @ (values - values[0])
    root = np.sqrt(share)[:, None]
    arms = (positions - centre) * root
    size = float(np.abs(arms).max())
    if size == 0.0:
        return centre, mean, np.zeros((3, 3))
    gradient, *_ = np.linalg.lstsq(arms / size, (values - mean) * root, rcond=1e-9)
    return centre, mean, gradient / size
