"""Rows of points between the order of `gasp_mpm_host.layout`, in which they are kept, and that of the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from gasp_mpm_host import layout as at
from numpy.typing import NDArray

from gasp_taichi_mpm import words

__all__ = ["packed", "unpacked"]

Array = NDArray[Any]


def _places() -> Array:
    """For every one of a point's numbers here, where it comes from there; -1 where it is zero."""
    places = np.full((words.POINT_ROWS, 4), -1)
    places[words.VELOCITY, :3] = at.VELOCITY + np.arange(3)
    places[words.AFFINE : words.AFFINE + 3, :3] = at.AFFINE + np.arange(9).reshape(3, 3).T
    # xx, yy, zz, xy, xz, yz
    places[words.STRESS : words.STRESS + 3, :3] = at.STRESS + np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
    gradient = words.DISPLACEMENT_GRADIENT
    places[gradient : gradient + 3, :3] = at.DISPLACEMENT_GRADIENT + np.arange(9).reshape(3, 3).T
    places[words.DILATION, 3] = at.DILATION
    places[words.HISTORY, 3] = at.HISTORY
    places[words.MASS, 3] = at.MASS
    places[words.HALF_SIDE, 3] = at.HALF_SIDE
    return places.reshape(-1)


_PLACES = _places()


def packed(rows: Array) -> Array:
    """(N * `words.POINT_ROWS`, 4) of (N, `layout.POINT_WIDTH`)."""
    return np.where(_PLACES >= 0, rows[:, np.maximum(_PLACES, 0)], 0).astype(rows.dtype, copy=False).reshape(-1, 4)


def unpacked(points: Array) -> Array:
    """(N, `layout.POINT_WIDTH`) of (N * `words.POINT_ROWS`, 4)."""
    flat = points.reshape(-1, 4 * words.POINT_ROWS)
    rows = np.zeros((len(flat), at.POINT_WIDTH), dtype=points.dtype)
    rows[:, _PLACES[_PLACES >= 0]] = flat[:, _PLACES >= 0]
    return rows
