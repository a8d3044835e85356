"""Points that are led: what they do to the nodes around them, and where they are after a step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.led_nodes import HEAVY, LedGrid, LedNodes
from gasp_core.stepping.led_points import LedPoints
from gasp_reference_mpm.material_points import Motion
from gasp_reference_mpm.transfer import GridMomentum, NodeFields

__all__ = ["Lead", "Led"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Led:
    """Led nodes: rows (L,) of the grid, and velocities (L, 3) [m/s]."""

    rows: Array
    velocities: Array

    def masses(self, nodes: Array, points: Array) -> Array:
        """Masses (G,) [kg] of the nodes, led ones giving way to nothing, where points have masses (N,) [kg]."""
        found = nodes.copy()
        found[self.rows] = HEAVY * points.mean()
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """What led points do during some steps, in which no point goes further than half a cell.

    Parameters
    ----------
    points
        That are led.
    around
        The nodes that they take along.
    origin : (3,) [m]
        Of the grid.
    """

    points: LedPoints
    around: LedNodes
    origin: Array

    @classmethod
    def during(cls, led: LedGrid, begin: float, end: float) -> Self:
        """From one time [s] to another: which nodes they take along is asked in the middle."""
        middle = (begin + end) / 2
        around = led.around(led.points.positions(middle), led.points.velocities(middle))
        return cls(points=led.points, around=around, origin=led.origin)

    def nodes(self, fields: NodeFields, grid: GridMomentum, time: float, step: float) -> Led:
        """Those of the grid, from `time` [s] on for `step` [s]."""
        nodes, bodies = self.around.nodes, self.around.bodies
        corners = fields.corners[bodies]
        within: Array = np.all((nodes >= corners) & (nodes < corners + fields.shapes[bodies]), axis=1)
        flat = fields.flat(bodies, np.where(within[:, None], nodes, corners))
        rows = np.minimum(np.searchsorted(grid.nodes, flat), len(grid.nodes) - 1)
        there = within & (grid.nodes[rows] == flat)
        velocities = self.around.velocities(self.points.mean_velocities(time, time + step))
        return Led(rows=rows[there], velocities=velocities[there])

    def followed(self, motion: Motion, time: float) -> Motion:
        """The motion with led points where they are at `time` [s]."""
        rows, positions, velocities = self.points.rows, motion.positions.copy(), motion.velocities.copy()
        positions[rows], velocities[rows] = self.points.positions(time) - self.origin, self.points.velocities(time)
        return replace(motion, positions=positions, velocities=velocities)
