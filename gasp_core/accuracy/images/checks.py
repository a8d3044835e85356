"""What is asked of a picture before it is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.errors import RenderingError

__all__ = ["checked_pair", "checked_picture", "real_array"]

Array = NDArray[Any]


def real_array(name: str, values: ArrayLike) -> Array:
    """Finite floats of any shape as float64.

    Raises
    ------
    RenderingError
        Where `values` are no array, no floats or not finite.
    """
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise RenderingError(f"the {name} is no array: {error}") from None
    if array.dtype.kind != "f":
        advice = "divide by 255 first" if array.dtype == np.uint8 else "convert it first"
        raise RenderingError(f"the {name} holds {array.dtype} values where floats are expected: {advice}")
    if not np.isfinite(array).all():
        raise RenderingError(f"the {name} holds a NaN or an infinity: look for it where the {name} comes from")
    return array.astype(np.float64)


def checked_picture(name: str, picture: ArrayLike, *, smallest_side: int = 1) -> Array:
    """A picture as float64.

    Parameters
    ----------
    name
        What a message calls it.
    picture : (H, W, 3)
        Floats in 0..1.
    smallest_side [px]
        What the measure needs of H and W.

    Raises
    ------
    RenderingError
        Where it is not that.
    """
    array = real_array(name, picture)
    if array.ndim != 3 or array.shape[2] != 3:
        raise RenderingError(f"the {name} has shape {array.shape}, expected (height, width, 3)")
    height, width, _ = array.shape
    if min(height, width) < smallest_side:
        raise RenderingError(
            f"the {name} is {width} x {height} px, this measure needs {smallest_side} px a side: draw it larger"
        )
    low, high = array.min(), array.max()
    if low < 0 or high > 1:
        raise RenderingError(
            f"the {name} holds values from {low:g} to {high:g}, expected 0 to 1:"
            " clip it as a screen would, or divide by 255 if it counts to 255"
        )
    return array


def checked_pair(reference: ArrayLike, picture: ArrayLike, *, smallest_side: int = 1) -> tuple[Array, Array]:
    """Two pictures of one shape as float64.

    Raises
    ------
    RenderingError
        Where one is no picture, or their shapes differ.
    """
    first = checked_picture("reference", reference, smallest_side=smallest_side)
    second = checked_picture("picture", picture, smallest_side=smallest_side)
    if first.shape != second.shape:
        raise RenderingError(
            f"the reference has shape {first.shape}, the picture {second.shape}: draw both in the same size"
        )
    return first, second
