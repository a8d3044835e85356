"""What one sees of each Gaussian from outside, as renderers composite them.

A trained splat was compared with pictures, and with nothing else: what no picture shows lies anywhere. In captures the
Gaussians of a wall are scattered over a detail of depth, and light is half used up half a detail before the middle of
them all. There is the surface, where colours were fitted from many sides, and there meshes are taken from splats (by
median depth; Huang et al. 2024, 10.1145/3641519.3657428).
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid import kernels
from gasp_core.solid.surfels import Surfels
from gasp_core.stepping.threads import processors

__all__ = ["seen_areas", "was_trained"]

Array = NDArray[Any]

_VIEWS = [way for way in itertools.product((-1, 0, 1), repeat=3) if np.abs(way).sum() in (1, 3)]
"""Whence one looks: from the faces and the corners of a cube, from far away."""
_FAINTEST = 5
"""Percent of the Gaussians: a trained splat has at least so many"""
_FAINT = 0.4
"""of an opacity below this: training fades what it has no use for, and hardly ever makes all opaque."""


def was_trained(surfels: Surfels) -> bool:
    """Whether opacities are as training leaves them; made from a mesh, or sampled, a splat is as opaque all over."""
    return bool(np.percentile(surfels.opacities, _FAINTEST) < _FAINT)


def seen_areas(surfels: Surfels, pixel: float, from_below: bool) -> Array:
    """Area (N,) that one sees of each: twice the mean over views from all round, of which it faces half.

    Parameters
    ----------
    surfels
    pixel
        Side of the pictures' pixels, in the surfels' unit.
    from_below
        Whether one looks from below as well.
    """
    ways = [np.array(way, dtype=np.float64) for way in _VIEWS if from_below or way[2] >= 0]

    def shares(way: Array) -> Array:
        return _shares(surfels, way / np.linalg.norm(way), pixel)

    total = np.zeros(len(surfels))
    with ThreadPoolExecutor(processors()) as pool:
        for each in pool.map(shares, ways):
            total += each
    across = 2 * np.pi * np.sqrt(surfels.variances[:, 1] * surfels.variances[:, 2])
    return 2 * across * surfels.opacities * total / len(ways)


def _shares(surfels: Surfels, way: Array, pixel: float) -> Array:
    """Share (N,) of what each would show by itself that is seen from where the unit vector `way` (3,) points to."""
    right = np.cross(way, (1.0, 0.0, 0.0) if abs(way[0]) < 0.5 else (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    plane = np.stack([right, np.cross(way, right)])
    xx, xy, yy = (
        np.einsum("i,nij,j->n", first, surfels.covariances, second)
        for first, second in ((plane[0], plane[0]), (plane[0], plane[1]), (plane[1], plane[1]))
    )
    narrow = np.maximum(xx * yy - xy**2, 0.0)
    # A pixel is as wide as it is, and what is narrower covers less of it.
    xx, yy = xx + pixel**2 / 12, yy + pixel**2 / 12
    wide = xx * yy - xy**2
    places = surfels.means @ plane.T
    lower = places.min(axis=0)
    width, height = (np.ptp(places, axis=0) / pixel).astype(int) + 1
    return kernels.shares_seen(
        (places - lower) / pixel,
        np.stack([yy, -xy, xx], axis=1) * (pixel**2 / wide)[:, None],
        kernels.CUT * np.sqrt(np.stack([xx, yy], axis=1)) / pixel,
        surfels.opacities * np.sqrt(narrow / wide),
        np.argsort(-(surfels.means @ way), kind="stable"),
        np.ones((width, height)),
    )
