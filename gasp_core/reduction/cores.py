"""The reduction `cores`: few Gaussians stand for many (GASP, section 3.3: Core-Gaussians).

The Gaussians of a body are clustered. A core is the moment-matched simplex of its cluster: a tetrahedron whose four
corners, of equal mass, have the cluster's mass, mean and covariance. The corners are the engine's points; what it does
to them moves the rest. (The simplex T of the matched Gaussian would lie on one side of the mean, and take the centre of
mass along.) Several levels: cores of cores; the motion comes down level by level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.games import magnify
from gasp_core.moments import spread_along
from gasp_core.reduction.affine_fits import affine_fits
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.attached import Attached, sample_attached
from gasp_core.reduction.clusters import averages, cluster_apart, scatter
from gasp_core.reduction.occupancy import cell_volumes
from gasp_core.reduction.transfer import Cores, LeastSquares, OneFrame, Transfer, add_normals
from gasp_core.reduction.transfer_operator import Sample, bounds_of
from gasp_core.scene.objects import Reduction

__all__ = ["CORNERS_A_CELL", "Level", "Levels", "Matter", "corners_of", "sample_cores"]

Array = NDArray[Any]

_CORNERS = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
"""Four points of mean zero and covariance one."""
_ROUNDING = 1e-9
"""Of a body's size, that a core may be off by and still be of its cluster: coordinates are rounded at 1e-16 of it, a
cluster of a million adds up as many of these."""
CORNERS_A_CELL = 4
"""A plant in 5,499 cells strayed from that of all vertices by 0.8 % of its diagonal with 4 a cell, by 5.0 % with 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """Cores, and how they move what they stand for: the Gaussians, or the cores of the level below."""

    cores: Cores
    transfer: Transfer


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """A `TransferOperator` of cores.

    Parameters
    ----------
    levels
        From the cores that the engine moves to those that move the Gaussians.
    """

    kind: ClassVar[str] = "cores"
    levels: tuple[Level, ...]

    def carry(self, rest: Array, displacements: Array, drifted: Array | None = None) -> Array:
        """See `TransferOperator`.

        Both transfers are affine for each Gaussian: what carries X takes Y to phi(X) + F(X) (Y - X).
        """
        moved = np.asarray(displacements, dtype=np.float64).reshape(self.levels[0].cores.points.shape)
        for level, below in pairwise(self.levels):
            moved = level.transfer.carry(level.cores, below.cores.points, moved) - below.cores.points
        last = self.levels[-1]
        return last.transfer.carry(last.cores, rest if drifted is None else drifted, moved)

    def gather(self, rest: Array, velocities: Array) -> Array:
        """See `TransferOperator`: each core has the affine fit to its Gaussians' vertices, v + L (x - c).

        Along axes that they do not extend along, L is what keeps right angles to the others right.
        """
        fits = affine_fits(rest, velocities, self.labels)
        known, slopes = spread_along(fits.axes, fits.known), fits.slopes
        slopes = slopes - known @ slopes.transpose(0, 2, 1) @ spread_along(fits.axes, ~fits.known)
        return fits.at(self.levels[0].cores.points, slopes)

    def follower(self, rest: Array) -> Callable[[Array], Array]:
        """See `TransferOperator`: the same fit, and the normal of a flat core goes to the one that it has now."""

        def follow(moves: Array) -> Array:
            fits = affine_fits(rest, moves, self.labels)
            add_normals(fits.slopes, fits.axes, np.flatnonzero(fits.known.sum(axis=1) == 2))
            return fits.at(self.levels[0].cores.points)

        return follow

    @property
    def labels(self) -> Array:
        """For each Gaussian (N,), the core of the first level that it belongs to."""
        labels = self.levels[-1].transfer.labels
        for level in reversed(self.levels[:-1]):
            labels = level.transfer.labels[labels]
        return labels

    @property
    def leaders(self) -> Array:
        """See `TransferOperator`."""
        return 4 * self.labels

    @property
    def followers(self) -> Array:
        """See `TransferOperator`."""
        return np.repeat(np.unique(self.labels, return_index=True)[1], 4)

    def arrays(self) -> Mapping[str, Array]:
        """See `TransferOperator`."""
        kept: dict[str, Array] = {}
        for index, level in enumerate(self.levels):
            own = {
                "points": level.cores.points,
                **{f"transfer/{name}": array for name, array in level.transfer.arrays().items()},
            }
            kept |= {f"levels/{index}/{name}": array for name, array in own.items()}
        return kept

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> Levels:
        """From what `arrays` gave."""
        levels: list[Level] = []
        while f"levels/{len(levels)}/points" in arrays:
            head = f"levels/{len(levels)}/"
            own = {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}
            parts = {
                name.removeprefix("transfer/"): array for name, array in own.items() if name.startswith("transfer/")
            }
            transfer = LeastSquares.of(parts) if "neighbours" in parts else OneFrame(**parts)
            levels.append(Level(cores=Cores(points=own["points"]), transfer=transfer))
        return cls(levels=tuple(levels))


