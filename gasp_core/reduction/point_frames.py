"""From the motion of material points to that of everything around them: an affine map for each point, every frame.

Each point has a deformation gradient, the fit in the sense of least squares to its own displacement and those of the
points it was connected to at rest (as in Müller et al. 2004, 10.1145/1028523.1028542); what has been torn off does not
count. A Gaussian follows the maps of the point it belongs to and of that one's neighbours, as long as they agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core import linalg3
from gasp_core.reduction import point_kernels
from gasp_core.reduction.morton import along_a_curve
from gasp_core.stepping.threads import processors

__all__ = ["FOLLOWED", "NEIGHBOURS", "PointFrames"]

Array = NDArray[Any]

NEIGHBOURS = 12
"""Of a point, at most: in a lattice the six along its axes and six of those across."""
FOLLOWED = 4
"""Points whose maps a Gaussian follows, at most."""
_CANDIDATES = 24
"""Nearest points among which neighbours are looked for."""
_CONNECTED = 2.0
"""Mean distances of points, two to a cell, up to which they are connected: a cell. An engine joins what is nearer."""
_TORN = 2.0
"""Times as far as at rest: `MapChoice.alpha`, beyond which no Gaussian is stretched."""
_APART = 1.0
"""Mean distances of points by which two maps may differ at a Gaussian and be of one piece of matter."""
_FAR = 6.0
"""Mean distances of points beyond which a gradient is not to be relied on: three cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointFrames:
    """A `TransferOperator` of material points that fill a body.

    Parameters
    ----------
    points : (P, 3) [m]
        At rest, about the centre of the body.
    neighbours : (P, K) int32
        Those each was connected to; itself where there are fewer.
    order : (N,) int32
        Gaussians in the order of `labels` and `weights`: those near in space read the same points.
    labels : (N, F) int32
        The points each follows, its own one first.
    weights : (N, F) float32
        Of sum 1, or all 0 where it is too far off for a gradient.
    standing_for : (P,) int32
        The Gaussian nearest to each point.
    spacing
        Mean distance of points [m].
    """

    kind: ClassVar[str] = "volume"
    points: Array
    neighbours: Array
    order: Array
    labels: Array
    weights: Array
    standing_for: Array
    spacing: float

    @classmethod
    def build(cls, points: Array, spacing: float, means: Array, feet: Array, across: Array) -> PointFrames:
        """The operator for Gaussians with means (N, 3) [m], about the centre of the body.

        Parameters
        ----------
        points : (P, 3) [m]
        spacing
            Mean distance of points [m].
        means : (N, 3) [m]
        feet : (N, 3) [m]
            Where in the body the matter is that each Gaussian follows: itself, or below the surface that it lies on.
        across : (P, C) bool
            Whether what is between a point and its C nearest others, `candidates`, was open at rest.
        """
        tree = _tree(points)
        distances, nearest = cls.candidates(points, tree)
        connected = (distances <= _CONNECTED * spacing) & ~across
        chosen = np.argsort(~connected, axis=1, kind="stable")[:, :NEIGHBOURS]
        own = np.arange(len(points))[:, None]
        neighbours = np.where(
            np.take_along_axis(connected, chosen, axis=1), np.take_along_axis(nearest, chosen, axis=1), own
        ).astype(np.int32)
        order = along_a_curve(means)
        labels, weights = _followed(points, neighbours, feet[order], tree, spacing)
        return cls(
            points=points,
            neighbours=neighbours,
            order=order,
            labels=labels,
            weights=weights,
            standing_for=_tree(means).query(points, workers=processors())[1].astype(np.int32),
            spacing=spacing,
        )

    @classmethod
    def candidates(cls, points: Array, tree: Any = None) -> tuple[Array, Array]:
        """Distances (P, C) [m] and rows (P, C) of the nearest others of each point; fewer than 24 of few points."""
        count = min(_CANDIDATES, len(points) - 1)
        if count == 0:
            return np.zeros((1, 0)), np.zeros((1, 0), dtype=np.int64)
        found = (tree or _tree(points)).query(points, k=[*range(1, count + 2)], workers=processors())
        distances, nearest = found
        # Of coincident points any may come first.
        itself = nearest == np.arange(len(points))[:, None]
        itself[~itself.any(axis=1), -1] = True
        shape = (len(points), count)
        return distances[~itself].reshape(shape), nearest[~itself].reshape(shape)

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> PointFrames:
        """From what `arrays` gave."""
        columns = {name: array for name, array in arrays.items() if name != "spacing"}
        return cls(**columns, spacing=float(arrays["spacing"][0]))

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`."""
        moved = np.ascontiguousarray(displacements, dtype=np.float64)
        table = np.empty((len(self.points), point_kernels.COLUMNS))
        reach = _CONNECTED * self.spacing * 1.05
        point_kernels.affine_maps(
            self.points, moved, self.neighbours, reach, _TORN, table, linalg3.chunk_count(len(self.points))
        )
        rest = np.ascontiguousarray(rest)
        start = rest if drifted is None else np.ascontiguousarray(drifted)
        out = np.empty_like(start)
        point_kernels.carry_by_points(
            rest,
            start,
            self.points,
            table,
            self.order,
            self.labels,
            self.weights,
            _APART * self.spacing,
            out,
            linalg3.chunk_count(len(rest)),
        )
        return out

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`: the affine field that is nearest to them, exact where they are rigid, and what is
        left of those of the surface, which goes on into the body as a harmonic field."""
        from scipy import sparse
        from scipy.sparse.linalg import cg

        places = np.append(rest.reshape(-1, 3), np.ones((rest.size // 3, 1)), axis=1)
        # Along axes that they do not extend along they tell nothing, and the least is taken.
        affine = np.linalg.lstsq(places, velocities.reshape(-1, 3), rcond=_THIN)[0]
        velocities = velocities - (places @ affine).reshape(velocities.shape)
        whole = np.append(self.points, np.ones((len(self.points), 1)), axis=1) @ affine
        count, own = len(self.points), self.leaders
        held = np.bincount(own, minlength=count).astype(np.float64)
        means = np.stack([np.bincount(own, column, minlength=count) for column in velocities.mean(axis=1).T], axis=1)
        rows = np.repeat(np.arange(count), self.neighbours.shape[1])
        columns = self.neighbours.reshape(-1)
        links = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
        links = links.maximum(links.T)
        degrees = links.sum(axis=1) - links.diagonal()
        weight = np.where(held > 0, _HELD, _LOOSE)
        system = sparse.diags_array(degrees + weight) - links + sparse.diags_array(links.diagonal())
        targets = np.where(held[:, None] > 0, means / np.maximum(held, 1.0)[:, None], velocities.mean(axis=(0, 1)))
        found = [cg(system, weight * column, x0=column, rtol=1e-10)[0] for column in targets.T]
        return whole + np.stack(found, axis=1)

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`."""
        own = np.empty(len(self.order), dtype=np.int64)
        own[self.order] = self.labels[:, 0]
        return own

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        return self.standing_for

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        return {
            "points": self.points,
            "neighbours": self.neighbours,
            "order": self.order,
            "labels": self.labels,
            "weights": self.weights,
            "standing_for": self.standing_for,
            "spacing": np.array([self.spacing]),
        }


