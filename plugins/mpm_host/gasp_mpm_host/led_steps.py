"""What points that are led do between the parts of a cloud's steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem, Wind
from gasp_core.stepping.forcing import force_fields_at
from gasp_core.stepping.led_nodes import HEAVY, LedGrid, LedNodes
from gasp_mpm_host.stages import StagedCloud

__all__ = ["LedSteps"]

Array = NDArray[Any]


class LedSteps:
    """See `gasp_mpm_host.stages.Intervention`.

    Which nodes are led, and how they follow the points around them, holds for a batch: no point goes further than half
    a cell in it, and it is looked where they are in its middle.

    Parameters
    ----------
    cloud
        Of all points.
    grid
        Those that are led, and the cloud's grid.
    problem
        What the cloud is of.
    """

    _around: LedNodes

    def __init__(self, cloud: StagedCloud, grid: LedGrid, problem: PointProblem) -> None:
        self._cloud, self._grid, self._led, self._problem = cloud, grid, grid.points, problem
        self._begin, self._step = 0.0, 0.0

    def begin_batch(self, begin: float, step: float, count: int, allowed: float) -> None:
        """See `Intervention`."""
        self._begin, self._step = begin, step
        middle = begin + 0.5 * count * step
        self._around = self._grid.around(self._led.positions(middle), self._led.velocities(middle))

    def begin_steps(self, index: int) -> None:
        """See `Intervention`."""
        self._rows = self._cloud.rows_of_points(self._led.rows)
        self._nodes = self._cloud.rows_of(self._around.nodes, self._around.bodies)

    def before_update(self, index: int) -> None:
        """See `Intervention`: led nodes are too heavy for what they meet."""
        cloud, units = self._cloud, self._cloud.units
        now = self._begin + index * self._step
        velocities = self._around.velocities(self._led.mean_velocities(now, now + self._step)) / units.speed
        # Where nothing is, there is nothing that others could meet.
        there = np.flatnonzero(cloud.node_rows(self._nodes)[:, 3] > 0)
        self._there, self._velocities = self._nodes[there], velocities[there]
        heavy = np.full((len(there), 4), HEAVY)
        heavy[:, :3] *= self._unmoved(velocities[there] * units.speed, there, now) / units.speed
        cloud.put_nodes(self._there, heavy)

    def _unmoved(self, velocities: Array, there: Array, time: float) -> Array:
        """Velocities (L, 3) [m/s] that gravity and winds make into these, at nodes `there` (L,), before bodies meet."""
        step, problem = self._step, self._problem
        for force in reversed(force_fields_at(problem.force_fields, time)):
            if isinstance(force, Wind):
                share = np.full((len(there), 1), step * force.drag)
                if force.region is not None:
                    places = self._cloud.units.world(self._around.nodes[there])
                    share *= (force.region.signed_distance(places) <= 0)[:, None]
                velocities = velocities + share * (velocities - np.asarray(force.velocity))
        return velocities - step * np.asarray(problem.gravity)

    def after_update(self, index: int) -> None:
        """See `Intervention`."""
        self._cloud.put_velocities(self._there, self._velocities)

    def after_move(self, index: int) -> None:
        """See `Intervention`: the points are where they are led."""
        units, now = self._cloud.units, self._begin + (index + 1) * self._step
        cells = units.cells(self._led.positions(now))
        self._cloud.put_points(self._rows, cells, self._led.velocities(now) / units.speed)
