"""The reduction `all`: every vertex of every simplex is a point of the engine, as in the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.games import choose_vertices, demagnify, lengthened, magnify, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.reduction.occupancy import cell_volumes
from gasp_core.reduction.transfer import Cores, LeastSquares
from gasp_core.reduction.transfer_operator import Sample, bounds_of

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
    """A `TransferOperator` of points that are the vertices themselves, in their order.

    Parameters
    ----------
    factors : (N, V - 1)
        Magnification of the edges.
    gradients
        Gives the deformation gradient of each Gaussian, from the points of those around it: a triangle has only two
        directions, few engines show what they know of it, and none of them what flowed. None: nobody will ask.
    """

    kind: ClassVar[str] = "all"
    factors: Array
    gradients: LeastSquares | None = None

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`.

        The rest simplices are added after the displacements were divided by the magnification: at displacement zero
        they come out to the last bit.
        """
        moves = np.asarray(displacements, dtype=np.float64).reshape(rest.shape)
        moved = rest + demagnify(moves, self.factors)
        if drifted is None:
            return moved
        assert self.gradients is not None, "a body that drifts is sampled for it"
        around = Cores(points=lengthened(rest, self.factors))
        # The fit b is affine for each Gaussian: Y + b(Y) - X - b(X) is F (Y - X).
        ends = [self.gradients.carry(around, start, moves) for start in (rest, drifted)]
        return moved + (ends[1] - ends[0])

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`."""
        return lengthened(velocities, self.factors).reshape(-1, 3)

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`."""
        return lambda moves: self.gather(rest, moves)

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`: the first vertex is the mean."""
        count, edges = self.factors.shape
        return np.arange(0, count * (edges + 1), edges + 1)

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        count, edges = self.factors.shape
        return np.repeat(np.arange(count), edges + 1)

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        fit = {} if self.gradients is None else self.gradients.arrays()
        return {"magnification": self.factors, **{f"gradients/{name}": array for name, array in fit.items()}}

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> Vertices:
        """From what `arrays` gave."""
        head = "gradients/"
        fit = {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}
        return cls(factors=arrays["magnification"], gradients=LeastSquares.of(fit) if fit else None)


def sample_all(block: Block, floor: float, spacing: float, *, drifts: bool = False) -> Sample:
    """All vertices of a body, edges no shorter than `floor` [m], for an engine of this spacing [m].

    `drifts`: whether the body moves by itself too, so that its carrier needs deformation gradients.
    """
    magnified, factors = magnify(block.rest, floor)
    points = magnified.reshape(-1, 3)
    gradients = None
    if drifts:
        around = Cores(points=magnified)
        # Triangles are flat: how matter deforms across one, those around it tell.
        gradients = LeastSquares.build(around, around.centres, np.arange(len(magnified)), own_share=0.0, steepness=2)
    return Sample(
        positions=points,
        volumes=cell_volumes(points + block.centre, spacing),
        carrier=Vertices(factors=factors, gradients=gradients),
        bounds=bounds_of(points),
    )


def rigid_velocities(
    points: Array, volumes: Array, velocity: tuple[float, float, float], angular_velocity: tuple[float, float, float]
) -> Array:
    """v + omega x (x - c), (P, 3) [m/s], c the centre of volume of the points (P, 3) with volumes (P,)."""
    centre = points[0] + np.average(points - points[0], axis=0, weights=volumes)
    return np.asarray(velocity) + np.cross(np.asarray(angular_velocity), points - centre)
