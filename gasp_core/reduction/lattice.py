"""Material points on a lattice inside a surface."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PER_CELL", "lattice_inside"]

Array = NDArray[Any]

PER_CELL = 2
"""Points along each side of a cell of an engine."""
_LEAST = 0.02
"""Share of a point's volume below which it is none: it would weigh nothing and be moved all the same."""
_SAMPLES = np.array(list(itertools.product((-0.25, 0.25), repeat=3)))
_AT_ONCE = 2**21


def lattice_inside(
    distance_at: Callable[[Array], Array], lower: Array, upper: Array, step: float
) -> tuple[Array, Array]:
    """Points (P, 3) of a lattice that are inside, moved into the middle of what is, and their shares (P,), to 1.

    Parameters
    ----------
    distance_at
        Signed distances (N,) [m] of points (N, 3) [m], negative inside.
    lower, upper : (3,) [m]
        Between which all that is inside lies.
    step
        Between points [m].
    """
    counts = np.ceil((upper - lower) / step).astype(int)
    first = (lower + upper) / 2 - step * (counts - 1) / 2
    found: list[tuple[Array, Array]] = []
    slab = max(1, _AT_ONCE // int(counts[1] * counts[2]))
    for begin in range(0, int(counts[0]), slab):
        axes = [first[0] + step * np.arange(begin, min(begin + slab, int(counts[0])))]
        axes += [first[axis] + step * np.arange(int(counts[axis])) for axis in (1, 2)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        distances = distance_at(points)
        # The far corner of a cube is half its diagonal off.
        near = distances < 0.87 * step
        found.append((points[near], distances[near]))
    points, distances = (np.concatenate(part) for part in zip(*found))
    shares = np.ones(len(points))
    cut = np.flatnonzero(distances > -0.87 * step)
    inside = np.stack(
        [np.clip(0.5 - distance_at(points[cut] + step * corner) / (0.5 * step), 0.0, 1.0) for corner in _SAMPLES],
        axis=1,
    )
    shares[cut] = inside.mean(axis=1)
    points[cut] += step * (inside @ _SAMPLES) / np.maximum(inside.sum(axis=1, keepdims=True), _LEAST)
    kept = shares > _LEAST
    return points[kept], shares[kept]
