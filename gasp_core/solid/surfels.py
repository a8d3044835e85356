"""A splat as surfels: pieces of surface, each with an area and an optical depth, and the grid that suits them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.solid.grid import Grid, interpolated
from gasp_core.solid.morphology import highest_near
from gasp_core.solid.splatting import summed_gaussians

__all__ = [
    "LeftOut",
    "Surfels",
    "counted_once",
    "depth_of",
    "detail_of",
    "extent_of",
    "layers_of",
    "lowest_layer",
    "surfels_of",
]

Array = NDArray[Any]

OPAQUE = float(np.log(2.0))
"""Optical depth of what half of the light passes."""
_FAINT = 0.02
"""Opacity below which a Gaussian is nothing: a fiftieth is what 3DGS starts from before it prunes."""
_ENDS = (0.5, 99.5)
"""Percentiles of the centres between which the object's box is."""
_HAZE = 0.125
"""Of the object's size: what is wider is no surface of it."""
_FAR = 0.5
"""Of the object's size: what is so far off its box is no part of it."""
_MOST_OPAQUE = 0.995
"""Depths beyond are of no consequence, and one has to end somewhere."""
_CELLS = 36
"""Cells of the size of a detail, along the edge of a cube as large as the object's box. With 40 a noisy thin box is off
by 1.3 % rather than .5 %, and the finer the details, the more of the fuzz before a wall counts as wall."""
_FINEST, _COARSEST = 128, 32
"""The same along the longest side, at most and at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surfels:
    """Gaussians as pieces of surface.

    Parameters
    ----------
    means : (N, 3)
    covariances : (N, 3, 3)
    variances : (N, 3)
        Of the covariances along their principal axes, smallest first, > 0.
    depths : (N,)
        Optical depth through the middle, -ln(1 - opacity).
    """

    means: Array
    covariances: Array
    variances: Array
    depths: Array

    def __len__(self) -> int:
        return len(self.means)

    def select(self, rows: Array) -> Surfels:
        """Those of a mask or of indices."""
        return Surfels(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @property
    def areas(self) -> Array:
        """2 pi s_2 s_3 tau, (N,): what each stands for where no other overlaps it."""
        return 2 * np.pi * self.depths * np.sqrt(self.variances[:, 1] * self.variances[:, 2])

    @property
    def opacities(self) -> Array:
        """1 - exp(-tau), (N,)."""
        return -np.expm1(-self.depths)

    def peaks(self, width: float) -> Array:
        """Highest values (N,) of the densities of one when they are widened by `width`."""
        wide = np.linalg.det(self.covariances + width**2 * np.eye(3))
        return (2 * np.pi) ** -1.5 / np.sqrt(wide)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """How many Gaussians are no surfels, by reason.

    Parameters
    ----------
    faint, hazy, far
        Of an opacity below .02; wider than an eighth of the object; half its size off its box or farther.
    """

    faint: int
    hazy: int
    far: int


def surfels_of(gaussians: Gaussians) -> tuple[Surfels, LeftOut]:
    """The surfels among finite Gaussians, in their order."""
    scales = np.sort(gaussians.scales.astype(np.float64), axis=1)
    means = gaussians.means.astype(np.float64)
    seen = gaussians.opacities > _FAINT
    # Of a lone Gaussian nothing is wider than the whole, and of an invisible object nothing is left.
    lower, upper = np.percentile(means[seen] if seen.any() else means, _ENDS, axis=0)
    size = float((upper - lower).max())
    off = np.maximum(lower - means, means - upper).max(axis=1)
    far = seen & (off > _FAR * size) & (size > 0)
    hazy = seen & ~far & (scales[:, 2] > _HAZE * size) & (size > 0)
    rows = np.flatnonzero(seen & ~far & ~hazy)
    least = 1e-6 * max(size, float(scales[:, 2].max(initial=0.0)))
    variances = np.maximum(scales[rows], least) ** 2
    surfels = Surfels(
        means=means[rows],
        covariances=gaussians.select(rows).covariances() + least**2 * np.eye(3),
        variances=variances,
        depths=-np.log1p(-np.minimum(gaussians.opacities[rows].astype(np.float64), _MOST_OPAQUE)),
    )
    return surfels, LeftOut(faint=int((~seen).sum()), hazy=int(hazy.sum()), far=int(far.sum()))


def extent_of(surfels: Surfels) -> Array:
    """Of the box (3,) of all but the outermost two hundredth of the surfels at each side, > 0 somewhere."""
    extent = np.ptp(np.percentile(surfels.means, _ENDS, axis=0), axis=0)
    return extent if extent.any() else np.full(3, 4 * np.sqrt(surfels.variances.max()))


def detail_of(surfels: Surfels) -> float:
    """Size of the smallest thing that is told apart.

    It belongs to the capture and not to a grid: what is a wall, what is fuzz before it, and what one sees through must
    not change with the number of cells.
    """
    extent = extent_of(surfels)
    longest = float(extent.max())
    return float(np.clip(np.cbrt(extent.prod()) / _CELLS, longest / _FINEST, longest / _COARSEST))


def depth_of(surfels: Surfels, grid: Grid) -> Array:
    """Optical depth (X, Y, Z) of the surfels per spacing of a grid, across their faces."""
    width = grid.spacing / 2
    second, third = surfels.variances[:, 1], surfels.variances[:, 2]
    # What is smaller than a cell covers less than all of it.
    covered = np.sqrt(second * third / ((second + width**2) * (third + width**2)))
    return summed_gaussians(grid, surfels.means, surfels.covariances, (surfels.depths * covered)[None], width)[0]


def layers_of(surfels: Surfels, weights: Array, grid: Grid, width: float, around: int = 0) -> Array:
    """In how many layers (N,) surfels of `weights` (N,), their areas, lie at each, counted within `width` of it.

    With `around` as many as .7 of the most there are so many nodes off.
    """
    peaks = weights * surfels.peaks(width)
    density = summed_gaussians(grid, surfels.means, surfels.covariances, peaks[None], width)[0]
    if around:
        density = np.maximum(density, 0.7 * highest_near(density, around))
    return interpolated([density], grid.places(surfels.means))[:, 0] * np.sqrt(2 * np.pi) * width


def counted_once(surfels: Surfels, weights: Array, grid: Grid, width: float, detail: float) -> Array:
    """Areas (N,) whose sum is that of the surface, however many surfels overlap there.

    `weights` (N,) are the areas each would have alone. What is smoothed over `width` counts as one layer.
    """
    # At the rim of a leaf, and of the fuzz of a wall, there are few, and they are part of it all the same.
    layers = layers_of(surfels, weights, grid, width, around=round(2 * detail / grid.spacing))
    return weights / np.maximum(layers, 0.25)


def lowest_layer(surfels: Surfels, detail: float) -> float:
    """Height at which the object ends below: where, going down, the area in a layer falls to half of what it is.

    What is usual in a layer is the median over the lower third; what hangs or floats below is less.
    """
    from scipy import ndimage

    heights = surfels.means[:, 2]
    low = float(heights.min()) - 2 * detail
    counted = np.bincount(((heights - low) * 4 / detail).astype(int), surfels.areas)
    # A window of eight bins, two details, is centred on the lower edge of its fifth.
    area = ndimage.uniform_filter1d(np.pad(counted, (0, 8)), 8, mode="constant")
    used = np.flatnonzero(area > 0.02 * area.max())
    bound = 0.5 * float(np.median(area[used[: max(len(used) // 3, 1)]]))
    first = int(np.argmax(area >= bound))
    before = float(area[first - 1])
    share = (bound - before) / (float(area[first]) - before)
    return low + detail / 4 * (first - 1 + share)
