"""Which end of a capture is down, where its file does not say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.scene.floaters import floating
from gasp_core.scene.objects import UpAxis
from gasp_core.scene.placement import robust_box, upright

__all__ = ["guess_up", "standing_part", "support_shares"]

Array = NDArray[Any]

_USUAL: UpAxis = "-y"
"""As 3DGS writes files."""
_ALL: tuple[UpAxis, ...] = ("-y", "+y", "+z", "-z")
"""What anybody does; nobody has x up."""
_FOOT = 0.04
"""Of the height, that stands on the ground."""
_WIDE = 0.35
"""Share of its outline from above that something has to stand on for that to say anything."""
_WIDER = 2.0
"""Times as wide as the usual end that another one has to be."""
_SEEN = 0.1
"""Opacity from which on a Gaussian counts."""


def standing_part(gaussians: Gaussians) -> Gaussians:
    """Those that are finite and do not float apart from the rest: what it can stand on."""
    finite = gaussians.select(np.isfinite(gaussians.means).all(axis=1))
    return finite.select(~floating(finite.means))


def guess_up(gaussians: Gaussians, said: UpAxis | None = None) -> tuple[UpAxis, bool]:
    """The axis of a splat that probably points up: things stand on their widest end.

    Parameters
    ----------
    gaussians
        Its `standing_part`, in the file's own frame; or, where `said` is given, as that axis has put
        them, +z up.
    said
        The axis that was taken to be up.

    Returns
    -------
    axis, sure
        The usual one, `said` or else "-y" as 3DGS writes files, unless another end is wide and twice as wide; and
        whether the end is wide at all.
    """
    usual: UpAxis = said or _USUAL
    others: list[UpAxis] = [axis for axis in _ALL if axis != usual]
    means = gaussians.means.astype(np.float64)
    means = means[gaussians.opacities >= _SEEN]
    shares = support_shares(means if said is None else means @ upright(said), [usual, *others])
    best = max(others, key=lambda axis: shares[axis])
    if shares[best] >= _WIDE and shares[best] > _WIDER * shares[usual]:
        return best, True
    return usual, shares[usual] >= _WIDE


def support_shares(means: Array, axes: Sequence[UpAxis]) -> dict[UpAxis, float]:
    """Of each axis that might be up, how much of the outline seen along it what is lowest then covers, 0..1.

    Parameters
    ----------
    means : (N, 3)
        Of Gaussians, in their file's own frame.
    axes
        That are looked at.
    """
    return {axis: _support(means @ upright(axis).T) if len(means) else 0.0 for axis in axes}


def _support(points: Array) -> float:
    lower, upper = robust_box(points)
    points = points[((points >= lower) & (points <= upper)).all(axis=1)]
    foot = points[points[:, 2] <= lower[2] + _FOOT * (upper[2] - lower[2])]
    whole = _hull_area(points[:, :2])
    return _hull_area(foot[:, :2]) / whole if whole > 0 else 0.0


def _hull_area(points: Array) -> float:
    # Slow to import.
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 3:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
