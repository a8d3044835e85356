"""What moves in a moving splat, decoded: simplices of every body, frame by frame.

Every Gaussian has an affine map of its own in a frame, x -> x + b + G x: its covariance becomes F Sigma F^T, F = 1 + G.
Its four points, the mean and the mean plus each of its axes, are where that map takes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.games import edge_axes, to_simplices
from gasp_core.gaussians import Gaussians, rotation_matrices
from gasp_core.moving.carriers import Carrier
from gasp_core.reduction.point_frames import PointFrames

__all__ = ["AXIS_STEPS", "CarriedBody", "Corrections", "FreeBody", "MovingBody", "at_rest"]

Array = NDArray[Any]

AXIS_STEPS = 512
"""Of the length of an axis at rest: to so many parts of it is known where it has moved to."""


_AXES_MAY_BE_OFF = 1 / 16


class MovingBody(Protocol):
    """Gaussians that move together.

    Parameters
    ----------
    rows : (N,)
        Which of the splat's.
    numbers
        How many rows and columns of whole numbers a frame of it has.
    """

    @property
    def rows(self) -> Array:
        """As above."""
        ...

    @property
    def numbers(self) -> tuple[int, int]:
        """As above."""
        ...

    def simplices(self, numbers: Array, shift: Array, quantum: float) -> Array:
        """Simplices (N, 4, 3) [m] of a frame, from its whole numbers and its mean displacement (3,) [m]."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CarriedBody:
    """Gaussians that points carry; the numbers of a frame are displacements of the points, in quanta.

    Parameters
    ----------
    rows : (N,)
    centre : (3,) [m]
        About which all is that follows.
    rest : (N, 4, 3) [m]
        Simplices at rest.
    points
        How many carry it.
    carrier
        How.
    """

    rows: Array
    centre: Array
    rest: Array
    points: int
    carrier: Carrier

    @property
    def numbers(self) -> tuple[int, int]:
        """See `MovingBody`."""
        return self.points, 3

    def simplices(self, numbers: Array, shift: Array, quantum: float) -> Array:
        """See `MovingBody`."""
        return self.carrier.carry(self.rest, numbers * quantum) + (self.centre + shift)

    def places(self, numbers: Array, shift: Array, quantum: float) -> Array:
        """Where the points that fill it are, (P, 3) [m]."""
        assert isinstance(self.carrier, PointFrames)
        return self.carrier.points + numbers * quantum + (self.centre + shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeBody:
    """Gaussians that move each by itself; the numbers of a frame are how far the mean has moved, in quanta, and the
    three axes, less where they were, in parts of their lengths.

    Parameters
    ----------
    rows : (N,)
    means : (N, 3) [m]
    axes : (N, 3, 3)
        Unit vectors at rest, one a column.
    scales : (N, 3) [m]
    """

    rows: Array
    means: Array
    axes: Array
    scales: Array

    @classmethod
    def of(cls, rows: Array, gaussians: Gaussians) -> FreeBody:
        """Of Gaussians at rest."""
        axes = rotation_matrices(gaussians.quaternions)
        scales = gaussians.scales.astype(np.float64)
        return cls(rows=rows, means=gaussians.means.astype(np.float64), axes=axes, scales=scales)

    @property
    def numbers(self) -> tuple[int, int]:
        """See `MovingBody`."""
        return len(self.rows), 12

    def simplices(self, numbers: Array, shift: Array, quantum: float) -> Array:
        """See `MovingBody`."""
        means = self.means + numbers[:, :3] * quantum + shift
        axes = self.axes + numbers[:, 3:].reshape(-1, 3, 3) / AXIS_STEPS
        edges = (axes * self.scales[:, None, :]).transpose(0, 2, 1)
        return means[:, None] + np.concatenate([np.zeros((len(means), 1, 3)), edges], axis=1)

    def numbers_of(self, simplices: Array, axes_of: Gaussians, shift: Array, quantum: float) -> Array:
        """The whole numbers of a frame, (N, 12), from simplices (N, 3 | 4, 3) [m] of the Gaussians `axes_of` at rest.

        Of a triangle the thin axis stays normal to the others.
        """
        moves = simplices[:, 0] - self.means - shift
        moved = _moved_axes(simplices, axes_of)
        return np.concatenate(
            [np.round(moves / quantum), np.round((moved - self.axes) * AXIS_STEPS).reshape(-1, 9)], axis=1
        ).astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrections:
    """What a body's Gaussians are off by in a frame, where that is too much: matter that tears is carried elsewhere by
    the smallest of differences.

    Parameters
    ----------
    rows : (K,)
        Of the body's.
    numbers : (K, 12)
        What the means lack, in quanta, and the axes, in parts of their lengths, as in `FreeBody`.
    """

    rows: Array
    numbers: Array

    @classmethod
    def none(cls) -> Corrections:
        """Where all is near enough."""
        return cls(rows=np.zeros(0, dtype=np.int64), numbers=np.zeros((0, 12), dtype=np.int64))

    @classmethod
    def of(
        cls,
        found: Array,
        recorded: Array,
        held: Gaussians,
        recorded_from: Gaussians,
        quantum: float,
        allowed: float,
        shown: Array,
        last: Corrections,
    ) -> Corrections:
        """Of simplices (N, 4, 3) [m] that should be where recorded ones, (N, 3 | 4, 3) [m], are.

        Means may be off by `allowed` [m], and axes by a part of their lengths that is no more than what a small turn
        does. `held` are the Gaussians of the file at rest, `recorded_from` those of the recording. Where those of the
        `last` frame still do, they stay. Nobody sees those that are not `shown` (N,).
        """
        means = (recorded[:, 0] - found[:, 0]) / quantum
        wanted = _moved_axes(recorded, recorded_from)
        axes = np.where(held.scales[:, None, :] > 0, wanted - _axes_of(found, held), 0.0) * AXIS_STEPS
        lacking = np.concatenate([means, axes.reshape(-1, 9)], axis=1)
        seen = edge_axes(recorded_from.scales.astype(np.float64), recorded.shape[1])

        def off(lacking: Array, seen: Array) -> Array:
            along = np.abs(lacking[:, 3:]).reshape(-1, 3, 3).max(axis=1)
            turned = np.take_along_axis(along, seen, axis=1).max(axis=1) > _AXES_MAY_BE_OFF * AXIS_STEPS
            return turned | (np.linalg.norm(lacking[:, :3], axis=1) * quantum > allowed)

        needed = off(lacking, seen)
        same = ~off(lacking[last.rows] - last.numbers, seen[last.rows])
        kept = last.rows[same]
        needed[kept], lacking[kept] = True, last.numbers[same]
        rows = np.flatnonzero(needed & shown)
        return cls(rows=rows, numbers=np.round(lacking[rows]).astype(np.int64))

    def applied(self, simplices: Array, held: Gaussians, quantum: float) -> Array:
        """The simplices (N, 4, 3) [m] without what they are off by."""
        if not len(self.rows):
            return simplices
        some, chosen = simplices[self.rows], held.select(self.rows)
        axes = _axes_of(some, chosen) + self.numbers[:, 3:].reshape(-1, 3, 3) / AXIS_STEPS
        means = some[:, 0] + self.numbers[:, :3] * quantum
        moved = simplices.copy()
        moved[self.rows, 0] = means
        moved[self.rows, 1:] = means[:, None] + (axes * chosen.scales[:, None, :]).transpose(0, 2, 1)
        return moved


def _axes_of(simplices: Array, gaussians: Gaussians) -> Array:
    """Where the axes of Gaussians are now, one a column, (N, 3, 3), from simplices (N, 4, 3); those of no length: 0."""
    scales = gaussians.scales.astype(np.float64)
    edges = (simplices[:, 1:] - simplices[:, :1]).transpose(0, 2, 1)
    return np.where(scales[:, None, :] > 0, edges / np.where(scales > 0, scales, 1.0)[:, None, :], 0.0)


def at_rest(gaussians: Gaussians) -> Array:
    """Simplices (N, 4, 3) [m] of Gaussians, flat ones too."""
    return to_simplices(gaussians, 4)


def _moved_axes(simplices: Array, reference: Gaussians) -> Array:
    scales = reference.scales.astype(np.float64)
    axes = rotation_matrices(reference.quaternions).copy()
    rows = np.arange(len(scales))
    edges = simplices[:, 1:] - simplices[:, :1]
    which = edge_axes(scales, simplices.shape[1])
    for number in range(edges.shape[1]):
        axis = which[:, number]
        length = scales[rows, axis]
        known = length > 0
        axes[rows[known], :, axis[known]] = edges[known, number] / length[known, None]
    if simplices.shape[1] == 3:
        thin = 3 - which.sum(axis=1)
        normals = np.cross(axes[rows, :, (thin + 1) % 3], axes[rows, :, (thin + 2) % 3])
        lengths = np.linalg.norm(normals, axis=1)
        known = lengths > 0
        axes[rows[known], :, thin[known]] = normals[known] / lengths[known, None]
    return axes