_THIN = 1e-6
"""Of the largest singular value of the places of a body: what extends less has no slope along that axis."""
_HELD, _LOOSE = 1e3, 1e-9
"""Weights of known velocities, and of the mean where nothing is known, beside those of neighbours, which are 1."""


def _tree(points: Array) -> Any:
    from scipy.spatial import KDTree

    return KDTree(points)


def _followed(points: Array, neighbours: Array, feet: Array, tree: Any, spacing: float) -> tuple[Array, Array]:
    """Points that each Gaussian follows, (N, F), its own first, and how much, (N, F)."""
    distances, own = tree.query(feet, workers=processors())
    near = neighbours[own]
    ways = np.linalg.norm(points[near] - feet[:, None], axis=2)
    ways[near == own[:, None]] = np.inf
    nearest = np.argsort(ways, axis=1, kind="stable")[:, : FOLLOWED - 1]
    labels = np.concatenate([own[:, None], np.take_along_axis(near, nearest, axis=1)], axis=1).astype(np.int32)
    lengths = np.concatenate([distances[:, None], np.take_along_axis(ways, nearest, axis=1)], axis=1)
    # Those at the reach count nothing: none comes or goes with a jerk from one Gaussian to the next.
    reach = 1.5 * spacing + lengths[:, :1]
    weights = np.maximum(1 - (lengths / reach) ** 2, 0.0) ** 2
    weights = np.where(np.isfinite(lengths), weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    weights[distances > _FAR * spacing] = 0.0
    return labels, weights.astype(np.float32)
