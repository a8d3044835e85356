"""Matter that has flowed apart, as grains: the Gaussians of its surface do not cover what comes out from below it.

Sand, water and snow forget where their surface was. What a splat has are Gaussians of that surface alone; stretched
as far as they may be, they are rags with holes between them. The points know where matter is, inside too. Where points
have parted from those they lay beside, each becomes one or several round Gaussians of the colour of the Gaussian
nearest to it, as visible as the matter has flowed; the Gaussians that follow these points go as the grains come.
Nothing is made of matter that has kept its shape: frame 0 is the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians, rotation_matrices
from gasp_core.harmonics import basis
from gasp_core.reduction.point_frames import PointFrames

__all__ = ["Flow", "FlowedMatter", "Grains", "colours_from_outside", "grains_of"]

Array = NDArray[Any]

_WHOLE, _FLOWED = 1.15, 1.6
"""Times as far from its neighbours as at rest, root mean square, up to which a point's matter keeps its surface, and
from which it has none left: Gaussians may be stretched to twice their length, and leave holes before that.
"""
_WIDTH = 0.6
"""Standard deviation of a grain in distances of grains: the sum of an even lattice of such Gaussians is within half a
per cent of the same everywhere, so that no pitch shows.
"""
_SCATTER = 0.45
"""Standard deviation of the places of a point's several grains, in distances of points: those of neighbours mix, and no
point shows as a lump.
"""
_SCATTERS = 4096
"""Points after which these places come again: nobody sees it, and a file that lists them compresses to nothing."""
_OPACITY = 0.95
"""Of a grain of matter that has flowed: two of them hide what is behind."""
_AROUND = 16
"""Gaussians whose colour a point's grains have: one alone may be any of those that make up a colour together."""
_SEEN = 0.5
"""Mean opacity of these from which on a grain hides what is behind: haze stays haze."""
_BESIDE = 4
"""Points that one has beside it at the same distance in a film one point thick; in a body there are six."""
_APART, _WIDER = (1.0, 2.0, 4.0), (1.0, 2.0, 1.0)
"""Distances of points to the last of these, and how much wider grains are then than at rest: a film that is thinner
than its points are apart has no holes yet, but drops that fly by themselves stay drops.
"""
_CELL = 2.0
"""Distances of points that a cell of matter is long: eight points fill it."""
_FULL = 4
"""Points from which on a cell is taken for full of matter."""
_HEMISPHERE = np.repeat([1.0, 1 / 2, 0.0, -1 / 8, 0.0], [1, 3, 5, 7, 9])
"""Mean of a harmonic over all directions within 90 degrees of n, over its value at n, by its degree: the integral of
the Legendre polynomial from 0 to 1 (Funk, Hecke).
"""
_CONSTANT = float(basis(np.array([[0.0, 0.0, 1.0]]), 0)[0, 0])


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowedMatter:
    """What of a body has flowed, in a frame.

    Parameters
    ----------
    left : (N,)
        Of each Gaussian, how much of its opacity it keeps, 0..1.
    means : (G, 3) [m]
        Of the grains, about where their points are.
    opacities : (G,)
        Of the grains.
    colours : (G, 3)
        Their constant coefficients in the 3DGS basis.
    sources : (G,)
        Of each grain, the Gaussian whose colour it has.
    scales : (G,) [m]
        Their standard deviations.
    """

    left: Array
    means: Array
    opacities: Array
    colours: Array
    sources: Array
    scales: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """How far the points of a body have flowed, in a frame.

    Parameters
    ----------
    share : (P,)
        Of the matter of each, 0..1.
    chosen : (C,)
        The points whose grains are seen.
    wider : (C,)
        How much wider these are than at rest.
    """

    share: Array
    chosen: Array
    wider: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Grains:
    """What the points of a body may come apart into.

    Parameters
    ----------
    carrier
        The points, and the Gaussians they carry.
    apart : (P,) [m]
        How far each is from its neighbours at rest, root mean square.
    offsets : (P, M, 3) float32 [m]
        Of its grains from the point.
    colours : (P, 3) float32
        Constant coefficients.
    opacities : (P,) float32
        Of grains of matter that has flowed.
    scale
        Standard deviation of a grain where points are as close as at rest [m].
    """

    carrier: PointFrames
    apart: Array
    offsets: Array
    colours: Array
    opacities: Array
    scale: float

    @property
    def most(self) -> int:
        """How many there are when all has flowed."""
        return self.offsets.shape[0] * self.offsets.shape[1]

    def flow(self, positions: Array) -> Flow:
        """How far it has flowed, the points being at `positions` (P, 3) [m]."""
        ratio = _apart(positions, self.carrier.neighbours) / self.apart
        share = np.clip((ratio - _WHOLE) / (_FLOWED - _WHOLE), 0.0, 1.0)
        share = share * share * (3 - 2 * share)
        chosen = np.flatnonzero(share)
        if len(chosen):
            chosen = chosen[~buried(positions, _CELL * self.carrier.spacing)[chosen]]
        return Flow(share=share, chosen=chosen, wider=_widening(positions, chosen, self.carrier.spacing))

    def at(self, positions: Array) -> FlowedMatter:
        """What has flowed, the points being at `positions` (P, 3) [m]."""
        carrier, flow = self.carrier, self.flow(positions)
        share, chosen, wider = flow.share, flow.chosen, flow.wider
        left = np.ones(len(carrier.order))
        left[carrier.order] = 1 - share[carrier.labels].max(axis=1)
        count = self.offsets.shape[1]
        return FlowedMatter(
            left=left,
            means=(positions[chosen, None] + wider[:, None, None] * self.offsets[chosen]).reshape(-1, 3),
            opacities=np.repeat(self.opacities[chosen] * share[chosen], count),
            colours=np.repeat(self.colours[chosen], count, axis=0),
            sources=np.repeat(carrier.standing_for[chosen], count),
            scales=self.scale * np.repeat(wider, count),
        )


