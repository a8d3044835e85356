"""The reduction `volume`: material points that fill the solid behind a splat, at the engine's own spacing.

Two along each side of a cell, as the engines' own scenes have them; those that the surface cuts have the part of their
volume that is inside, at its middle. Thin matter (`gasp_core.solid.Sheets`) is filled by its pieces: a tetrahedron a
piece, of its mass, mean and covariance, as cores are; a crumb is a point.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Shape
from gasp_core.errors import SceneError
from gasp_core.quantities import volume_told
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.clusters import scatter
from gasp_core.reduction.cores import Matter, corners_of
from gasp_core.reduction.lattice import PER_CELL, lattice_inside, refuse_too_many
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.reduction.transfer_operator import Sample, bounds_of
from gasp_core.scene.objects import Reduction
from gasp_core.scene.placed_solid import PlacedSolid

__all__ = ["POINTS_A_CELL", "Filling", "fill", "sample_volume"]

Array = NDArray[Any]

POINTS_A_CELL = PER_CELL**3
_SHEET = 0.75
"""Side, in cells, of the cubes whose pieces of a sheet are one."""
_CRUMB = 1 / 3
"""Of the area of a sheet that goes right across such a cube: a piece with less is of a rim, or lies on a surface."""
_BESIDE = 6
"""Points within a cell of it that a crumb has."""
_FAINT = 1e-3
"""Of a cell's volume: a piece of a sheet with less, near other matter, moves nothing. It would be thrown about by what
it lies on and stretched as nothing else is, and the farthest stretched point sets the step of all."""
_NEAR = 2.0
"""Cells: how far two points may be apart, along an axis, that share more than the rim of a kernel."""
_SHRED = PER_CELL**-3 / 4
"""Of a cell's volume, a quarter of a point: a crumb with less, so near the solid,"""
_HANGING = 3.0
"""in cells, as a turn of the solid is still relied on for what follows it, has no points. On 48 cells that is a
ten-thousandth of a skull's mass, the farthest stretched of all when it lands, and a thousandth of an angel's."""
_TWO_LAYERS = 1.5
"""Distances of points: a wall so thick is two layers wherever it lies on the lattice, and a thinner one may be one."""
_JITTER = 0.25
"""In distances of points, to either side."""
_ROUNDING = 1e-3
"""Distances of points by which one may be off and still be the same: distances in a solid are single precision, and a
detail is hundreds of steps of an iteration."""
_DOUBTFUL = 0.25
"""Of its volume: where it is less certain, a user should look at the body."""
_FOOT = 0.75
"""Distances of points below the surface at which a Gaussian outside looks for the matter that it follows: four are
around it there, above and below."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Filling:
    """Material points of a solid.

    Parameters
    ----------
    positions : (P, 3) [m]
    volumes : (P,) [m^3]
    sheet
        How many of them, the last ones, are of sheets.
    """

    positions: Array
    volumes: Array
    sheet: int


def fill(solid: PlacedSolid, spacing: float, *, jittered: bool = False, seed: int = 0) -> Filling:
    """Points in a solid, for an engine of this spacing [m].

    `jittered`: not on a lattice but up to a quarter of their distance off it; those that the surface cuts stay.
    """
    step = spacing / PER_CELL
    positions, shares = _lattice(solid, step)
    if jittered:
        shift = np.random.default_rng(seed).uniform(-_JITTER, _JITTER, positions.shape) * step
        positions = positions + shift * (shares == 1.0)[:, None]
    sheet_positions, sheet_volumes = _sheets(solid, spacing, positions)
    return Filling(
        positions=np.concatenate([positions, sheet_positions]),
        volumes=np.concatenate([shares * step**3, sheet_volumes]),
        sheet=len(sheet_positions),
    )


def sample_volume(
    block: Block,
    reduction: Reduction,
    solid: PlacedSolid,
    region: Shape | None,
    spacing: float,
    name: str,
    known: PointFrames | None = None,
) -> Sample:
    """Points that fill the solid behind a body.

    Parameters
    ----------
    block
        Its simplices.
    reduction
        Whether the points are jittered.
    solid
        In the world.
    region
        Only what is inside is simulated; None: all.
    spacing
        Of the engine [m].
    name
        Of the object, for messages.
    known
        Points that were made of such a body before, on whatever machine, and are to be these where they can be: each
        processor rounds in its own way.

    Raises
    ------
    SceneError
        Where there is nothing to fill, or far more than memory holds.
    """
    refuse_too_many(solid.volume, spacing / PER_CELL, name)
    filling = fill(solid, spacing, jittered=reduction.points == "jittered")
    positions, volumes = filling.positions, filling.volumes
    if region is not None:
        inside = region.signed_distance(positions) <= 0
        positions, volumes = positions[inside], volumes[inside]
    if not len(positions):
        where = " in its region" if region is not None and len(filling.positions) else ""
        raise SceneError(
            f'object "{name}": there is nothing to fill{where}: its Gaussians enclose no volume and are no sheets,'
            ' as faint or lone ones are; say reduction = { mode = "all" }'
        )
    step = spacing / PER_CELL
    thick = solid.thickened(_TWO_LAYERS * step)
    carrier = known
    if known is None or not _same(known, positions - block.centre, len(block.local), step):
        carrier = PointFrames.build(
            positions - block.centre,
            step,
            block.local.means.astype(np.float64),
            _feet(solid, block.local.means + block.centre, positions, step) - block.centre,
            functools.partial(_open_between, thick, positions, thick.distance_at(positions) < 0.5 * step, step),
        )
    assert carrier is not None
    return Sample(
        positions=carrier.points,
        volumes=volumes,
        carrier=carrier,
        bounds=bounds_of(carrier.points),
        notes=_notes(solid, filling, carrier, float(volumes.sum())),
    )


def _same(known: PointFrames, points: Array, gaussians: int, step: float) -> bool:
    """Whether points that are known are these (P, 3), but for roundings."""
    return (
        known.points.shape == points.shape
        and len(known.order) == gaussians
        and bool((np.abs(known.points - points) <= _ROUNDING * step).all())
    )


def _lattice(solid: PlacedSolid, step: float) -> tuple[Array, Array]:
    """Points (P, 3) of a lattice that are inside, and their shares (P,)."""
    nodes = solid.nodes_inside()
    if not len(nodes):
        return np.zeros((0, 3)), np.zeros(0)
    lower, upper = nodes.min(axis=0) - 2 * solid.spacing, nodes.max(axis=0) + 2 * solid.spacing
    positions, shares = lattice_inside(solid.filled.distance_at, lower, upper, step, solid.wall)
    uneven = max(_TWO_LAYERS * step - solid.wall, 0.0) / 3
    if uneven:
        # Points of one plane do not tell how it turns: those of a thin wall are not equally deep.
        deeper = np.random.default_rng(0).uniform(0.0, uneven, (len(positions), 1))
        positions -= deeper * solid.filled.gradient_at(positions)
    return positions, shares


def _sheets(solid: PlacedSolid, spacing: float, filled: Array) -> tuple[Array, Array]:
    """Points (P, 3) [m] that sheets are, and their volumes (P,) [m^3]: of each piece the corners of a tetrahedron; its
    middle alone where it is a crumb beside other matter, of which `filled` (P, 3) [m] is what is inside."""
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    sheets = solid.solid.sheets
    if not len(sheets.areas):
        return np.zeros((0, 3)), np.zeros(0)
    positions = solid.to_world(sheets.positions)
    # In the frame of the solid: wherever the object is put, the same pieces are one.
    cubes = np.floor(sheets.positions * (solid.scale / (_SHEET * spacing))).astype(np.int64)
    _, labels = np.unique(cubes, axis=0, return_inverse=True)
    weights = sheets.volumes * solid.scale**3
    volumes, means, covariances = scatter(positions, labels.reshape(-1), weights)
    thickness = sheets.thickness * solid.scale
    small = volumes < _CRUMB * thickness * (_SHEET * spacing) ** 2
    kept = np.flatnonzero(~_faint(volumes, means, filled, spacing, small))
    volumes, means, covariances, small = volumes[kept], means[kept], covariances[kept], small[kept]
    # Twice the standard deviation of a layer, at least, along every axis.
    corners = corners_of(Matter(volumes=volumes, means=means, covariances=covariances), thickness / np.sqrt(3.0))
    # Four points of a crumb cost as much as those of a leaf, and the farthest stretched of them sets the step of all.
    # One alone says nothing of how what follows it turns: that is for the matter around it to say.
    matter: Any = KDTree(np.concatenate([filled, corners[~small].reshape(-1, 3)]))
    crumbs = np.flatnonzero(small)
    beside = matter.query_ball_point(means[crumbs], spacing, return_length=True, workers=processors())
    crumbs = crumbs[beside >= _BESIDE]
    whole = np.setdiff1d(np.arange(len(volumes)), crumbs)
    return (
        np.concatenate([corners[whole].reshape(-1, 3), means[crumbs]]),
        np.concatenate([np.repeat(volumes[whole] / 4, 4), volumes[crumbs]]),
    )


def _faint(volumes: Array, means: Array, filled: Array, spacing: float, small: Array) -> Array:
    """Which pieces, of volumes (S,) [m^3] and means (S, 3) [m], are next to nothing beside other matter, (S,).

    More of those that are `small` (S,), crumbs, count as nothing beside what is `filled` (P, 3) [m].
    """
    from scipy.spatial import KDTree

    shreds = np.flatnonzero(small & (volumes < _SHRED * spacing**3)) if len(filled) else np.zeros(0, dtype=np.int64)
    found = np.zeros(len(volumes), dtype=bool)
    if len(shreds):
        body: Any = KDTree(filled)
        found[shreds] = body.query(means[shreds])[0] < _HANGING * spacing
    faint = (volumes < _FAINT * spacing**3) & ~found
    matter = np.concatenate([filled, means[~faint & ~found]])
    if len(matter):
        tree: Any = KDTree(matter)
        found[faint] = tree.query(means[faint])[0] < _NEAR * spacing
    return found


def _feet(solid: PlacedSolid, means: Array, positions: Array, step: float) -> Array:
    """Where in the body the matter is that each Gaussian (N, 3) follows, (N, 3) [m].

    One that is nearer to a point than to the solid follows what is there: it is of a sheet. The others, outside the
    solid, follow what is below the surface at their feet.
    """
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    distances = solid.distance_at(means)
    tree: Any = KDTree(positions)
    to_points = tree.query(means, workers=processors())[0]
    # In the middle of a wall that is not so thick.
    deep = min(_FOOT * step, solid.wall / 2)
    below = np.flatnonzero((distances > -deep) & (to_points > np.maximum(distances, 0.0)))
    feet = means.copy()
    # Twice: the gradient is that of the surface near its foot.
    for _ in range(2):
        slopes = solid.gradient_at(feet[below])
        deeper = solid.distance_at(feet[below]) + deep
        feet[below] -= deeper[:, None] * slopes
    return feet


def _open_between(
    solid: PlacedSolid, positions: Array, inside: Array, step: float, rows: Array, others: Array
) -> Array:
    """Whether there is air half way between the points of these rows (M,) and of those: a gap that was open at rest.

    Only between those that are `inside` (P,): around sheets there is air everywhere.
    """
    found = np.zeros(len(rows), dtype=bool)
    apart = np.linalg.norm(positions[rows] - positions[others], axis=1) > 0.5 * step
    both = np.flatnonzero(inside[rows] & inside[others] & apart)
    middles = (positions[rows[both]] + positions[others[both]]) / 2
    found[both] = solid.distance_at(middles) > 0.5 * step
    return found


def _notes(solid: PlacedSolid, filling: Filling, carrier: PointFrames, volume: float) -> tuple[str, ...]:
    """What stands for what, and how sure that is."""
    doubts = solid.solid.doubts
    thin = f", {filling.sheet:,} of them of thin matter" if filling.sheet else ""
    found = [
        f"{len(carrier.points):,} points fill {volume_told(volume)}{thin} and carry {len(carrier.order):,} Gaussians"
    ]
    off = doubts.volume_uncertainty / solid.solid.volume if solid.solid.volume else 0.0
    if off > _DOUBTFUL:
        found.append(f"its volume is uncertain by some {100 * off:.0f} %: look at its slices, gasp inspect --solid")
    far = int((carrier.weights[:, 0] == 0).sum())
    if far:
        found.append(
            f"{far:,} Gaussians far off its matter move with the nearest of it and do not turn; what is a thing of its"
            " own among them wants to be an object of its own"
        )
    return tuple(found)
