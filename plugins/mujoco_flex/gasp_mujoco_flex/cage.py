"""A soft body's cage: the cells that hold its matter, their nodes, and what the nodes and cells are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from gasp_core.stepping.voxel_cage import VoxelCage, VoxelGrid, voxel_cage
from gasp_mujoco_flex.body_mass import Matter, affine_fit

__all__ = ["Cage", "cage_of"]

Array = NDArray[Any]

_TETRAHEDRA = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])
"""Kuhn's six, around the diagonal from corner 0 to corner 7: neighbouring cells meet in the same triangles."""
_THINNEST = 0.05
"""Share of a cell's stiffness that is left to it, however little of it is filled: less would be no body but a dust."""
_UNSEEN = 1e-6
"""Weight, over that of the points, by which nodes that hardly any point tells about follow the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage(VoxelCage):
    """Voxels and nodes, and what they are made of.

    Parameters
    ----------
    fractions : (C,)
        How much of each cell is matter, above 0, at most 1.
    materials : (C,)
        What most of each cell is made of.
    masses : (M,) [kg]
    velocities : (M, 3) [m/s]
        At the start.
    matter
        What is embedded.
    """

    fractions: Array
    materials: Array
    masses: Array
    velocities: Array
    matter: Matter

    @property
    def tetrahedra(self) -> Array:
        """Six a cell, as nodes (6 C, 4), of positive volume."""
        return self.embedding.corners[:, _TETRAHEDRA].reshape(-1, 4)

    def inside_out(self, places: Array) -> Array:
        """Which cells (C,) have no volume left in their middle, or less, with nodes at places (M, 3)."""
        at = places[self.embedding.corners].reshape(-1, 2, 2, 2, 3)
        edges = [np.diff(at, axis=axis).reshape(-1, 4, 3).mean(axis=1) for axis in (1, 2, 3)]
        return np.linalg.det(np.stack(edges, axis=1)) <= 0


def cage_of(matter: Matter, grid: VoxelGrid) -> Cage:
    """The cage of the voxels of a grid that hold matter."""
    cage = voxel_cage(grid, matter.positions)
    weights = cage.embedding.weights()
    masses = np.asarray(weights.T @ matter.masses)
    amounts = np.zeros((len(cage.voxels), int(matter.materials.max()) + 1))
    np.add.at(amounts, (cage.embedding.cells, matter.materials), matter.volumes)
    return Cage(
        grid=grid,
        voxels=cage.voxels,
        nodes=cage.nodes,
        embedding=cage.embedding,
        fractions=np.maximum(cage.filled_fractions(matter.volumes), _THINNEST),
        materials=np.argmax(amounts, axis=1),
        masses=masses,
        velocities=_nodal_velocities(matter, weights, masses, cage.positions),
        matter=matter,
    )


def _nodal_velocities(matter: Matter, weights: sparse.csr_array, masses: Array, positions: Array) -> Array:
    """Velocities (M, 3) [m/s] of nodes, at (M, 3) [m], that come nearest to those of the matter.

    Least squares, weighted by mass: then momentum is exact. What is affine is taken first and without a loss.
    """
    centre, mean, gradient = affine_fit(matter.positions, matter.velocities, matter.masses)
    affine = mean + (positions - centre) @ gradient
    missing = matter.velocities - mean - (matter.positions - centre) @ gradient
    speed = float(np.abs(matter.velocities).max())
    if not np.abs(missing).max() > 1e-12 * speed:
        return affine
    # A node in which no point has a weight is told about by nothing else.
    ridge = _UNSEEN * np.maximum(masses, _UNSEEN * masses.mean())
    normal = weights.T @ sparse.diags_array(matter.masses) @ weights + sparse.diags_array(ridge)
    found = splu(sparse.csc_array(normal)).solve(np.asarray(weights.T @ (matter.masses[:, None] * missing)))
    # What following the others took from the momentum; an affine fit leaves none of it.
    return affine + found - masses @ found / masses.sum()
