"""`Tracker`: the Gaussians of a first frame, in all that follow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.games import polar_rotations
from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.harmonics import turn_coefficients
from gasp_core.tracking.clouds import Affine, Cloud, laid_onto
from gasp_core.tracking.deformation_graph import DeformationGraph

__all__ = ["Tracked", "Tracker"]

Array = NDArray[Any]

_MOST = 6000
"""Gaussians of a frame that are looked at."""
_FEWEST = 100
_SEEN = 0.1
"""Opacity below which a Gaussian may be anywhere."""
_SMOOTHNESS = (10.0, 3.0, 1.0, 0.3, 0.3, 0.3)
"""Of the steps of a frame: stiff first, so that what is far goes as a whole."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """The Gaussians of the first frame in another one, and how well they are there.

    Parameters
    ----------
    gaussians
        Each moved, turned, and stretched along its axes; colours and opacities are those of the first frame.
    distance
        From what is tracked to the nearest of the frame and from the frame to the nearest that is tracked, root mean
        square of samples of both, over the diagonal of the frame. How far something has slid along a surface that looks
        the same there nobody can tell: that is not in it.
    spacing
        From one Gaussian of the frame's sample to the nearest other one, over the same: as far apart are two samples of
        one surface.
    unseen
        Share of the frame's sample with nothing that is tracked as near as the eleventh of its own neighbours.
    """

    gaussians: Gaussians
    distance: float
    spacing: float
    unseen: float


class Tracker:
    """Follows the Gaussians of a first frame through others, of which no row is known to be one of the first.

    A few nodes with affine maps (an embedded deformation, Sumner et al. 2007) are laid onto each frame in turn, from
    where they were in the one before: what moves must move by less than its own size from a frame to the next.

    Parameters
    ----------
    first
        N Gaussians, of which the opaque ones tell where they go.
    nodes
        How many.
    seed
        Of the choice which Gaussians are looked at.

    Raises
    ------
    SplatFormatError
        Where too few of them can be seen, or some are nowhere.
    """

    def __init__(self, first: Gaussians, *, nodes: int = 200, seed: int = 0) -> None:
        if not np.isfinite(first.means).all():
            raise SplatFormatError("the first frame has means that are not finite: leave these rows out")
        self._first, self._random = first, np.random.default_rng(seed)
        seen = _seen(first, "the first frame")
        self._graph = DeformationGraph.over(np.asarray(first.means, dtype=np.float64)[seen], nodes)
        self._looked_at = self._graph.of(self._some(len(seen)))
        self._pose = self._graph.rest
        self._everything = self._graph.with_points(np.asarray(first.means, dtype=np.float64))
        self._last = Affine.nothing()

    def follow(self, frame: Gaussians, name: str = "a frame") -> Tracked:
        """The next frame.

        Parameters
        ----------
        frame
            However many Gaussians.
        name
            For what is said of it.

        Raises
        ------
        SplatFormatError
            Where too few of them can be seen.
        """
        means = np.asarray(frame.means, dtype=np.float64)[_seen(frame, name)]
        cloud = Cloud.of(means[self._some(len(means))])
        # It goes on as it went, or it stands still.
        starts = (self._last, Affine.nothing())
        self._last = laid_onto(self._looked_at.carried(self._pose), cloud, starts)
        pose = self._pose.then(self._last)
        for smoothness in _SMOOTHNESS:
            pose = self._looked_at.fitted(pose, cloud, smoothness)
        self._pose = pose
        return self._measured(cloud)

    def _measured(self, cloud: Cloud) -> Tracked:
        from scipy.spatial import KDTree

        points = self._looked_at.carried(self._pose)
        tree: Any = KDTree(points)
        there, back = cloud.tree.query(points)[0], tree.query(cloud.points)[0]
        diagonal = float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
        return Tracked(
            gaussians=self._moved(),
            distance=float(np.sqrt(((there**2).mean() + (back**2).mean()) / 2)) / diagonal,
            spacing=cloud.spacing / diagonal,
            unseen=float((back > cloud.reach).mean()),
        )

    def _moved(self) -> Gaussians:
        gradients = self._everything.gradients(self._pose)
        turns, still = polar_rotations(gradients), rotation_matrices(self._first.quaternions)
        # Each keeps its axes, as frames want that are played one after the other; what shears them is left out.
        stretches = np.linalg.norm(gradients @ still, axis=1)
        return self._first.with_(
            means=self._everything.carried(self._pose),
            quaternions=rotation_quaternions(turns @ still),
            scales=self._first.scales * stretches,
            harmonics=turn_coefficients(self._first.harmonics, turns),
        )

    def _some(self, count: int) -> Array:
        return self._random.permutation(count)[:_MOST]


def _seen(gaussians: Gaussians, name: str) -> Array:
    """Rows of those that are not next to transparent."""
    rows = np.flatnonzero((gaussians.opacities > _SEEN) & np.isfinite(gaussians.means).all(axis=1))
    places = len(np.unique(gaussians.means[rows], axis=0))
    if places < _FEWEST:
        raise SplatFormatError(
            f"{name}: has Gaussians of an opacity above {_SEEN:g} at {places} places, and tracking wants {_FEWEST}"
        )
    return rows
