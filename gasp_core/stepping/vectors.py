"""Products and lengths of a few vectors: NumPy's own take longer to find their axes than to multiply."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["crossed", "lengths"]

Array = NDArray[Any]


def crossed(one: Array, other: Array) -> Array:
    """Cross products of vectors (..., 3) with others of a shape that broadcasts: `np.cross` to the last bit."""
    a0, a1, a2 = one[..., 0], one[..., 1], one[..., 2]
    b0, b1, b2 = other[..., 0], other[..., 1], other[..., 2]
    first = a1 * b2
    found = np.empty((*first.shape, 3))
    np.subtract(first, a2 * b1, out=found[..., 0])
    np.subtract(a2 * b0, a0 * b2, out=found[..., 1])
    np.subtract(a0 * b1, a1 * b0, out=found[..., 2])
    return found


def lengths(vectors: Array) -> Array:
    """Of vectors (N, 3), (N,): `np.linalg.norm` along the rows to the last bit."""
    return np.sqrt(np.add.reduce(vectors * vectors, axis=1))
