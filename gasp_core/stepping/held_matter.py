"""Matter that is held or led counts more than it is: what is clamped is to be rigid, and a grid hardly knows that.

A drive holds the nodes in its region, and the splines of the first free node reach on into what is held. Matter there
gives way still, so that a cantilever is longer than it is: by a quarter of a cell where its clamp's plane runs through
nodes, by more than a cell where the last held node is farther behind. Where what lies in the region counts many times,
its stress as well as its mass, it hardly deforms, and the clamp is felt on its plane wherever the grid lies. With the
mass the stable step stays what it was, since the speed of sound does; nor does it weigh on anything, for a drive says
how it moves.

Drop of a cantilever that bends by a quarter of its length, error [%] where its clamp's plane is 0, 1/4, 1/2 and 3/4 of
a cell before a node (`benchmarks/stress_kernel.py`, gasp-warp-mpm):

    counted       1 time                   8 times
    2 cells thick 38.1  30.4  23.6  16.6   10.7  8.1  4.8  5.4
    3 cells       23.8  18.3  14.6   9.7    7.0  4.2  3.0  3.7
    6 cells       10.7   8.8   6.5   4.6    3.5  2.3  1.9  3.3

A bar of 2 x 2 cells that hangs on points that are led swings 42 % too far where these count once, .2 % too little where
they count eight times; one of 4 x 4 cells 19 % too far and 1.4 % too little. That was with a quarter of the stress by
the splines' own gradient; with a half, as it is now, the column of 8 times is

    2 cells thick  9.1  7.7  4.3  4.4
    3 cells        5.4  3.2  1.7  2.2
    6 cells        2.0  1.2   .6  1.8

and the bars swing 1.2 % too far and .9 % too little.

Sixteen times would be nearer there, and too firm for a bar that hangs along its axis, by 7 % of six cells. The linear
cantilever, at rest in the plane, has its least error at eight: root of the mean square over where the plane is .8 % at
6 cells and .4 % at 12, where it is 6.3 and 3.0 for 1 time, 1.7 and .7 for 4, 1.2 and .7 for 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, PointProblem
from gasp_core.stepping.flow import is_flowing
from gasp_core.stepping.forcing import position_at_start

__all__ = ["HELD_FIRMNESS", "firmness"]

Array = NDArray[Any]

HELD_FIRMNESS = 8.0
"""How many times what is held counts. A power of two: what floating point keeps of a mass is the same then."""
_TOUCH = 1e-6
"""In cells: how far outside a region a point is still in it, so that rounding does not decide what lies on its face."""


def firmness(
    problem: PointProblem, drives: Sequence[Drive], time: float, positions: Array, holding: Array, spacing: float
) -> Array:
    """How many times the mass and the stress of each point (N,) count, at positions (N, 3) [m]; led points are held.

    Parameters
    ----------
    drives
        Those that act at `time` [s].
    holding : (K, B) bool
        Which bodies each of them holds, `gasp_core.stepping.forcing.bodies_held`.
    spacing
        Of the grid [m].
    """
    held = np.zeros(len(positions), dtype=np.bool_)
    for drive, bodies in zip(drives, np.asarray(holding, dtype=np.bool_), strict=True):
        places = position_at_start(drive, time, positions)
        held |= bodies[problem.points.body_ids] & (drive.region.signed_distance(places) <= _TOUCH * spacing)
    if problem.trajectories is not None:
        held[problem.trajectories.rows] = True
    keeps_shape = np.array([not is_flowing(material) for material in problem.materials])
    held &= keeps_shape[problem.points.material_ids]
    return np.where(held, HELD_FIRMNESS, 1.0)
