"""Gaussians -> `Solid`: what light tells, which way surfels face, and the body between them.

A splat is a noisy, often open shell. Light from all sides tells which places are surely air, which are surely dark, and
on which side of each surfel the air is; the indicator of the body is the field whose gradient is the surfels' normals
and that agrees with both (`gasp_core.solid.indicator`); its level is that of the surfels themselves.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.solid.creases import sharpened
from gasp_core.solid.distance import signed_distance
from gasp_core.solid.grid import Grid, interpolated
from gasp_core.solid.indicator import indicator
from gasp_core.solid.light import Light, light_through
from gasp_core.solid.morphology import dilated, highest_near, large_parts
from gasp_core.solid.options import SolidOptions
from gasp_core.solid.sheets import sheets_outside
from gasp_core.solid.sight import seen_areas, was_trained
from gasp_core.solid.solid import Doubts, Sheets, Solid
from gasp_core.solid.splatting import summed_gaussians
from gasp_core.solid.surfels import (
    OPAQUE,
    LeftOut,
    Surfels,
    counted_once,
    depth_of,
    detail_of,
    extent_of,
    layers_of,
    lowest_layer,
    surfels_of,
)

__all__ = ["solid_of"]

Array = NDArray[Any]

_MARGIN = 4
"""Layers of nodes around the Gaussians."""
_DARK = 0.03
"""Share of the sky below which a place is dark: one of 98 directions may find a pinhole."""
_WITHIN = 2
"""Details of darkness on all sides that make a place surely dark."""
_FREE_LINES = (0.02, 0.06)
"""Share of free lines at which a place begins to be air and at which it surely is: one line of 49, and three."""
_AIR, _OPEN_AIR, _INSIDE = 0.3, 0.03, 0.05
"""Weights in the indicator, per detail squared, of free lines, of much sky, and of darkness. The first reaches 1.8
details far. The others are weak: where a hole lets light in, the surface around it has the say."""
_SOFT = 0.2
"""Between the share of the sky of `SolidOptions.holes` and the one at which a place is taken for air wholly."""
_KERNEL = 0.5
"""Standard deviation in details by which surfels are smoothed."""
_OUTWARD = (0.75, 1.5, 2.5)
"""Steps in details, towards the light, at which a surfel in the fuzz of a wall looks again. With 2.25 at most a thin
box of noisy surfels is 1.3 % too large, with 3 statues end below what one sees of them."""
_FACING = {"seen": 0.1, "middle": 0.02}
"""Share of the sky seen from before a surfel that makes it a surface, where surfels count by what one sees of them and
where all do alike: in front of a wall it is half, and within a mug as deep as wide .1. In walls training leaves what
nobody sees, and .1 tells most of it: with .02 the volume of a skull is 8 % smaller, with .2 mugs are filled."""
_BEHIND = 1.5
"""Details behind a surfel at which one looks for light: it is a sheet where there is some, and no surface of a body."""
_LIT_BEHIND = (0.1, 0.3)
"""Share of the sky that is seen there, from which on it begins to be a sheet, and is one."""
_FULL = 0.7
"""Of the indicator, which is one inside: behind the surface of a body it comes up to this within two details."""
_FRINGE = 0.2
"""Of the same: surfels farther out are fuzz. With them a noisy thin box is 1.9 % too large, rather than .5."""
_PIXEL = 0.5
"""Side in details of the pixels in which one looks what is seen of a surfel."""
_SEEN_LEAST = 0.05
"""Of one layer: what is seen within a detail of a surfel, at least, if it is to count as a surface in full."""
_SURELY = 0.3
"""How far a surfel is a surface: with so much it lies on one."""
_SMALL = 0.005
"""Of the largest part: what is smaller is no part of the body."""
_FLOATING = 0.02
"""The same of opaque cells, before there is a body."""
_LID = 0.5
"""Share of the dark cells in a low layer that only light from below comes to, from which on the underside is open; and
how much of what is dark from above they must be beneath."""
_FOOT = 0.1
_COARSER = (1.5, 2.0)
"""By how much the resolutions are coarser that tell how far the volume may be off. One alone may agree by chance: of a
thin guitar that by 1.5 does to .3 %, that by 2 has lost it."""
_SAFETY = 1.25
"""Times what the grids tell, where there are three of them (Roache 1994, 10.1115/1.2910291)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Evidence:
    """What is known before there is a body, on a grid whose spacing is the detail.

    `rows` says which of the object's the surfels are; `amplified` is the optical depth that light was weakened by;
    `ground` the height at which the body is cut off, None where its underside is as the surfels have it.
    """

    surfels: Surfels
    rows: Array
    grid: Grid
    depth: Array
    amplified: Array
    light: Light
    ground: float | None


