"""Where in a picture a subject is, by the light it holds back: means of Gaussians say nothing of how large they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import SplatRenderer

__all__ = ["SAFE", "Extent", "Sight", "extent_of", "outline", "seen_from"]

Array = NDArray[Any]

SAFE = 0.9
"""Share of a picture's width and of its height, in its middle, that a subject stays in."""
_SMALL = 0.8
"""Share of that middle below which a subject is small, in width and height alike."""
_TRIMMED = 1e-3
"""Share of all alpha that may be outside on each side: what flew off is not what there is to see."""
_WIDE = 2.0
"""How much more than the picture the map shows, to see what is outside of it."""
_SIDE = 320
"""Pixels along the longer side of the map."""
_SEEN = 0.02
"""Alpha from which on a pixel has a place."""
_ACROSS, _DOWN = (0, 1, 0, 1), (0, 0, 1, 1)
_MOST = 200_000
"""Gaussians of which an outline is made: every so manieth of more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """A rectangle in a picture, in half pictures from its middle: -1 and 1 are the picture's edges."""

    left: float
    right: float
    upper: float
    lower: float

    def joined(self, other: Extent) -> Extent:
        """The smallest that holds both."""
        return Extent(
            left=min(self.left, other.left),
            right=max(self.right, other.right),
            upper=min(self.upper, other.upper),
            lower=max(self.lower, other.lower),
        )

    @property
    def filled(self) -> float:
        """Its share of the picture's width or height, whichever is larger."""
        return max(self.right - self.left, self.lower - self.upper) / 2

    @property
    def reach(self) -> float:
        """How far from the middle of the picture it comes."""
        return max(-self.left, self.right, -self.upper, self.lower)

    @property
    def well(self) -> bool:
        """Whether what fills it is wholly in the picture, and large in it."""
        return self.reach <= SAFE and self.filled >= _SMALL * SAFE


def extent_of(alpha: Array, scale: float = 1.0) -> Extent | None:
    """What holds all of a picture's alpha (H, W) but a thousandth on each side; None where there is none.

    Parameters
    ----------
    alpha
        0..1.
    scale
        How much wider the picture is than the one that is asked about.
    """
    edges: list[float] = []
    for axis in (0, 1):
        along = np.cumsum(alpha.sum(axis=axis, dtype=np.float64))
        if not along[-1] > 0:
            return None
        first = np.searchsorted(along, _TRIMMED * along[-1], side="right")
        last = np.searchsorted(along, (1 - _TRIMMED) * along[-1])
        edges += [scale * (2 * first / len(along) - 1), scale * (2 * (last + 1) / len(along) - 1)]
    left, right, upper, lower = edges
    return Extent(left=left, right=right, upper=upper, lower=lower)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What a camera sees of something, and beyond the edges of its picture.

    Parameters
    ----------
    extent
        In the picture; None where nothing of it is anywhere near.
    places : (N, 3) [m]
        Corners of the pixels that it is seen in, as far away as it is seen there; without what `extent` is without.
    """

    extent: Extent | None
    places: Array


def seen_from(camera: Camera, splats: RenderInput, renderer: SplatRenderer) -> Sight:
    """What a camera sees of splats, with a field of view twice as wide as its own.

    The axis of view is taken to meet the picture in its middle.
    """
    longer = max(camera.width, camera.height)
    width, height = (max(2, round(_SIDE * side / longer)) for side in (camera.width, camera.height))
    wide = replace(
        camera,
        width=width,
        height=height,
        focal_x=camera.focal_x * width / camera.width / _WIDE,
        focal_y=camera.focal_y * height / camera.height / _WIDE,
        center_x=width / 2,
        center_y=height / 2,
    )
    picture = renderer.render(splats, wide)
    extent = extent_of(picture.alpha, _WIDE)
    if extent is None:
        return Sight(extent=None, places=np.empty((0, 3)))
    across = (np.arange(width) + 0.5) / width * 2 * _WIDE - _WIDE
    down = (np.arange(height) + 0.5) / height * 2 * _WIDE - _WIDE
    inside = (across > extent.left) & (across < extent.right) & ((down > extent.upper) & (down < extent.lower))[:, None]
    seen = inside & (picture.alpha >= _SEEN)
    row, column = np.nonzero(seen)
    # Where a silhouette ends decides, and there the corners of its pixels do.
    row, column = (np.concatenate([index + k for k in shifts]) for index, shifts in ((row, _DOWN), (column, _ACROSS)))
    depth = np.tile(picture.depth[seen].astype(np.float64), 4)
    slopes = np.stack(
        [(column - width / 2) / wide.focal_x, (row - height / 2) / wide.focal_y, np.ones(len(row))], axis=1
    )
    return Sight(extent=extent, places=camera.position + (depth[:, None] * slopes) @ camera.rotation)


def outline(splats: RenderInput) -> RenderInput:
    """As much of splats as decides where they are seen: not all of very many, and no colours."""
    some = splats.select(slice(None, None, -(-len(splats) // _MOST) or 1))
    return replace(some, harmonics=some.harmonics[:, :1], turns=None)
