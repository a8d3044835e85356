"""Steps in three parts, between which the host has a word: for bodies that the grid does not know."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.rigid.side import RigidSide
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import BLOCK
from gasp_mpm_host.scaling import Units

__all__ = ["GridBlocks", "RigidSteps", "Stage", "StagedCloud"]

Array = NDArray[Any]

_NODES = np.indices((BLOCK, BLOCK, BLOCK)).reshape(3, -1).T
_AROUND = 3.0
"""In cells: what is so much farther away than the bodies is not asked for, until a batch is over."""
_TOUCH = 1e-3
"""In cells: a node this near to a surface counts as on it, as at walls."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class GridBlocks:
    """The active blocks of a grid.

    Parameters
    ----------
    corners : (A, 3)
        Their first nodes, from the grid's first node.
    shape : (3,)
        Nodes of the grid along each axis.
    places : (A, 3)
        Where these nodes are in the scene, in cells from the anchor.
    bodies : (A,)
        Whose they are.
    """

    corners: Array
    shape: Array
    places: Array
    bodies: Array

    def nodes(self, blocks: Array) -> tuple[Array, Array, Array]:
        """Of some of the blocks (K,): rows (64 K,) in the grid's memory, places (64 K, 3) in cells, bodies (64 K,)."""
        corners = (self.corners[blocks, None] + _NODES).reshape(-1, 3)
        rows = (corners[:, 0] * self.shape[1] + corners[:, 1]) * self.shape[2] + corners[:, 2]
        places = (self.places[blocks, None] + _NODES).reshape(-1, 3)
        return rows, places, np.repeat(self.bodies[blocks], len(_NODES))


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

    def blocks(self) -> GridBlocks:
        """The active blocks, until the points are sorted."""
        ...

    def node_rows(self, rows: Array) -> Array:
        """Nodes in rows (K,) of the grid: (K, 4) in the engine's units."""
        ...

    def put_velocities(self, rows: Array, velocities: Array) -> None:
        """Give nodes in rows (K,) velocities (K, 3), also where tracers read them."""
        ...

    def flowing(self) -> tuple[Array, Array, Array, Array]:
        """Points of what flows: rows (F,), places (F, 3) in the scene, in cells, half widths (F,), masses (F,)."""
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
        cloud, world = self._cloud, self._side.world
        rows, places, bodies = self._near_nodes()
        points, half_widths, weights = self._near_points()
        units, step = cloud.units, self._step
        clamped = False
        for index in range(first, end):
            cloud.begin_stages(index, first)
            cloud.stage(Stage.SCATTER, index)
            masses = cloud.node_rows(rows)[:, 3].astype(np.float64)
            cloud.stage(Stage.UPDATE, index)
            filled = np.flatnonzero(masses > at.LEAST_MASS)
            within, nodes = self._side.nodes(
                places[filled],
                cloud.node_rows(rows[filled])[:, :3].astype(np.float64) * units.speed,
                masses[filled] * units.mass,
                bodies[filled],
                _TOUCH * units.spacing,
            )
            after = world.step(self._begin + index * step, step, nodes)
            cloud.put_velocities(rows[filled[within]], after / units.speed)
            cloud.stage(Stage.MOVE, index)
            if len(points):
                self._keep_out(points, half_widths, weights)
            drifted, held = cloud.end_stages()
            clamped |= held
            if drifted:
                return index + 1 - first, True, clamped
        return end - first, False, clamped

    def _near(self, places: Array, margin: float) -> Array:
        """Which places (K, 3) [m] are within `margin` [m] of a rigid body, or of the ball around it; (K,) of bool."""
        world = self._side.world
        near = np.zeros(len(places), dtype=np.bool_)
        for place, radius in zip(world.state.places, world.surfaces.radii):
            near |= np.sum((places - place) ** 2, axis=1) < (radius + margin) ** 2
        return near

    def _near_nodes(self) -> tuple[Array, Array, Array]:
        """Rows (G,), places (G, 3) [m] and bodies (G,) of nodes that rigid bodies may reach within the batch."""
        units, blocks = self._cloud.units, self._cloud.blocks()
        middle = units.world(blocks.places + (BLOCK - 1) / 2)
        half = 0.5 * BLOCK * np.sqrt(3.0)
        rows, places, bodies = blocks.nodes(np.flatnonzero(self._near(middle, (half + _AROUND) * units.spacing)))
        return rows, units.world(places), bodies

    def _near_points(self) -> tuple[Array, Array, Array]:
        """Rows (F,), half widths (F,) [m] and masses (F,) [kg] of flowing points that they may reach within it."""
        units = self._cloud.units
        rows, places, half_widths, masses = self._cloud.flowing()
        near = self._near(units.world(places), _AROUND * units.spacing)
        return rows[near], half_widths[near] * units.spacing, masses[near] * units.mass

    def _keep_out(self, points: Array, half_widths: Array, masses: Array) -> None:
        units, cloud = self._cloud.units, self._cloud
        places, velocities = cloud.moving(points)
        before = velocities * units.speed
        # Where they were: what is asked is how they go on from there.
        start = units.world(places) - self._step * before
        after = self._side.world.keep_out(before, start, half_widths, masses, self._step)
        changed = np.flatnonzero(np.any(after != before, axis=1))
        if len(changed):
            change = (after[changed] - before[changed]) / units.speed
            cloud.nudge(points[changed], change, self._step / units.time)