def solid_of(gaussians: Gaussians, options: SolidOptions | None = None) -> Solid:
    """The body that finite Gaussians are the surface of.

    Parameters
    ----------
    gaussians
        Of one object, +z up, in any unit; see `gasp_core.solid` for what is taken for what.
    options
        How it is told from the air.

    Returns
    -------
    Solid
        In the frame and unit of the Gaussians; without any volume where they enclose none. How far its volume may be
        off, two coarser solids tell, with details and cells 1.5 and 2 times as large, if errors shrink in proportion.
    """
    options = options or SolidOptions()
    surfels, left_out = surfels_of(gaussians)
    if not len(surfels):
        return _nothing(len(gaussians), left_out)
    if options.surface == "auto":
        options = dataclasses.replace(options, surface="seen" if was_trained(surfels) else "middle")
    detail = detail_of(surfels)
    spacing = detail if options.cells is None else float(extent_of(surfels).max()) / options.cells
    known = _evidence(surfels, detail, spacing, options)
    areas = surfels.areas
    if options.surface == "seen":
        areas = seen_areas(surfels, _PIXEL * detail, from_below=known.ground is None)
        # What is seen from few sides, in a hollow, is a surface as well.
        areas = areas / np.maximum(layers_of(surfels, areas, known.grid, detail), _SEEN_LEAST)
    solid = _built(known, areas, spacing, options)
    likewise = dataclasses.replace(options, underside="open" if known.ground is None else "closed")
    off = 0.0
    if options.wall is not None:
        solid = solid.hollowed(options.wall)
    for coarser in _COARSER:
        wider = coarser * max(detail, spacing)
        coarse = _built(_evidence(surfels, coarser * detail, wider, likewise), areas, wider, likewise)
        if options.wall is not None:
            coarse = coarse.hollowed(options.wall)
        # Richardson: an error that shrinks with the resolution is what the two differ by over the ratio less one.
        off = max(off, _SAFETY * abs(coarse.volume - solid.volume) / (coarser - 1))
    doubts = dataclasses.replace(
        solid.doubts,
        volume_uncertainty=off,
        gaussians=len(gaussians),
        faint=left_out.faint,
        hazy=left_out.hazy,
        far=left_out.far,
        floating=len(surfels) - len(known.rows),
    )
    return dataclasses.replace(solid, doubts=doubts)


def _nothing(gaussians: int, left_out: LeftOut) -> Solid:
    grid = Grid(origin=np.zeros(3), spacing=1.0, shape=(2, 2, 2))
    return Solid(
        grid=grid,
        distance=np.full(grid.shape, 4.0, dtype=np.float32),
        detail=1.0,
        sheets=Sheets.none(),
        doubts=Doubts(gaussians=gaussians, faint=left_out.faint, hazy=left_out.hazy, far=left_out.far),
    )


def _built(known: _Evidence, areas: Array, spacing: float, options: SolidOptions) -> Solid:
    """The solid at one size of details; `areas` (N,) of all surfels are what they count for."""
    normals, shares = _oriented(known, _FACING[options.surface])
    grid = _body_grid(known, spacing)
    inside, undecided = _body(known, grid, normals, shares, areas[known.rows], options)
    if known.ground is not None:
        grid = grid.above(-_MARGIN)
        inside = np.concatenate([np.repeat(inside[:, :, :1], _MARGIN, axis=2), inside], axis=2)
        inside = np.minimum(inside, grid.heights() - known.ground)
    distance = signed_distance(inside, spacing)
    solid = Solid(
        grid=grid,
        distance=distance.astype(np.float32),
        detail=known.grid.spacing,
        sheets=Sheets.none(),
        doubts=Doubts(undecided=undecided, underside_closed=known.ground is not None),
    )
    sheets = sheets_outside(solid, known.surfels, known.depth, known.grid)
    if known.ground is not None:
        sheets = sheets.above(known.ground)
    return dataclasses.replace(solid, sheets=sheets)


def _evidence(surfels: Surfels, detail: float, spacing: float, options: SolidOptions) -> _Evidence:
    """Light, and whether the underside is open."""
    ground = lowest_layer(surfels, detail)
    margin = _MARGIN * max(detail, spacing)
    lower, upper = surfels.means.min(axis=0) - margin, surfels.means.max(axis=0) + margin
    grid = Grid.around(lower, upper, detail, ground)
    depth = depth_of(surfels, grid)
    together = large_parts(depth > OPAQUE, _FLOATING)
    near = dilated(together, 2)
    rows = np.flatnonzero(near[tuple(np.rint(grid.places(surfels.means)).astype(int).T)])
    if len(rows):
        surfels, depth = surfels.select(rows), np.where(near, depth, 0.0)
    else:
        rows = np.arange(len(surfels))
    row = round((ground + detail / 2 - grid.origin[2]) / detail)
    amplified = options.opacity_gain * depth
    above = amplified[:, :, row:]
    from_above = light_through(above, ground=True)
    closed = options.underside == "closed"
    if options.underside == "auto":
        # What hangs or floats below the ground must not shade what is above it.
        closed = _opens_below(light_through(above, ground=False), from_above, above)
    light = from_above.over_ground(row) if closed else light_through(amplified, ground=False)
    return _Evidence(
        surfels=surfels,
        rows=rows,
        grid=grid,
        depth=depth,
        amplified=amplified,
        light=light,
        ground=ground if closed else None,
    )


