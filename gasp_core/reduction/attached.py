"""D-MiSo's own transfer: cores are flat triangles, and Gaussians are attached to them (Waczynska et al. 2024).

A core is the triangle T of the Gaussian that has the cluster's mean and covariance: its mean, and the ends of its two
longest axes. A Gaussian is at

    v1 + a_n n + a_2 e2 + a_3 e3,

n, e2, e3 being the unit normal and the unit edges of its core, which need not be at right angles; it turns with the
frame of n and e2, and along the frame it is as much longer as the edges are. To compare with: edges of length one know
nothing of stretch, so that no mean goes with it, and the core's own mean is a corner that weighs a third of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.reduction.affine_fits import affine_fits
from gasp_core.reduction.clusters import cluster_apart, scatter
from gasp_core.reduction.transfer_operator import Sample, bounds_of

__all__ = ["Attached", "sample_attached"]

Array = NDArray[Any]

_LEAST = 1e-300
_THIN, _SMALLEST = 1e-9, 1e-12
"""Of the size of a body, and in metres: edges of cores are no shorter."""
_ROUNDING = 1e-9
"""Of a body's size, that cores made elsewhere may be off by and still be of their clusters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attached:
    """A `TransferOperator` of flat triangles.

    Parameters
    ----------
    points : (C, 3, 3) [m]
        Corners of the cores at rest, about the centre of the body.
    labels : (N,)
        The core each Gaussian is attached to.
    """

    kind: ClassVar[str] = "d-miso"
    points: Array
    labels: Array

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`; nothing that is attached drifts."""
        assert drifted is None, "refused by SplatObject"
        moves = np.asarray(displacements, dtype=np.float64).reshape(self.points.shape)
        before, after = _Triangles.of(self.points), _Triangles.of(self.points + moves)
        own = self.labels
        arms = rest[:, 0] - self.points[own, 0]
        # The difference of both sums: at displacement zero nothing is added, to the last bit.
        along = np.linalg.solve(before.edges[own].transpose(0, 2, 1), arms[:, :, None])[:, :, 0]
        means = rest[:, 0] + moves[own, 0] + np.einsum("nk,nki->ni", along, (after.edges - before.edges)[own])
        # As long along each axis of the frame as the triangle is, in the frame that it has now.
        stretch = np.einsum("cki,ck,ckj->cij", after.frames, after.lengths / before.lengths, before.frames)
        change = stretch - np.einsum("cki,ck,ckj->cij", before.frames, np.ones_like(before.lengths), before.frames)
        edges = rest[:, 1:] - rest[:, :1]
        edges = edges + np.einsum("nij,nkj->nki", change[own], edges)
        return np.concatenate([means[:, None], means[:, None] + edges], axis=1)

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`: each core has the affine fit to its Gaussians' vertices, as far as they extend.

        Its corners lie in the plane along which these extend most.
        """
        return affine_fits(rest, velocities, self.labels).at(self.points)

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`."""
        return lambda moves: affine_fits(rest, moves, self.labels).at(self.points)

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`."""
        return 3 * self.labels

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        return np.repeat(np.unique(self.labels, return_index=True)[1], 3)

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        return {"points": self.points, "labels": self.labels}

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> Attached:
        """From what `arrays` gave."""
        return cls(**arrays)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Triangles:
    """Of C triangles: rows n, e2, e3 of length one (C, 3, 3), the orthogonal frames (C, 3, 3) of n, e2 and what is
    across, and how long they are along those (C, 3), 1 along the normal."""

    edges: Array
    frames: Array
    lengths: Array

    @classmethod
    def of(cls, corners: Array) -> _Triangles:
        second, third = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normals = np.cross(second, third)
        normals, along, other = (_unit(each) for each in (normals, second, third))
        across = np.cross(normals, along)
        lengths = [np.linalg.norm(second, axis=1), np.linalg.norm(third, axis=1)]
        return cls(
            edges=np.stack([normals, along, other], axis=1),
            frames=np.stack([normals, along, across], axis=1),
            lengths=np.stack([np.ones(len(corners)), *lengths], axis=1),
        )


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), _LEAST)


def sample_attached(
    corners: Array,
    shares: Array,
    places: Array,
    kinds: Array,
    count: int,
    floor: float,
    known: Attached | None = None,
) -> Sample:
    """Triangles for clusters of Gaussians.

    Parameters
    ----------
    corners : (N, V, 3) [m]
        All simplices of a body, about its centre.
    shares : (N, V) [m^3]
        Volumes of their vertices.
    places : (N, 3) [m]
        The means.
    kinds : (N,)
        Parts: a core is of one.
    count
        How many cores.
    floor
        Shortest edge the engine is given [m].
    known
        Cores that were made of such a body before, on whatever machine, and are to be these where they can be.
    """
    fits = known is not None and len(known.labels) == len(places) and len(known.points) <= count
    labels = known.labels if known is not None and fits else cluster_apart(places, kinds, count)
    owners = np.repeat(labels, corners.shape[1])
    volumes, means, covariances = scatter(corners.reshape(-1, 3), owners, shares.reshape(-1))
    values, axes = np.linalg.eigh(covariances)
    deviations = np.sqrt(np.maximum(values, 0.0))
    # A frame wants two edges, however small.
    least = max(floor, _THIN * float(np.ptp(corners, axis=(0, 1)).max()), _SMALLEST)
    deviations = np.maximum(deviations, least)
    ends = means[:, None] + deviations[:, :0:-1, None] * axes.transpose(0, 2, 1)[:, :0:-1]
    points = np.concatenate([means[:, None], ends], axis=1)
    if known is not None and fits and (np.abs(known.points[:, 0] - means) <= _ROUNDING * np.ptp(corners)).all():
        # Axes that are equally long, or that point the other way, are a matter of roundings.
        points = known.points
    return Sample(
        positions=points.reshape(-1, 3),
        volumes=np.repeat(volumes / 3, 3),
        carrier=Attached(points=points, labels=labels),
        bounds=bounds_of(corners.reshape(-1, 3)),
        notes=(f"{len(points):,} triangles, as D-MiSo's, carry {len(labels):,} Gaussians",),
    )
