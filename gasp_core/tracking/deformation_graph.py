"""Few nodes, each with an affine map of its own, whose blend moves all points: an embedded deformation.

After Sumner, Schmid, Pauly 2007 (10.1145/1275808.1276478): x = sum_q w_q (g_q + T_q (p - g0_q)). Fitted are increments
T_q <- (1 + A_q) T_q, g_q <- g_q + t_q, to first order: sum |W (y - x)|^2 of pairs, what neighbouring nodes say of each
other's places, and the strain of the increments.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.reduction.clusters import cluster
from gasp_core.tracking.clouds import Affine, Cloud

__all__ = ["DeformationGraph", "Pose"]

Array = NDArray[Any]

_BLENDED = 4
"""Nodes that a point goes with."""
_LINKS = 8
"""Nodes that each is kept in line with."""
_STRAIN = 0.1
"""Weight of the strain of an increment, beside what neighbours say of each other."""
_ELASTIC = 0.1
"""How far what neighbours have come apart by is pulled back, beside what they come apart by now."""
_FIRM = 1e-9
_LEAST = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """What the nodes do.

    Parameters
    ----------
    places : (K, 3)
    transforms : (K, 3, 3)
    """

    places: Array
    transforms: Array

    def then(self, affine: Affine) -> Pose:
        """The same, and a map of everything after it."""
        return Pose(places=affine(self.places), transforms=affine.matrix @ self.transforms)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformationGraph:
    """Nodes, and the points that go with them.

    Parameters
    ----------
    points : (N, 3)
        At rest.
    nodes : (K, 3)
        At rest.
    links : (2, E)
        Nodes, and the others that they have a say about.
    near : (N, Q)
        Nodes that each point goes with.
    weights : (N, Q)
        Of these; they sum to 1.
    length
        Between neighbouring nodes.
    """

    points: Array
    nodes: Array
    links: Array
    near: Array
    weights: Array
    length: float

    @classmethod
    def over(cls, points: Array, count: int) -> DeformationGraph:
        """About so many nodes, evenly over the points (N, 3)."""
        from scipy.spatial import KDTree

        # As far as there are so many places: Gaussians may lie on top of each other.
        places = np.unique(points, axis=0)
        labels = cluster(places, count)
        sizes = np.bincount(labels)
        middles = np.stack([np.bincount(labels, column) / sizes for column in places.T], axis=1)
        whole: Any = KDTree(places)
        nodes = places[np.unique(whole.query(middles)[1])]
        tree: Any = KDTree(nodes)
        apart, others = tree.query(nodes, k=min(_LINKS, len(nodes) - 1) + 1)
        own = np.repeat(np.arange(len(nodes)), others.shape[1] - 1)
        near, weights = _blended(points, tree)
        return cls(
            points=points,
            nodes=nodes,
            links=np.stack([own, others[:, 1:].reshape(-1)]),
            near=near,
            weights=weights,
            length=float(np.median(apart[:, 1])),
        )

    @property
    def rest(self) -> Pose:
        """In which every point is where it is at rest."""
        return Pose(places=self.nodes, transforms=np.tile(np.eye(3), (len(self.nodes), 1, 1)))

    def of(self, rows: Array) -> DeformationGraph:
        """The same nodes with some of the points."""
        return replace(self, points=self.points[rows], near=self.near[rows], weights=self.weights[rows])

    def with_points(self, points: Array) -> DeformationGraph:
        """The same nodes with other points (N, 3)."""
        from scipy.spatial import KDTree

        near, weights = _blended(points, KDTree(self.nodes))
        return replace(self, points=points, near=near, weights=weights)

    def carried(self, pose: Pose) -> Array:
        """Where the points are then, (N, 3)."""
        return np.einsum("nq,nqi->ni", self.weights, pose.places[self.near] + self._arms(pose))

    def gradients(self, pose: Pose) -> Array:
        """How what is around each point is turned and stretched then, (N, 3, 3)."""
        return np.einsum("nq,nqij->nij", self.weights, pose.transforms[self.near])

    def fitted(self, pose: Pose, cloud: Cloud, smoothness: float) -> Pose:
        """A pose in which the points lie better on a cloud, one step from another pose.

        Parameters
        ----------
        pose
            From which on.
        cloud
            To be laid onto.
        smoothness
            Weight of what neighbouring nodes say of each other, over that of the points.
        """
        across, apart = self._towards(pose, cloud)
        between, open_ = self._between(pose)
        matrix = (across.T @ across).toarray() / len(apart)
        matrix += np.kron((between.T @ between).toarray() * (smoothness / len(open_)), np.eye(3))
        matrix += np.kron(np.eye(len(self.nodes)), _strain() * (_STRAIN * smoothness / len(self.nodes)))
        matrix[np.diag_indices_from(matrix)] += _FIRM * np.trace(matrix) / len(matrix)
        sides = across.T @ apart.reshape(-1) / len(apart)
        sides += _ELASTIC * smoothness * (between.T @ open_).reshape(-1) / len(open_)
        steps = np.linalg.solve(matrix, sides).reshape(-1, 4, 3)
        turns = np.eye(3) + steps[:, :3].transpose(0, 2, 1) / self.length
        return Pose(places=pose.places + steps[:, 3], transforms=turns @ pose.transforms)

    def _arms(self, pose: Pose) -> Array:
        """From each node of a point to the point, (N, Q, 3)."""
        return np.einsum("nqij,nqj->nqi", pose.transforms[self.near], self.points[:, None] - self.nodes[self.near])

    def _towards(self, pose: Pose, cloud: Cloud) -> tuple[Any, Array]:
        """What increments, (K, 4, 3) of them, do to pairs (P,): a matrix (3 P, 12 K); and what is missing, (P, 3)."""
        from scipy import sparse

        places = self.carried(pose)
        rows, others = cloud.pairs(places)
        metric = cloud.metric[others]
        near, weights = self.near[rows], self.weights[rows]
        apart = np.einsum("pij,pj->pi", metric, cloud.points[others] - places[rows])
        arms = self.of(rows)._arms(pose) / self.length
        reach = np.concatenate([arms, np.ones((*near.shape, 1))], axis=2) * weights[:, :, None]
        values = np.einsum("pij,pqk->piqkj", metric, reach)
        width = near.shape[1] * 12
        columns = (near[:, :, None] * 12 + np.arange(12)).reshape(len(rows), width)
        starts = np.arange(0, values.size + 1, width)
        shape = (3 * len(rows), 12 * len(self.nodes))
        across = sparse.csr_array((values.reshape(-1), np.repeat(columns, 3, axis=0).reshape(-1), starts), shape=shape)
        return across, apart

    def _between(self, pose: Pose) -> tuple[Any, Array]:
        """What increments do to what neighbours say of each other, for each axis alike, (E, 4 K), and what is open."""
        from scipy import sparse

        one, other = self.links
        said = np.einsum("eij,ej->ei", pose.transforms[one], self.nodes[other] - self.nodes[one])
        open_ = pose.places[other] - pose.places[one] - said
        number = np.arange(len(one))
        columns = np.concatenate([*(4 * one + k for k in range(4)), 4 * other + 3])
        ones = np.ones(len(one))
        values = np.concatenate([*(said / self.length).T, ones, -ones])
        shape = (len(one), 4 * len(self.nodes))
        return sparse.csr_array((values, (np.tile(number, 5), columns)), shape=shape), open_


def _blended(points: Array, tree: Any) -> tuple[Array, Array]:
    """Nodes of a tree that points (N, 3) go with, (N, Q), and their weights."""
    distances, near = tree.query(points, k=min(_BLENDED, tree.n - 1) + 1)
    farthest = np.maximum(distances[:, -1:], np.finfo(float).tiny)
    weights = (1 - distances[:, :-1] / farthest) ** 2 + _LEAST
    return near[:, :-1], weights / weights.sum(axis=1, keepdims=True)


def _strain() -> Array:
    """The quadratic form |(A + A^T)/2|^2 of an increment (4, 3), (12, 12)."""
    form = np.zeros((4, 3, 4, 3))
    for i in range(3):
        for j in range(3):
            form[i, j, i, j] += 0.5
            form[i, j, j, i] += 0.5
    return form.reshape(12, 12)
