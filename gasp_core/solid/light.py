"""Where light comes to through a splat: what the sky sees is air, what it does not see may be a body.

Light comes in straight lines from a sky on all sides, in the 98 directions whose coordinates are 0, 1 and 2, and is
weakened by the optical depth of what it passes, as in the rendering of splats.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.solid import kernels

__all__ = ["Light", "light_through"]

Array = NDArray[Any]

_STEPS = [
    step for step in itertools.product((-2, -1, 0, 1, 2), repeat=3) if step > (0, 0, 0) and np.gcd.reduce(step) == 1
]
"""Half of the directions; the others are their opposites."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """What comes to each node of a grid.

    Parameters
    ----------
    share : (X, Y, Z)
        Of the sky that is seen from there, 0..1.
    lines : (X, Y, Z)
        Share of straight lines through the node that are free to both sides, 0..1. A place in a hole of a wall sees
        much of the sky, and no such line; between two leaves it is the other way round.
    flow : (3, X, Y, Z)
        Mean over the directions of where the light is, times how much comes from there.
    """

    share: Array
    lines: Array
    flow: Array

    def over_ground(self, row: int) -> Light:
        """With so many layers below, each the mirror image of the lowest one."""

        def mirrored(field: Array, sign: float = 1.0) -> Array:
            return np.concatenate([sign * np.repeat(field[:, :, :1], row, axis=2), field], axis=2)

        x, y, z = self.flow
        flow = np.stack([mirrored(x), mirrored(y), mirrored(z, -1.0)])
        return Light(share=mirrored(self.share), lines=mirrored(self.lines), flow=flow)


def light_through(depth: Array, ground: bool) -> Light:
    """Light at the nodes of a grid that matter of optical depth (X, Y, Z), per spacing, stands in the way of.

    `ground`: none comes from below the lowest layer.
    """
    padded = np.pad(depth.astype(np.float32), kernels.PAD)
    share, lines = np.zeros(depth.shape), np.zeros(depth.shape)
    flow = np.zeros((3, *depth.shape))
    there, back = _sky(padded, ground), _sky(padded, ground)
    for step in _STEPS:
        opposite = (-step[0], -step[1], -step[2])
        for way, out in ((step, there), (opposite, back)):
            kernels.depth_towards(padded, np.array(way), _half_way(way), out)
        kernels.add_light(np.exp(-there), np.exp(-back), np.array(step) / np.linalg.norm(step), share, lines, flow)
    count = len(_STEPS)
    return Light(share=share / (2 * count), lines=lines / count, flow=flow / (2 * count))


def _sky(padded: Array, ground: bool) -> Array:
    """What light has passed before it comes into a padded grid: nothing, and all of the ground from below."""
    passed = np.zeros_like(padded)
    if ground:
        passed[:, :, : kernels.PAD] = kernels.DARK
    return passed


def _half_way(step: tuple[int, ...]) -> Array:
    """The nodes (B, 3) around the middle of a step of two; none of a step of one."""
    if max(map(abs, step)) == 1:
        return np.zeros((0, 3), dtype=np.int64)
    return np.array([*itertools.product(*((part // 2,) if part % 2 == 0 else (0, part) for part in step))])
