"""Quaternions as files store them: of any length, or three smaller components and the place of the largest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["restore_largest", "unit_quaternions"]

Array = NDArray[Any]


def restore_largest(smaller: Array, largest: Array) -> Array:
    """Unit quaternions from their three smaller components.

    Parameters
    ----------
    smaller : (N, 3)
        The other components, in their order.
    largest : (N,)
        Which of the four is missing; it is taken as positive.

    Returns
    -------
    (N, 4) float32, components in the order they were counted in.
    """
    missing = np.sqrt(np.maximum(0.0, 1.0 - np.sum(smaller**2, axis=1)))
    # Component k is stored at place k before the missing one and at k - 1 behind it.
    place = np.arange(4)[None, :] - (np.arange(4)[None, :] > largest[:, None])
    quaternions = np.take_along_axis(smaller, np.minimum(place, 2), axis=1)
    quaternions[np.arange(len(smaller)), largest] = missing
    return quaternions.astype(np.float32)


def unit_quaternions(quaternions: ArrayLike) -> Array:
    """Normalised quaternions, (N, 4) float64; zero ones become the identity, as everywhere in GASP."""
    q = np.asarray(quaternions, dtype=np.float64)
    largest = np.max(np.abs(q), axis=1, keepdims=True, initial=0.0)
    q = np.where(largest > 0, q, [1.0, 0.0, 0.0, 0.0]) / np.where(largest > 0, largest, 1.0)
    return q / np.linalg.norm(q, axis=1, keepdims=True)
