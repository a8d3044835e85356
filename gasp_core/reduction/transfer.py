"""From the motion of cores to that of everything they stand for: operators built once and applied every frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core import linalg3
from gasp_core.games import polar_rotations
from gasp_core.reduction import kernels
from gasp_core.reduction.morton import along_a_curve
from gasp_core.stepping.threads import processors

__all__ = ["NEIGHBOURS", "Cores", "LeastSquares", "OneFrame", "Transfer", "add_normals"]

Array = NDArray[Any]

NEIGHBOURS = kernels.NEIGHBOURS
"""Cores whose motion a Gaussian follows, its own one first of all."""
OWN_SHARE = 0.9
"""Of a neighbourhood's weights, the own core's. Those near may be of another leaf: carried by cores that move as their
clusters do, a plant strays by 0.008 % of its diagonal, by 0.06 % if distance alone decides (and steepness is 2). What
is left to the others smooths what a torn core would do, and tells how matter turns where it is flat."""
STEEPNESS = 16
"""Of the other weights over the distance, so that few large cores do not smooth what moves differently."""
_SMALLEST = 1e-300
"""Where the only neighbour lies at the edge of its reach, no weight is left to share."""
_THINNEST = 1e-5
"""Least share of a neighbourhood's shortest axis squared in its longest one squared: displacements in float32 of the
size of the neighbourhood then give the slope across it to 2e-5."""
_FLAT_CORE = 1e-15
"""The same of a core alone, in double precision."""
_ROWS_AT_ONCE = 2**16


@dataclass(frozen=True, kw_only=True)
class Cores:
    """Simplices that stand for what is around them: tetrahedra for clusters, or those of the Gaussians themselves.

    Parameters
    ----------
    points : (C, V, 3) [m]
        Their corners, about the centre of the body.
    """

    points: Array

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def centres(self) -> Array:
        """Means of their corners, (C, 3) [m]."""
        return self.points.mean(axis=1)

    @property
    def moments(self) -> Array:
        """Second moments of their corners about the centres, (C, 3, 3) [m^2]."""
        offsets = self.points - self.centres[:, None]
        return np.einsum("cvi,cvj->cij", offsets, offsets) / self.points.shape[1]

    @cached_property
    def _at_rest(self) -> tuple[Array, Array, Array]:
        """What never changes: slopes (C, V, 3) [1/m], principal axes, and which are flat.

        The gradient of displacements (C, V, 3) of corners is the sum over these of displacement times slope: offset
        from the centre times the inverse of the moments, as far as a core extends.
        """
        values, axes = np.linalg.eigh(self.moments)
        flat = values[:, 1] > _FLAT_CORE * values[:, 2]
        # Rounding may give a triangle a volume.
        whole = flat & (values[:, 0] > _FLAT_CORE * values[:, 2]) & (self.points.shape[1] > 3)
        known = np.stack([whole, flat, flat], axis=1)
        reciprocals = np.where(known, 1 / np.where(known, values, 1.0), 0.0)
        inverses = (axes * reciprocals[:, None]) @ axes.transpose(0, 2, 1)
        slopes = (self.points - self.centres[:, None]) @ inverses / self.points.shape[1]
        return slopes, axes, flat & ~whole

    def turned(self, displacements: Array, rows: Array | slice = slice(None)) -> Array:
        """R - 1 of the matter of each core, (C, 3, 3), when their corners are displaced by (C, V, 3) [m]; of some rows.

        R is the polar rotation of the deformation gradient; that of a flat core takes its normal to the normal it has
        now. 1 where a core is a line or a point.
        """
        slopes, axes, flat = (known[rows] for known in self._at_rest)
        gradients = displacements[rows].transpose(0, 2, 1) @ slopes
        add_normals(gradients, axes, np.flatnonzero(flat))
        one = np.eye(3)[None]
        # The polar rotation of 1 is subtracted, not 1: at displacement zero the difference is zero to the last bit.
        return polar_rotations(one + gradients) - polar_rotations(one)


def add_normals(gradients: Array, axes: Array, rows: Array) -> None:
    """Let F = 1 + gradients take the normals of flat cores, the first of their principal axes, to those they have now.

    Without displacement that adds nothing, to the last bit.
    """
    normal, second, third = (axes[rows, :, k] for k in range(3))
    moved = [axis + np.einsum("cij,cj->ci", gradients[rows], axis) for axis in (second, third)]
    change = _unit_cross(*moved) - _unit_cross(second, third)
    facing = np.sign(np.einsum("ci,ci->c", np.cross(second, third), normal))[:, None]
    gradients[rows] += (facing * change)[:, :, None] * normal[:, None, :]


def _unit_cross(first: Array, second: Array) -> Array:
    normals = np.cross(first, second)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1.0)


class Transfer(Protocol):
    """Moves simplices as cores move."""

    kind: ClassVar[str]

    @property
    def labels(self) -> Array:
        """The core (N,) each simplex belongs to."""
        ...

    def carry(self, cores: Cores, rest: Array, displacements: Array) -> Array:
        """Simplices (N, V, 3), from those at rest and the displacements (C, V, 3) of the cores' corners [m]."""
        ...

    def arrays(self) -> Mapping[str, Array]:
        """All it is made of."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class OneFrame:
    """Every simplex moves rigidly with the frame of the core of its cluster, the paper's rule.

    The frame is that of the polar rotation of the core's deformation gradient: Gram-Schmidt's prefers an edge.

    Parameters
    ----------
    labels : (N,)
    """

    kind: ClassVar[str] = "frame"
    labels: Array

    def carry(self, cores: Cores, rest: Array, displacements: Array) -> Array:
        """See `Transfer`."""
        out = np.empty_like(rest)
        _carry_rigidly(cores, rest, displacements, self.labels, None, out)
        return out

    def arrays(self) -> Mapping[str, Array]:
        """See `Transfer`."""
        return {"labels": self.labels}


@dataclass(frozen=True, slots=True, kw_only=True)
class LeastSquares:
    """Affine moving least squares over the corners of the nearest cores (Levin 1998, 10.1090/S0025-5718-98-00974-0).

    At a Gaussian with mean m the affine map minimises sum_j w_j mean_v |A x_jv + b - u_jv|^2 over its neighbours j
    and their corners v, its own core weighing most: what is near may be another leaf. All vertices of a simplex follow
    one map: neighbourhoods that change between them would tear a small simplex. With P the mean of the corners under w,
    M = sum_j w_j mean_v (x_jv - P) (x_jv - P)^T,

        b(x) = sum_j w_j u_j + [sum_j w_j mean_v u_jv (x_jv - P)^T] M^-1 (x - P).

    Parameters
    ----------
    labels : (N,)
    order : (N,)
        The rows that `neighbours`, `weights` and `inverses` are of: those close in space read the same cores, one
        after the other.
    neighbours : (N, 8) int32
        Nearest first; last the own core where it is none of the nearest.
    weights : (N, 8) float32
        Of sum 1, most of it the own core's; zero where there are fewer cores than eight.
    inverses : (N, 6) float64 [1/m^2]
        M^-1: xx, xy, xz, yy, yz, zz; zero for those that fell back. Thin neighbourhoods make it a large matrix of
        small differences: float32 would not do.
    fallen : (F,)
        Rows whose neighbourhood is flat or a line: they follow their own core's frame.
    """

    kind: ClassVar[str] = "least-squares"
    labels: Array
    order: Array
    neighbours: Array
    weights: Array
    inverses: Array
    fallen: Array

    @classmethod
    def build(
        cls, cores: Cores, means: Array, labels: Array, own_share: float = OWN_SHARE, steepness: int = STEEPNESS
    ) -> LeastSquares:
        """The operator for simplices with means (N, 3) [m], about the centre of the body, and these labels.

        `own_share` of the weights is that of the own core; the others go by their distance s, a share of how far the
        neighbourhood reaches: (1 - s^2)^steepness.
        """
        order = along_a_curve(means)
        neighbours, weights = _neighbourhoods(cores.centres, means[order], labels[order], own_share, steepness)
        return cls.fitted(cores, labels, order, neighbours.astype(np.int32), weights)

    @classmethod
    def fitted(cls, cores: Cores, labels: Array, order: Array, neighbours: Array, weights: Array) -> LeastSquares:
        """The operator of known neighbourhoods: `neighbours` and `weights` (N, K <= 8), those of `order`."""
        centres, own = cores.centres, cores.moments
        inverses = np.zeros((len(labels), 6))
        fallen: list[Array] = []
        for first in range(0, len(labels), _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            values, axes = np.linalg.eigh(_moments(centres, own, neighbours[rows], weights[rows]))
            thin = ~(values[:, 0] > _THINNEST * values[:, 2])
            values[thin] = np.inf
            inverse = np.einsum("nik,nk,njk->nij", axes, 1 / values, axes)
            inverses[rows] = inverse[:, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)]
            fallen.append(order[rows][thin])
        return cls(
            labels=labels,
            order=order,
            neighbours=_padded(neighbours),
            weights=_padded(weights),
            inverses=inverses,
            fallen=np.concatenate(fallen),
        )

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> LeastSquares:
        """From what `arrays` gave, now, when there was no `order` yet, or fewer columns where there are few cores."""
        lacking = {"order": np.arange(len(arrays["labels"]), dtype=np.int32)}
        padded = {name: _padded(arrays[name]) for name in ("neighbours", "weights")}
        return cls(**{**lacking, **arrays, **padded})

    def carry(self, cores: Cores, rest: Array, displacements: Array) -> Array:
        """See `Transfer`."""
        out = np.empty(rest.shape, dtype=rest.dtype)
        table = np.empty((len(cores), kernels.COLUMNS))
        kernels.affine_table(cores.points, displacements, table, linalg3.chunk_count(len(cores)))
        rows, chunks = np.ascontiguousarray(rest), linalg3.chunk_count(len(rest))
        kernels.carry_affinely(rows, table, self.order, self.neighbours, self.weights, self.inverses, out, chunks)
        if len(self.fallen):
            _carry_rigidly(cores, rest, displacements, self.labels, self.fallen, out)
        return out

    def arrays(self) -> Mapping[str, Array]:
        """See `Transfer`."""
        return {
            "labels": self.labels,
            "order": self.order,
            "neighbours": self.neighbours,
            "weights": self.weights,
            "inverses": self.inverses,
            "fallen": self.fallen,
        }


def _padded(columns: Array) -> Array:
    """(N, K) with zeros up to K = 8: neighbours of no weight."""
    return np.pad(columns, ((0, 0), (0, NEIGHBOURS - columns.shape[1])))


def _neighbourhoods(
    centres: Array, means: Array, labels: Array, own_share: float, steepness: int
) -> tuple[Array, Array]:
    """Nearest cores (N, K), nearest first but for the own one, which may come last, and their weights (N, K)."""
    from scipy.spatial import KDTree

    count = min(NEIGHBOURS, len(centres))
    # One more than are used: its distance is where weights come to zero, so that no core comes or goes with a jerk.
    asked = min(count + 1, len(centres))
    tree: Any = KDTree(centres)
    distances, nearest = tree.query(means, k=[*range(1, asked + 1)], workers=processors())
    reach = distances[:, -1:] * (1.02 if asked > count else 2.0)
    share = distances[:, :count] / np.where(reach > 0, reach, 1.0)
    weights = (1 - share**2) ** steepness
    neighbours = nearest[:, :count].copy()
    foreign = (neighbours != labels[:, None]).all(axis=1)
    neighbours[foreign, -1], weights[foreign, -1] = labels[foreign], 0.0
    weights *= (1 - own_share) / np.maximum(weights.sum(axis=1, keepdims=True), _SMALLEST)
    weights[neighbours == labels[:, None]] += own_share
    return neighbours, (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def _moments(centres: Array, own: Array, neighbours: Array, weights: Array) -> Array:
    """M of every neighbourhood, (N, 3, 3), from the cores' own second moments (C, 3, 3) about their centres."""
    offsets = centres[neighbours] - centres[neighbours[:, :1]]
    mean = np.einsum("nk,nki->ni", weights, offsets)
    between = np.einsum("nk,nki,nkj->nij", weights, offsets, offsets) - mean[:, :, None] * mean[:, None, :]
    return between + np.einsum("nk,nkij->nij", weights, own[neighbours])


def _carry_rigidly(
    cores: Cores, rest: Array, displacements: Array, labels: Array, rows: Array | None, out: Array
) -> None:
    """out[rows], simplices that move with the frame of their core; None: all of them."""
    table = np.empty((len(cores), 15))
    corners = displacements.shape[1]
    # A product of matrices: a mean over so short an axis takes twice the time.
    table[:, :3] = (np.full((1, corners), 1 / corners) @ displacements)[:, 0]
    table[:, 3:6] = cores.centres
    used = slice(None) if rows is None else np.unique(labels[rows])
    table[used, 6:] = cores.turned(displacements, used).reshape(-1, 9)
    rows = np.arange(len(rest)) if rows is None else rows
    kernels.carry_rigidly(rest, table, labels, rows, out, linalg3.chunk_count(len(rows)))
