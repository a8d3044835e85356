"""RenderInput as a renderer reads them: checked, contiguous, of the precision it computes in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gasp_core.errors import RenderingError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera

__all__ = ["FARTHEST", "Inputs", "checked_inputs", "checked_occluders"]

Array = NDArray[Any]

FARTHEST = 1e30
"""Gaussians deeper than so many units, or so many pixels beside the picture, are not drawn: float32 ends near there."""


class Inputs(NamedTuple):
    """Arrays of N Gaussians; what is not given has no rows.

    Means and covariances are float64: far from the origin, and in the covariance of a needle, float32 has lost what is
    to be seen.
    """

    means: Array
    quaternions: Array
    scales: Array
    covariances: Array
    opacities: Array
    harmonics: Array
    turns: Array


def checked_inputs(splats: RenderInput, *, narrow: DTypeLike = np.float32) -> Inputs:
    """The arrays of splats.

    Parameters
    ----------
    splats
    narrow
        Precision of all but means and covariances.

    Raises
    ------
    RenderingError
        Where a number is not finite or beyond the range of float32, naming the array and the first such row.
    """
    return Inputs(
        means=_checked("means", splats.means, np.float64, (3,)),
        quaternions=_checked("quaternions", splats.quaternions, narrow, (4,), prepare=_bounded),
        scales=_checked("scales", splats.scales, narrow, (3,)),
        covariances=_checked("covariances", splats.covariances, np.float64, (6,)),
        opacities=_checked("opacities", splats.opacities, narrow, ()),
        harmonics=_checked("harmonics", splats.harmonics, narrow, splats.harmonics.shape[1:]),
        turns=_checked("turns", splats.turns, narrow, (3, 3)),
    )


def checked_occluders(occluders: Array | None, camera: Camera, dtype: DTypeLike = np.float32) -> Array:
    """Depths of occluders (H, W), or no rows where there are none.

    Raises
    ------
    RenderingError
        Where they are not a picture's size, or NaN.
    """
    if occluders is None:
        return _readable(np.empty((0, 0)), dtype)
    found = np.shape(occluders)
    if found != (camera.height, camera.width):
        raise RenderingError(f"occluders have shape {found}, expected the picture's ({camera.height}, {camera.width})")
    depths = _readable(occluders, dtype)
    if np.isnan(depths).any():
        row, column = np.argwhere(np.isnan(depths))[0]
        raise RenderingError(
            f"occluders are NaN at row {row}, column {column}: give inf where nothing stands in the way"
        )
    return depths


def _readable(values: Array, dtype: DTypeLike) -> Array:
    """Values as a contiguous read-only array, copied only where they are something else.

    Read-only always: numba would compile a kernel once more for each mixture of arrays that may be written and may not.
    """
    with np.errstate(over="ignore"):
        view = np.require(values, dtype, ["C", "A", "E"]).view()
    view.flags.writeable = False
    return view


def _checked(
    name: str,
    values: Array | None,
    dtype: DTypeLike,
    shape: tuple[int, ...],
    *,
    prepare: Callable[[Array], Array] | None = None,
) -> Array:
    if values is None:
        return _readable(np.empty((0, *shape)), dtype)
    if values.dtype.kind not in "fiu":
        raise RenderingError(f"RenderInput.{name} holds {values.dtype}, not real numbers: convert it to float32")
    array = _readable(values if prepare is None else prepare(values), dtype)
    # Squares of what a float32 holds stay finite in float64; beyond that nothing is promised.
    usable = np.abs(array) <= np.finfo(np.float32).max if array.dtype == np.float64 else np.isfinite(array)
    if not usable.all():
        bad = np.flatnonzero(~np.asarray(usable).reshape(len(array), -1).all(axis=1))
        row = bad[0]
        raise RenderingError(
            f"RenderInput.{name} is not finite, or too large for float32, in row {row} ({values[row].tolist()!s:.80}),"
            f" one of {len(bad):,}: leave those Gaussians out, or look for where they come from"
        )
    return array


def _bounded(quaternions: Array) -> Array:
    """Quaternions of any length, in float64 1e-200 too, as ones that float32 can hold."""
    if quaternions.dtype == np.float32:
        return quaternions
    largest = np.max(np.abs(quaternions), axis=1, keepdims=True, initial=0)
    # Infinite ones stay so, and are refused.
    return quaternions / np.where((largest > 0) & (largest < np.inf), largest, 1)