def _opens_below(all_round: Light, from_above: Light, amplified: Array) -> bool:
    """Whether what is dark from above is lit from all round, in one of the lowest layers."""
    dark = (from_above.share < _DARK) & (amplified < 0.3)
    opened = dark & (all_round.share > 0.1)
    beneath = max(int((from_above.share < _DARK).any(axis=2).sum()), 1)
    for layer in range(min(4, dark.shape[2])):
        area = int(opened[:, :, layer].sum())
        if area > _FOOT * beneath and area > _LID * int(dark[:, :, layer].sum()):
            return True
    return False


def _oriented(known: _Evidence, least_sky: float) -> tuple[Array, Array]:
    """Outward unit normals (N, 3) of the surfels, and how far (N,) they are surfaces, 0..1; `least_sky`: `_FACING`."""
    surfels, spacing = known.surfels, known.grid.spacing
    places = known.grid.places(surfels.means)
    flow = interpolated([*known.light.flow], places)
    for step in _OUTWARD:
        onward = interpolated([*known.light.flow], places + step * _unit(flow))
        brighter = np.einsum("ni,ni->n", onward, onward) > np.einsum("ni,ni->n", flow, flow)
        flow = np.where(brighter[:, None], onward, flow)
    # Flat ones face along their thin axis, round ones the light.
    rounder = 0.1 * surfels.variances[:, 1] + (0.02 * spacing) ** 2
    normals = _unit(np.linalg.solve(surfels.covariances + rounder[:, None, None] * np.eye(3), flow[:, :, None])[..., 0])
    before = np.max([interpolated([known.light.share], places + step * normals)[:, 0] for step in _OUTWARD], axis=0)
    behind = interpolated([known.light.share], places - _BEHIND * normals)[:, 0]
    facing = np.minimum(before / least_sky, 1.0) ** 4
    return normals, facing * (1 - _rising(behind, *_LIT_BEHIND))


def _body_grid(known: _Evidence, spacing: float) -> Grid:
    """Nodes for the body: those of the light where they are as far apart, and above the ground only."""
    grid = known.grid
    level = grid.origin[2] - grid.spacing / 2 if known.ground is None else known.ground
    if spacing != grid.spacing:
        upper = grid.origin + grid.spacing * (np.array(grid.shape) - 1)
        grid = Grid.around(grid.origin, upper, spacing, level)
    row = 0 if known.ground is None else round((level + spacing / 2 - grid.origin[2]) / spacing)
    return grid.above(row)


def _body(
    known: _Evidence, grid: Grid, normals: Array, shares: Array, areas: Array, options: SolidOptions
) -> tuple[Array, float]:
    """A field (X, Y, Z) above zero inside, and which share of what is inside nothing has decided."""
    detail, spacing = known.grid.spacing, grid.spacing
    share, lines, amplified = (
        known.grid.resampled(field, grid) for field in (known.light.share, known.light.lines, known.amplified)
    )
    brightest = known.grid.resampled(highest_near(known.light.share, _WITHIN), grid)
    weight = (spacing / detail) ** 2
    holes = max(options.holes, 0.5) if options.interior == "filled" else options.holes
    much_sky = _rising(share, holes, holes + _SOFT)
    air = weight * (_AIR * _rising(lines, *_FREE_LINES) + _OPEN_AIR * much_sky) * np.exp(-amplified)
    dark = weight * _INSIDE * np.clip(1 - brightest / _DARK, 0.0, 1.0)
    rows = np.flatnonzero(grid.places(known.surfels.means)[:, 2] > -0.5)
    surfels, facing, shares = known.surfels.select(rows), normals[rows], shares[rows]
    weights = shares * areas[rows]
    width = _KERNEL * max(detail, 0.7 * spacing)
    peaks = counted_once(surfels, weights, grid, width, detail) * surfels.peaks(width) * spacing
    field = summed_gaussians(grid, surfels.means, surfels.covariances, peaks * facing.T, width)
    chi = indicator(field, air, dark)
    own, behind = interpolated([chi, highest_near(chi, round(2 * detail / spacing))], grid.places(surfels.means)).T
    # What has no body behind it says nothing of where the surface of one is.
    telling = (behind > _FULL) & (own > _FRINGE) & (weights > 0)
    level = float(np.average(own[telling], weights=weights[telling])) if telling.any() else 0.5
    inside = (chi - level) * np.sqrt(2 * np.pi) * width
    # Where light comes from all sides alike a surfel faces nowhere.
    surface = telling & (shares > _SURELY) & facing.any(axis=1)
    inside = sharpened(inside, grid, surfels.means[surface], facing[surface], detail)
    small = (inside > 0) & ~large_parts(inside > 0, _SMALL)
    inside[small] = -spacing
    body = inside > 0
    decided = (dark > 0) | (air > 0) | (known.grid.resampled(highest_near(known.depth, 2), grid) > OPAQUE)
    return inside, float((body & ~decided).sum() / max(body.sum(), 1))


def _rising(values: Array, low: float, high: float) -> Array:
    """0 up to `low`, 1 from `high` on, smooth between."""
    t = np.clip((values - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)
