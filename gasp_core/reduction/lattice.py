"""Material points on a lattice inside a surface."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.io.memory_limit import available_memory
from gasp_core.quantities import bytes_told, length_told, volume_told
from gasp_core.solid.solid import filled_shares

__all__ = ["PER_CELL", "lattice_inside", "refuse_too_many"]

Array = NDArray[Any]

PER_CELL = 2
"""Points along each side of a cell of an engine."""
_LEAST = 0.02
"""Share of a point's volume, or of what a wall right across has of it, below which it is none: it would weigh nothing
and be moved all the same."""
_SAMPLES = np.array(list(itertools.product((-0.25, 0.25), repeat=3)))
_AT_ONCE = 2**21
_BYTES_A_POINT = 1000
"""Of memory that a point takes at the least until the engine is open: it was 1,470 with warp-mpm, from 18,000 to
315,000 points of a toy."""


def refuse_too_many(volume: float, step: float, name: str) -> None:
    """Refuse to fill a body with more points than the memory holds, before one of them is made.

    Parameters
    ----------
    volume
        Of the body [m^3].
    step
        Between points [m].
    name
        Of the object, for the message.

    Raises
    ------
    SceneError
        Where it is so.
    """
    count = volume / step**3
    need, there = _BYTES_A_POINT * count, available_memory()
    if need > there:
        raise SceneError(
            f'object "{name}": at a grid spacing of {length_told(PER_CELL * step)} some {count:,.0f} points fill its'
            f" {volume_told(volume)}, which take {bytes_told(need)} of memory at least, and the machine has"
            f" {bytes_told(there)} free: lower resolution, or raise spacing, under [accuracy]"
        )


def lattice_inside(
    distance_at: Callable[[Array], Array], lower: Array, upper: Array, step: float, wall: float = np.inf
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
    wall
        [m] What is deeper inside is air.
    """
    # The far corner of a cube is half its diagonal off.
    reach = 0.87 * step
    counts = np.ceil((upper - lower) / step).astype(int)
    first = (lower + upper) / 2 - step * (counts - 1) / 2
    found: list[tuple[Array, Array]] = []
    slab = max(1, _AT_ONCE // int(counts[1] * counts[2]))
    for begin in range(0, int(counts[0]), slab):
        axes = [first[0] + step * np.arange(begin, min(begin + slab, int(counts[0])))]
        axes += [first[axis] + step * np.arange(int(counts[axis])) for axis in (1, 2)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        distances = distance_at(points)
        near = (distances < reach) & (distances > -wall - reach)
        found.append((points[near], distances[near]))
    points, distances = (np.concatenate(part) for part in zip(*found))
    shares = np.ones(len(points))
    cut = np.flatnonzero((distances > -reach) | (distances < reach - wall))
    inside = np.stack(
        [filled_shares(distance_at(points[cut] + step * corner), 0.5 * step, wall) for corner in _SAMPLES], axis=1
    )
    shares[cut] = inside.mean(axis=1)
    sums = inside.sum(axis=1, keepdims=True)
    points[cut] += step * (inside @ _SAMPLES) / np.where(sums > 0, sums, 1.0)
    kept = shares > _LEAST * min(wall / step, 1.0)
    return points[kept], shares[kept]
