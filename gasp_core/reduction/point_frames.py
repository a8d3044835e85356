"""From the motion of material points to that of everything around them: an affine map for each point, every frame.

Each point has a deformation gradient, the fit in the sense of least squares to its own displacement and those of the
points it was connected to at rest (as in Müller et al. 2004, 10.1145/1028523.1028542); what has been torn off does not
count, what is stretched as a whole does, however far. A Gaussian follows the maps of the point it belongs to and of
that one's neighbours, as long as they agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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
"""Times as far as at rest: farther off, a point has been torn off,"""
_WHOLE = 1 / 16
"""unless one affine map explains all but so much of how a neighbourhood's displacements scatter: it is stretched as a
whole then. Where a crack goes through it that share is a quarter, where matter is stirred almost all."""
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
        The Gaussian nearest to each point, by way of matter.
    spacing
        Mean distance of points [m].
    followed : (Q,) int64
        The points that any Gaussian follows, which follows from `labels`.
    """

    kind: ClassVar[str] = "volume"
    points: Array
    neighbours: Array
    order: Array
    labels: Array
    weights: Array
    standing_for: Array
    spacing: float
    followed: Array = field(init=False)

    def __post_init__(self) -> None:
        any_follows = np.zeros(len(self.points), dtype=bool)
        any_follows[self.labels.reshape(-1)] = True
        object.__setattr__(self, "followed", np.flatnonzero(any_follows))

    @classmethod
    def build(
        cls,
        points: Array,
        spacing: float,
        means: Array,
        feet: Array,
        open_between: Callable[[Array, Array], Array],
    ) -> PointFrames:
        """The operator for Gaussians with means (N, 3) [m], about the centre of the body.

        Parameters
        ----------
        points : (P, 3) [m]
        spacing
            Mean distance of points [m].
        means : (N, 3) [m]
        feet : (N, 3) [m]
            Where in the body the matter is that each Gaussian follows: itself, or below the surface that it lies on.
        open_between
            Whether it was open at rest between the points of these rows (M,) and of those (M,).
        """
        tree = _tree(points)
        neighbours = _connected(points, tree, spacing, open_between)
        order = along_a_curve(means)
        labels, weights, lengths = _followed(points, neighbours, means[order], feet[order], tree, spacing)
        return cls(
            points=points,
            neighbours=neighbours,
            order=order,
            labels=labels,
            weights=weights,
            standing_for=order[_nearest_followers(points, neighbours, labels[:, 0], lengths)].astype(np.int32),
            spacing=spacing,
        )

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
            self.points,
            moved,
            self.followed,
            self.neighbours,
            reach,
            _TORN,
            _WHOLE,
            table,
            linalg3.chunk_count(len(self.followed)),
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
        return self.follower(rest)(velocities)

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`: as `gather` does, and from one frame to the next little is left to be found."""
        from scipy.sparse.linalg import cg

        places = np.append(rest.reshape(-1, 3), np.ones((rest.size // 3, 1)), axis=1)
        # Along axes that they do not extend along they tell nothing, and the least is taken.
        inverse = np.linalg.pinv(places, rcond=_THIN)
        ends = np.append(self.points, np.ones((len(self.points), 1)), axis=1)
        count, own = len(self.points), self.leaders
        held = np.bincount(own, minlength=count).astype(np.float64)[:, None]
        weight = np.where(held[:, 0] > 0, _HELD, _LOOSE)
        system = self._links(weight)
        last: list[Array] = []

        def follow(values: Array) -> Array:
            affine = inverse @ values.reshape(-1, 3)
            values = values - (places @ affine).reshape(values.shape)
            sums = np.stack([np.bincount(own, each, minlength=count) for each in values.mean(axis=1).T], axis=1)
            targets = np.where(held > 0, sums / np.maximum(held, 1.0), values.mean(axis=(0, 1)))
            last[:] = [
                cg(system, weight * column, x0=start, rtol=1e-10)[0]
                for column, start in zip(targets.T, last or targets.T)
            ]
            return ends @ affine + np.stack(last, axis=1)

        return follow

    def _links(self, weight: Array) -> Any:
        """The graph Laplacian of the points that are connected, (P, P), sparse, and `weight` (P,) on its diagonal."""
        from scipy import sparse

        count = len(self.points)
        rows, columns = np.repeat(np.arange(count), self.neighbours.shape[1]), self.neighbours.reshape(-1)
        links = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
        links = links.maximum(links.T)
        degrees = links.sum(axis=1) - links.diagonal()
        return sparse.diags_array(degrees + weight) - links + sparse.diags_array(links.diagonal())

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


def _connected(
    points: Array, tree: Any, spacing: float, open_between: Callable[[Array, Array], Array]
) -> NDArray[np.int32]:
    """Points that each is connected to, (P, K), the nearest first; itself where there are fewer."""
    own = np.arange(len(points))[:, None]
    count = min(_CANDIDATES, len(points) - 1)
    distances, nearest = tree.query(points, k=[*range(1, count + 2)], workers=processors())
    # Of coincident points any may come first.
    itself = nearest == own
    itself[~itself.any(axis=1), -1] = True
    distances, nearest = (found[~itself].reshape(len(points), count) for found in (distances, nearest))
    connected, had = distances <= _CONNECTED * spacing, np.zeros(len(points), dtype=int)
    for column in range(count):
        # Whoever has enough of them is asked no more.
        rows = np.flatnonzero(connected[:, column] & (had < NEIGHBOURS))
        connected[rows, column] = ~open_between(rows, nearest[rows, column])
        had[rows] += connected[rows, column]
    chosen = np.argsort(~connected, axis=1, kind="stable")[:, :NEIGHBOURS]
    found = np.where(np.take_along_axis(connected, chosen, axis=1), np.take_along_axis(nearest, chosen, axis=1), own)
    return found.astype(np.int32)


def _followed(
    points: Array, neighbours: Array, means: Array, feet: Array, tree: Any, spacing: float
) -> tuple[Array, Array, Array]:
    """Points that each Gaussian follows, (N, F), its own first, how much, (N, F), and how far its own is, (N,) [m]."""
    distances, own = tree.query(feet, workers=processors())
    labels = np.empty((len(feet), min(FOLLOWED, 1 + neighbours.shape[1])), dtype=np.int32)
    lengths = np.empty(labels.shape)
    labels[:, 0], lengths[:, 0] = own, distances
    point_kernels.follow(points, neighbours, feet, labels, lengths, linalg3.chunk_count(len(feet)))
    # Those at the reach count nothing: none comes or goes with a jerk from one Gaussian to the next.
    reach = 1.5 * spacing + lengths[:, :1]
    weights = np.maximum(1 - (np.minimum(lengths, reach) / reach) ** 2, 0.0) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    far = np.linalg.norm(means - feet, axis=1) + distances > _FAR * spacing
    # Where a foot is far off another point may be near.
    far[far] = tree.query(means[far], workers=processors())[0] > _FAR * spacing
    weights[far | (distances > _FAR * spacing)] = 0.0
    return labels, weights.astype(np.float32), distances


def _nearest_followers(points: Array, neighbours: Array, own: Array, lengths: Array) -> Array:
    """For each point one of the Gaussians (N,) whose own point it is, the nearest; for one that has none that of the
    nearest point which has.

    The way to it goes through matter: a search in space for what is nearest to the middle of a body would look at all
    of its surface.
    """
    from scipy import sparse
    from scipy.sparse import csgraph

    rows = np.lexsort((lengths, own))
    leading, first = np.unique(own[rows], return_index=True)
    nearest = np.full(len(points), -1)
    nearest[leading] = rows[first]
    starts, ends = np.repeat(np.arange(len(points)), neighbours.shape[1]), neighbours.reshape(-1)
    # A way of no length, between coincident points, would be none.
    ways = np.maximum(np.linalg.norm(points[ends] - points[starts], axis=1), np.finfo(np.float64).tiny)
    links = sparse.coo_array((ways, (starts, ends)), shape=(len(points), len(points))).tocsr()
    links = links.maximum(links.T)
    _, _, sources = csgraph.dijkstra(links, indices=leading, min_only=True, return_predecessors=True)
    apart = np.flatnonzero(sources < 0)
    if len(apart):
        sources[apart] = leading[_tree(points[leading]).query(points[apart], workers=processors())[1]]
    return nearest[sources]