@dataclass(frozen=True, slots=True, kw_only=True)
class Matter:
    """What clusters are of, and they themselves: volumes (N,), means (N, 3) and covariances (N, 3, 3)."""

    volumes: Array
    means: Array
    covariances: Array

    def clustered(self, labels: Array) -> Matter:
        """Of the clusters."""
        volumes, means, between = scatter(self.means, labels, self.volumes)
        within = averages(self.covariances, labels, self.volumes)
        return Matter(volumes=volumes, means=means, covariances=between + within)


def sample_cores(
    block: Block,
    reduction: Reduction,
    floor: float,
    spacing: float,
    known: Levels | Attached | None = None,
    kinds: Array | None = None,
) -> Sample:
    """The corners of a body's cores.

    Parameters
    ----------
    block
        All its simplices.
    reduction
        How many cores, how many levels, which transfer.
    floor
        Shortest edge the engine is given [m].
    spacing
        Of the engine [m].
    known
        Cores that were made of such a body before, on whatever machine, and are to be these where they can be: where
        two clusters are equally near, or two axes equally long, roundings decide, and each processor has its own.
    kinds : (N,)
        Parts of the body: a core is of one. None: it has none.

    Returns
    -------
    Sample
        The volume of a core is that of the vertices it stands for, as `all` would have it, its corners share it
        equally: the mass is that of `all`, however few cores there are.
    """
    simplices, _ = magnify(block.rest, floor)
    count, vertices = simplices.shape[:2]
    corners = simplices.reshape(-1, 3)
    shares = cell_volumes(corners + block.centre, spacing)
    cells = round(float(shares.sum()) / spacing**3)
    kinds = np.zeros(count, dtype=np.int64) if kinds is None else kinds
    places = block.local.means.astype(np.float64)
    if reduction.transfer == "d-miso":
        before = known if isinstance(known, Attached) else None
        return sample_attached(
            simplices, shares.reshape(count, vertices), places, kinds, reduction.cores_of(count), floor, before
        )
    known = known if isinstance(known, Levels) else None
    volumes, means, covariances = scatter(corners, np.repeat(np.arange(count), vertices), shares)
    whole = Matter(volumes=volumes, means=means, covariances=covariances)
    matter = None if known is None else _matter_of(known.levels, whole, reduction, floor)
    if known is None or matter is None:
        levels, matter = _made(whole, places, kinds, reduction, floor)
    else:
        levels = known.levels
    return Sample(
        positions=levels[0].cores.points.reshape(-1, 3),
        volumes=np.repeat(matter.volumes / 4, 4),
        carrier=Levels(levels=levels),
        bounds=bounds_of(corners),
        notes=_notes(levels, cells),
    )


