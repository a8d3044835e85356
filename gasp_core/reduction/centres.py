"""The reduction `centres`: the engine moves the means alone, and covariances follow its deformation gradient.

That is how PhysGaussian does it (Xie et al. 2024, arXiv 2311.12198): F Sigma F^T. Where an engine shows no F, it is the
affine fit to the motion of the Gaussians around each, and where these lie in a plane, what takes its normal to the
normal that it has now.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.moments import known_inverses
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.occupancy import cell_volumes
from gasp_core.reduction.transfer import add_normals
from gasp_core.reduction.transfer_operator import Sample, bounds_of
from gasp_core.stepping.threads import processors

__all__ = ["Centres", "sample_centres", "strained"]

Array = NDArray[Any]

_NEIGHBOURS = 12
_FLAT = 1e-2
"""Share of the longest axis squared of a neighbourhood below which it does not extend along another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Centres:
    """A `TransferOperator` of points that are the means.

    Parameters
    ----------
    points : (N, 3) [m]
        At rest, about the centre of the body.
    neighbours : (N, K) int32
        The means nearest to each.
    """

    kind: ClassVar[str] = "centres"
    points: Array
    neighbours: Array

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`; what has drifted has been strained by the engine's F already, see `strained`."""
        moves = np.asarray(displacements, dtype=np.float64)
        if drifted is not None:
            return drifted + moves[:, None]
        return rest + moves[:, None] + _change(self._gradients(moves), rest)

    def _gradients(self, displacements: Array) -> Array:
        """F - 1 of each, (N, 3, 3), by the affine fit to its neighbours."""
        if not self.neighbours.shape[1]:
            return np.zeros((len(self.points), 3, 3))
        arms = self.points[self.neighbours] - self.points[:, None]
        inverses, axes, known = known_inverses(arms.transpose(0, 2, 1) @ arms, _FLAT)
        changes = displacements[self.neighbours] - displacements[:, None]
        gradients = changes.transpose(0, 2, 1) @ arms @ inverses
        add_normals(gradients, axes, np.flatnonzero(known.sum(axis=1) == 2))
        return gradients

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`."""
        return velocities[:, 0]

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`."""
        return lambda moves: moves[:, 0]

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`."""
        return np.arange(len(self.points))

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        return np.arange(len(self.points))

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        return {"points": self.points, "neighbours": self.neighbours}

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> Centres:
        """From what `arrays` gave."""
        return cls(**arrays)


def _change(gradients: Array, rest: Array) -> Array:
    """What F - 1 (N, 3, 3) does to simplices (N, V, 3) about their first vertex."""
    return (rest - rest[:, :1]) @ gradients.transpose(0, 2, 1)


def strained(rest: Array, deformation_gradients: Array) -> Array:
    """How far F (N, 3, 3) strains simplices (N, V, 3) [m] about their means, as `drifted` takes it; float32, as
    recordings keep it."""
    return _change(deformation_gradients - np.eye(3), rest).astype(np.float32)


def sample_centres(block: Block, spacing: float) -> Sample:
    """The means of a body, for an engine of this spacing [m]; its volume is that of the cells they occupy."""
    from scipy.spatial import KDTree

    points = block.rest[:, 0].copy()
    count = min(_NEIGHBOURS, len(points) - 1)
    neighbours = np.zeros((len(points), 0), dtype=np.int32)
    if count:
        tree: Any = KDTree(points)
        # The nearest is the mean itself, or one that is where it is.
        neighbours = tree.query(points, k=[*range(2, count + 2)], workers=processors())[1].astype(np.int32)
    return Sample(
        positions=points,
        volumes=cell_volumes(points + block.centre, spacing),
        carrier=Centres(points=points, neighbours=neighbours),
        bounds=bounds_of(points),
        notes=(f"the means of {len(points):,} Gaussians are points",),
    )