def grains_of(carrier: PointFrames, gaussians: Gaussians, count: int) -> Grains:
    """What the points of a body may come apart into.

    Parameters
    ----------
    carrier
        The points, and the Gaussians they carry.
    gaussians
        Those, at rest, in the carrier's frame.
    count
        Of grains that a point comes apart into; one is where the point is.
    """
    points = carrier.points
    follows = np.empty_like(carrier.labels)
    follows[carrier.order] = carrier.labels
    colours, opacities = _seen_around(points, gaussians, colours_from_outside(gaussians, points[follows].mean(axis=1)))
    shape = (len(points), count, 3)
    scatter = np.random.default_rng(0).normal(scale=_SCATTER * carrier.spacing, size=(_SCATTERS, count, 3))
    return Grains(
        carrier=carrier,
        apart=np.maximum(_apart(points, carrier.neighbours), 1e-3 * carrier.spacing),
        offsets=(scatter[np.arange(len(points)) % _SCATTERS] if count > 1 else np.zeros(shape)).astype(np.float32),
        colours=colours.astype(np.float32),
        opacities=opacities.astype(np.float32),
        scale=_WIDTH * carrier.spacing / count ** (1 / 3),
    )


def _seen_around(points: Array, gaussians: Gaussians, colours: Array) -> tuple[Array, Array]:
    """Colours (P, 3) and opacities (P,) of the grains of points, from the Gaussians around each.

    The more is seen of a Gaussian, the more it counts: by its opacity, squared, since what lies over it and under it is
    as opaque as itself. Colours are those of the screen, which shows nothing darker than black.
    """
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    tree: Any = KDTree(gaussians.means)
    found: Array = tree.query(points, min(_AROUND, len(gaussians)), workers=processors())[1]
    found = found.reshape(len(points), -1)
    opacities = gaussians.opacities.astype(np.float64)
    weights = np.maximum(opacities[found] ** 2, 1e-9)
    shown = np.clip(0.5 + _CONSTANT * colours, 0.0, 1.0)[found]
    mean = np.einsum("pk,pkc->pc", weights, shown) / weights.sum(axis=1, keepdims=True)
    seen = np.minimum(opacities[found].mean(axis=1) / _SEEN, 1.0)
    return (mean - 0.5) / _CONSTANT, _OPACITY * seen


def colours_from_outside(gaussians: Gaussians, inside: Array) -> Array:
    """Constant coefficients of the colour that each Gaussian shows on average to those who look at it from outside.

    From inside nobody has looked while it was trained, and what its harmonics say there is chance.

    Parameters
    ----------
    gaussians
        N of them; the normal of each is its shortest axis.
    inside : (N, 3)
        A place on the inner side of each.

    Returns
    -------
    (N, 3), in the 3DGS basis.
    """
    axes = rotation_matrices(gaussians.quaternions)
    normals = np.take_along_axis(axes, gaussians.scales.argmin(axis=1)[:, None, None], axis=2)[:, :, 0]
    outward = ((inside - gaussians.means) * normals).sum(axis=1) < 0
    # Colours are told by the direction from the eye to the Gaussian: from outside, inwards.
    normals = np.where(outward[:, None], -normals, normals)
    degree = gaussians.sh_degree
    shown = basis(normals, degree) * _HEMISPHERE[: (degree + 1) ** 2]
    return np.einsum("nk,nkc->nc", shown, gaussians.harmonics.astype(np.float64)) / _CONSTANT


def buried(positions: Array, spacing: float) -> Array:
    """Points that nobody sees: their cell and the six around it are full of matter.

    A ray that comes to them has gone through a cell of it, two layers of grains, which leave a fiftieth of its light.

    Parameters
    ----------
    positions : (P, 3) [m]
        Finite.
    spacing
        Of the cells [m].

    Returns
    -------
    (P,) bool
    """
    cells = np.floor((positions - positions.min(axis=0)) / spacing).astype(np.int64) + 1
    strides = np.cumprod([1, *(cells.max(axis=0)[:2] + 2)])
    keys, of_point, counts = np.unique(cells @ strides, return_inverse=True, return_counts=True)
    full = counts >= _FULL
    deep = full.copy()
    for stride in (*strides, *-strides):
        beside = np.minimum(np.searchsorted(keys, keys + stride), len(keys) - 1)
        deep &= (keys[beside] == keys + stride) & full[beside]
    return deep[of_point]


def _widening(positions: Array, chosen: Array, spacing: float) -> Array:
    """How much wider the grains of the chosen points (C,) are than at rest, (C,)."""
    from scipy.spatial import KDTree

    from gasp_core.stepping.threads import processors

    if len(positions) <= _BESIDE or not len(chosen):
        return np.ones(len(chosen))
    tree: Any = KDTree(positions)
    # The first is the point itself.
    distances = tree.query(positions[chosen], [_BESIDE + 1], workers=processors())[0][:, 0]
    return np.interp(distances / spacing, _APART, _WIDER)


def _apart(positions: Array, neighbours: Array) -> Array:
    """Root mean square of each point's distances from its neighbours; those that are itself do not count."""
    squared = np.zeros(len(positions))
    count = np.zeros(len(positions))
    rows = np.arange(len(positions))
    # One neighbour after the other: half a million points have twelve each.
    for column in neighbours.T:
        squared += ((positions[column] - positions) ** 2).sum(axis=1)
        count += column != rows
    return np.sqrt(squared / np.maximum(count, 1))
