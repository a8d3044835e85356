"""Neighbourhoods and connected parts on a grid: SciPy's, with types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["connected_parts", "dilated", "highest_near", "large_parts", "nearest_in", "shell_of"]

Array = NDArray[Any]


def _images() -> Any:
    # Slow to import.
    from scipy import ndimage

    return ndimage


def dilated(mask: Array, times: int, within: Array | None = None) -> Array:
    """A mask and what is so many nodes off it, corners touching; within another mask only."""
    return _images().binary_dilation(mask, np.ones((3, 3, 3)), iterations=times, mask=within)


def shell_of(mask: Array, nodes: int) -> Array:
    """What is at most so many nodes off the surface of a mask, to either side."""
    outer = _images().binary_dilation(mask, iterations=nodes)
    return outer & ~_images().binary_erosion(mask, iterations=nodes, border_value=1)


def highest_near(field: Array, nodes: int) -> Array:
    """The highest value at most so many nodes off along each axis."""
    return _images().maximum_filter(field, 2 * nodes + 1)


def nearest_in(mask: Array) -> tuple[Array, Array, Array]:
    """Indices of the nearest node of a mask, for every node."""
    return tuple(_images().distance_transform_edt(~mask, return_distances=False, return_indices=True))


def connected_parts(mask: Array) -> tuple[Array, Array]:
    """Numbers 1, 2, ... (X, Y, Z) of the parts, corners touching, 0 elsewhere; and how many nodes each has, (P + 1,).

    The first number, of what is in no part, is 0.
    """
    labels, count = _images().label(mask, np.ones((3, 3, 3)))
    sizes = np.bincount(labels.reshape(-1), minlength=count + 1)
    sizes[0] = 0
    return labels, sizes


def large_parts(mask: Array, share: float) -> Array:
    """What is in connected parts of at least this share of the largest."""
    labels, sizes = connected_parts(mask)
    return (sizes >= share * sizes.max())[labels] & mask
