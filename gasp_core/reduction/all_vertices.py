"""The reduction `all`: every vertex of every simplex is a point of the engine, as in the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.games import choose_vertices, magnify, to_simplices
from gasp_core.gaussians import Gaussians

__all__ = ["Block", "block_of", "cell_volumes", "magnification_of", "rigid_velocities"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """The simplices of the moving Gaussians of one object, about a centre of their own.

    Everything is relative to `centre`: at 1e4 m from the origin a double knows an edge of 1e-6 m to six digits only.

    Parameters
    ----------
    local
        The Gaussians, in metres and +z up, their means less `centre`.
    centre : (3,) [m]
        Mean of their means.
    rest : (N, V, 3) [m]
        Their simplices at the start, not magnified, less `centre`.
    """

    local: Gaussians
    centre: Array
    rest: Array

    @property
    def vertices(self) -> int:
        """Vertices of a simplex, 3 or 4."""
        return int(self.rest.shape[1])


def block_of(gaussians: Gaussians, vertices: Literal[3, 4, "auto"]) -> Block:
    """The simplices of Gaussians; "auto" takes four vertices where they are not flat."""
    count = choose_vertices(gaussians) if vertices == "auto" else vertices
    centre = gaussians.means.mean(axis=0, dtype=np.float64)
    local = gaussians.with_(means=gaussians.means - centre)
    return Block(local=local, centre=centre, rest=to_simplices(local, count))


def magnification_of(block: Block, floor: float) -> tuple[Array, Array]:
    """The engine's points (N V, 3) [m] in the world, edges no shorter than `floor` [m], and the factors (N, V - 1)."""
    magnified, factors = magnify(block.rest, floor)
    return magnified.reshape(-1, 3) + block.centre, factors


def cell_volumes(points: Array, spacing: float) -> Array:
    """Volumes (P,) [m^3] of the points (P, 3) of one body: each cell of the engine's spacing shares its own out.

    V0 = spacing^3 / (points in the cell), so that the mass is that of the occupied cells, however densely the splat
    is sampled there, and coincident points count once.
    """
    index = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    spans = index.max(axis=0) + 1
    if float(np.prod(spans.astype(np.float64))) < 2.0**62:
        keys = (index[:, 0] * spans[1] + index[:, 1]) * spans[2] + index[:, 2]
        _, cell, counts = np.unique(keys, return_inverse=True, return_counts=True)
    else:
        _, cell, counts = np.unique(index, axis=0, return_inverse=True, return_counts=True)
    return spacing**3 / counts[cell.reshape(-1)]


def rigid_velocities(
    points: Array, volumes: Array, velocity: tuple[float, float, float], angular_velocity: tuple[float, float, float]
) -> Array:
    """v + omega x (x - c), (P, 3) [m/s], c the centre of volume of the points (P, 3) with volumes (P,)."""
    centre = points[0] + np.average(points - points[0], axis=0, weights=volumes)
    return np.asarray(velocity) + np.cross(np.asarray(angular_velocity), points - centre)
