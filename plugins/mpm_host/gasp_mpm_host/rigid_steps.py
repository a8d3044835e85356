"""What rigid bodies beside the cloud do between the parts of its steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.rigid.side import RigidSide
from gasp_mpm_host.stages import StagedCloud

__all__ = ["RigidSteps"]

Array = NDArray[Any]

_AROUND = 4.0
"""In cells: points so much farther away than the bodies do not meet them before a batch is over."""


class RigidSteps:
    """See `gasp_mpm_host.stages.Intervention`.

    Parameters
    ----------
    cloud
        Of what is not rigid.
    side
        The rigid bodies.
    """

    def __init__(self, cloud: StagedCloud, side: RigidSide) -> None:
        self._cloud, self._side = cloud, side
        self._begin, self._step, self._allowed = 0.0, 0.0, 0.0

    def begin_batch(self, begin: float, step: float, count: int, allowed: float) -> None:
        """See `Intervention`."""
        self._begin, self._step, self._allowed = begin, step, allowed

    def begin_steps(self, index: int) -> None:
        """See `Intervention`: rows (P,), half widths (P,) [m], masses (P,) [kg] and bodies (P,) of points that rigid
        bodies may meet within the batch, and which of them flow (F,)."""
        units, world = self._cloud.units, self._side.world
        places = units.world(self._cloud.all_cells())
        near = np.zeros(len(places), dtype=np.bool_)
        for place, radius in zip(world.state.places, world.surfaces.radii):
            near |= np.sum((places - place) ** 2, axis=1) < (radius + _AROUND * units.spacing) ** 2
        self._rows = np.flatnonzero(near)
        half_widths, masses, self._bodies, flows = self._cloud.traits(self._rows)
        self._half_widths, self._masses = half_widths * units.spacing, masses * units.mass
        self._flowing = np.flatnonzero(flows)
        self._seams = self._cloud.rows_of_points(self._side.welds.rows)

    def before_update(self, index: int) -> None:
        """See `Intervention`."""
        cloud, units = self._cloud, self._cloud.units
        self._places, _ = cloud.moving(self._rows)
        world = units.world(self._places)
        self._near = self._side.near(world, self._half_widths, self._bodies, units.spacing, units.anchor)
        self._nodes = cloud.rows_of(self._near.nodes, self._near.bodies)
        self._beside = units.world(cloud.moving(self._seams)[0]) if len(self._seams) else np.zeros((0, 3))
        self._weights = cloud.node_rows(self._nodes)[:, 3].astype(np.float64) * units.mass

    def after_update(self, index: int) -> None:
        """See `Intervention`."""
        cloud, side, units = self._cloud, self._side, self._cloud.units
        velocities = cloud.node_rows(self._nodes)[:, :3].astype(np.float64) * units.speed
        met = side.met(self._near, velocities, self._weights, units.spacing, units.anchor, self._beside, self._allowed)
        after = side.world.step(self._begin + index * self._step, self._step, met)
        cloud.put_velocities(self._nodes, after / units.speed)

    def after_move(self, index: int) -> None:
        """See `Intervention`: what flows is kept out of the bodies."""
        flowing, units, cloud = self._flowing, self._cloud.units, self._cloud
        if not len(flowing):
            return
        rows, before_step = self._rows[flowing], units.world(self._places[flowing])
        _, velocities = cloud.moving(rows)
        before = velocities * units.speed
        own = (self._half_widths[flowing], self._masses[flowing], self._bodies[flowing])
        after = self._side.keep_out(before, before_step, *own, self._step)
        changed = np.flatnonzero(np.any(after != before, axis=1))
        if len(changed):
            change = (after[changed] - before[changed]) / units.speed
            cloud.nudge(rows[changed], change, self._step / units.time)
