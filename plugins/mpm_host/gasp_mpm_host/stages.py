"""Steps in three parts, between which the host has a word: for bodies that the grid does not know."""

from __future__ import annotations

from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.rigid.side import RigidSide
from gasp_mpm_host.scaling import Units

__all__ = ["RigidSteps", "Stage", "StagedCloud"]

Array = NDArray[Any]

_AROUND = 4.0
"""In cells: points so much farther away than the bodies do not meet them before a batch is over."""


class Stage(Enum):
    """A part of a step.

    Attributes
    ----------
    SCATTER
        Points to nodes: these then hold momentum and mass.
    UPDATE
        What acts on nodes, which then hold velocities.
    MOVE
        Nodes to points, and to tracers.
    """

    SCATTER = "scatter"
    UPDATE = "update"
    MOVE = "move"


class StagedCloud(Protocol):
    """What a `gasp_mpm_host.session.SteppedCloud` can do besides, for `RigidSteps`."""

    units: Units

    def begin_stages(self, index: int, first: int) -> None:
        """Step `index` of the batch is the next, and the first since bodies were looked at is step `first`."""
        ...

    def stage(self, stage: Stage, index: int) -> None:
        """Do a part of step `index`."""
        ...

    def end_stages(self) -> tuple[bool, bool]:
        """Whether a point drifted in this step, whether the edge held any."""
        ...

    def rows_of(self, nodes: Array, bodies: Array) -> Array:
        """Where nodes (K, 3) of bodies (K,) are in the grid's memory, (K,); their coordinates are the scene's."""
        ...

    def node_rows(self, rows: Array) -> Array:
        """Nodes in rows (K,) of the grid: (K, 4) in the engine's units."""
        ...

    def put_velocities(self, rows: Array, velocities: Array) -> None:
        """Give nodes in rows (K,) velocities (K, 3), also where tracers read them."""
        ...

    def all_cells(self) -> Array:
        """Places (N, 3) of all points in the scene, in cells."""
        ...

    def traits(self, rows: Array) -> tuple[Array, Array, Array, Array]:
        """Of points in rows (K,): half widths (K,), masses (K,), bodies (K,), whether they flow (K,)."""
        ...

    def moving(self, rows: Array) -> tuple[Array, Array]:
        """Of points in rows (K,): places (K, 3) in the scene, in cells, and velocities (K, 3)."""
        ...

    def nudge(self, rows: Array, change: Array, step: float) -> None:
        """Change the velocities of points in rows (K,) by (K, 3), as if it had been so during the last step."""
        ...


class RigidSteps:
    """Steps of a cloud and of the rigid bodies beside it.

    Parameters
    ----------
    cloud
        Of what is not rigid.
    side
        The rigid bodies.
    """

    def __init__(self, cloud: StagedCloud, side: RigidSide) -> None:
        self._cloud, self._side = cloud, side
        self._begin, self._step = 0.0, 0.0

    def begin_batch(self, begin: float, step: float) -> None:
        """The next steps of `step` [s] begin at `begin` [s]."""
        self._begin, self._step = begin, step

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch; see `SteppedCloud.steps`."""
        cloud, side = self._cloud, self._side
        units, step = cloud.units, self._step
        rows, half_widths, masses, bodies, flowing = self._near_points()
        clamped = False
        for index in range(first, end):
            cloud.begin_stages(index, first)
            cloud.stage(Stage.SCATTER, index)
            places, _ = cloud.moving(rows)
            near = side.near(units.world(places), half_widths, bodies, units.spacing, units.anchor)
            nodes = cloud.rows_of(near.nodes, near.bodies)
            weights = cloud.node_rows(nodes)[:, 3].astype(np.float64) * units.mass
            cloud.stage(Stage.UPDATE, index)
            velocities = cloud.node_rows(nodes)[:, :3].astype(np.float64) * units.speed
            met = side.met(near, velocities, weights, units.spacing, units.anchor)
            after = side.world.step(self._begin + index * step, step, met)
            cloud.put_velocities(nodes, after / units.speed)
            cloud.stage(Stage.MOVE, index)
            if len(flowing):
                own = (half_widths[flowing], masses[flowing], bodies[flowing])
                self._keep_out(rows[flowing], places[flowing], *own)
            drifted, held = cloud.end_stages()
            clamped |= held
            if drifted:
                return index + 1 - first, True, clamped
        return end - first, False, clamped

    def _near_points(self) -> tuple[Array, Array, Array, Array, Array]:
        """Rows (P,), half widths (P,) [m], masses (P,) [kg] and bodies (P,) of points that rigid bodies may meet within
        the batch, and which of them flow (F,)."""
        units, world = self._cloud.units, self._side.world
        places = units.world(self._cloud.all_cells())
        near = np.zeros(len(places), dtype=np.bool_)
        for place, radius in zip(world.state.places, world.surfaces.radii):
            near |= np.sum((places - place) ** 2, axis=1) < (radius + _AROUND * units.spacing) ** 2
        rows = np.flatnonzero(near)
        half_widths, masses, bodies, flows = self._cloud.traits(rows)
        return rows, half_widths * units.spacing, masses * units.mass, bodies, np.flatnonzero(flows)

    def _keep_out(self, rows: Array, cells: Array, half_widths: Array, masses: Array, bodies: Array) -> None:
        """Points that were at `cells` (F, 3) before the step that has just moved them."""
        units, cloud = self._cloud.units, self._cloud
        _, velocities = cloud.moving(rows)
        before = velocities * units.speed
        after = self._side.keep_out(before, units.world(cells), half_widths, masses, bodies, self._step)
        changed = np.flatnonzero(np.any(after != before, axis=1))
        if len(changed):
            change = (after[changed] - before[changed]) / units.speed
            cloud.nudge(rows[changed], change, self._step / units.time)
