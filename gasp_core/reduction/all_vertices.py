"""The reduction `all`: every vertex of every simplex is a point of the engine, as in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.games import choose_vertices, demagnify, magnify, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.reduction.carrier import Sample
from gasp_core.reduction.occupancy import cell_volumes

__all__ = ["Block", "Vertices", "block_of", "rigid_velocities", "sample_all"]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Vertices:
    """A `Carrier` of points that are the vertices themselves, in their order.

    Parameters
    ----------
    factors : (N, V - 1)
        Magnification of the edges.
    """

    kind: ClassVar[str] = "all"
    factors: Array

    def carry(self, rest: Array, displacements: Array) -> Array:
        """See `Carrier`.

        The rest simplices are added after the displacements were divided by the magnification: at displacement zero
        they come out to the last bit.
        """
        return rest + demagnify(np.asarray(displacements, dtype=np.float64).reshape(rest.shape), self.factors)

    @property
    def leaders(self) -> Array:
        """See `Carrier`: the first vertex is the mean."""
        count, edges = self.factors.shape
        return np.arange(0, count * (edges + 1), edges + 1)

    @property
    def followers(self) -> Array:
        """See `Carrier`."""
        count, edges = self.factors.shape
        return np.repeat(np.arange(count), edges + 1)

    def arrays(self) -> Mapping[str, Array]:
        """See `Carrier`."""
        return {"magnification": self.factors}


def sample_all(block: Block, floor: float, spacing: float) -> Sample:
    """All vertices of a body, edges no shorter than `floor` [m], for an engine of this spacing [m]."""
    magnified, factors = magnify(block.rest, floor)
    points = magnified.reshape(-1, 3)
    return Sample(
        positions=points, volumes=cell_volumes(points + block.centre, spacing), carrier=Vertices(factors=factors)
    )


def rigid_velocities(
    points: Array, volumes: Array, velocity: tuple[float, float, float], angular_velocity: tuple[float, float, float]
) -> Array:
    """v + omega x (x - c), (P, 3) [m/s], c the centre of volume of the points (P, 3) with volumes (P,)."""
    centre = points[0] + np.average(points - points[0], axis=0, weights=volumes)
    return np.asarray(velocity) + np.cross(np.asarray(angular_velocity), points - centre)