def _made(
    matter: Matter, places: Array, kinds: Array, reduction: Reduction, floor: float
) -> tuple[tuple[Level, ...], Matter]:
    """Levels of cores of matter whose Gaussians are at (N, 3) [m], of parts (N,), and what the engine's are of."""
    count = len(places)
    levels: list[Level] = []
    for number in _counts(count, reduction.cores_of(count), reduction.levels or 1):
        labels = cluster_apart(places, kinds, number)
        kinds = kinds[np.unique(labels, return_index=True)[1]]
        matter = matter.clustered(labels)
        cores = Cores(points=corners_of(matter, floor))
        if reduction.transfer == "frame":
            transfer: Transfer = OneFrame(labels=labels)
        else:
            transfer = LeastSquares.build(cores, places, labels)
        levels.insert(0, Level(cores=cores, transfer=transfer))
        places = matter.means
    return tuple(levels), matter


def _matter_of(levels: Sequence[Level], matter: Matter, reduction: Reduction, floor: float) -> Matter | None:
    """What the engine's cores of these levels are of; None where they are none that this reduction makes of it.

    That asks nothing about roundings: the corners of a cluster may be turned, its mean and covariance are what they
    are.
    """
    count = len(matter.volumes)
    numbers = _counts(count, reduction.cores_of(count), reduction.levels or 1)
    transfer = OneFrame if reduction.transfer == "frame" else LeastSquares
    if len(levels) != len(numbers) or not all(isinstance(level.transfer, transfer) for level in levels):
        return None
    size = float(np.ptp(matter.means, axis=0).max()) + floor
    for level, number in zip(reversed(levels), numbers):
        labels, cores = level.transfer.labels, level.cores
        fits = len(labels) == len(matter.volumes) and len(cores) <= number
        if not fits or not np.bincount(labels, minlength=len(cores)).all():
            return None
        matter = matter.clustered(labels)
        expected = Cores(points=corners_of(matter, floor))
        widths = np.sqrt(np.trace(expected.moments, axis1=1, axis2=2))
        near = (np.abs(cores.centres - expected.centres) <= _ROUNDING * size).all()
        alike = (np.abs(cores.moments - expected.moments) <= _ROUNDING * size * widths[:, None, None]).all()
        if not (near and alike):
            return None
    return matter


def _notes(levels: Sequence[Level], cells: int) -> tuple[str, ...]:
    """How many carry how many, what fell back, and whether they are enough for the cells that the body occupies."""
    chain = " carry ".join(f"{len(level.cores):,} cores" for level in levels)
    fallen = sum(len(level.transfer.fallen) for level in levels if isinstance(level.transfer, LeastSquares))
    fell = f", {fallen:,} neighbourhoods fell back on one core's frame" if fallen else ""
    found = [f"{chain} carry {len(levels[-1].transfer.labels):,} Gaussians{fell}"]
    corners = 4 * len(levels[0].cores)
    if corners < CORNERS_A_CELL * cells:
        found.append(
            f"{corners:,} corners of cores are few for {cells:,} cells of the grid: matter may be too soft, or break,"
            f" ask for some {CORNERS_A_CELL * cells // 4:,} cores"
        )
    return tuple(found)


def _counts(gaussians: int, cores: int, levels: int) -> list[int]:
    """Cores of each level, from the finest to the engine's; the numbers fall by the same factor each time."""
    share = (cores / gaussians) ** (1 / levels)
    return [*(max(cores, math.ceil(gaussians * share**level)) for level in range(1, levels)), cores]


def corners_of(matter: Matter, floor: float) -> Array:
    """Corners (C, 4, 3) [m] of this mean and covariance, no narrower than `floor` [m] along any principal axis."""
    values, axes = np.linalg.eigh(matter.covariances)
    deviations = np.maximum(np.sqrt(np.maximum(values, 0.0)), floor / 2)
    return matter.means[:, None] + np.einsum("vk,ck,cik->cvi", _CORNERS, deviations, axes)
