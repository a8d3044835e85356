"""A step in three parts, between which the host has a word."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.stages import Stage
from numpy.typing import NDArray

from gasp_warp_mpm.blocks import BLOCK_NODES
from gasp_warp_mpm.device_order import DeviceOrder
from gasp_warp_mpm.tables import CLAMPED, DRIFTED

__all__ = ["StagedSteps"]

Array = NDArray[Any]


class StagedSteps(DeviceOrder):
    """What `gasp_mpm_host.stages.StagedCloud` asks of a cloud, with the kernels of whole steps."""

    _tables: Any
    _acting: Any
    _device: Any
    _no_tiles: Any

    @abstractmethod
    def _begin_report(self, index: int, first: int) -> None:
        """Step `index` is the next; bodies were looked at in step `first`."""

    @abstractmethod
    def _steps_in_threads(self, first: int, end: int) -> None:
        """Do steps first..end in this processor's threads."""

    @abstractmethod
    def _scatter_by_phase(self) -> None:
        """Points to an empty grid, a launch a phase."""

    def begin_stages(self, index: int, first: int) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        self._begin_report(index, first)

    def stage(self, stage: Stage, index: int) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        if self._atomic:
            self._phases_of(stage)
            return
        with self._nothing_but(stage):
            self._steps_in_threads(index, index + 1)

    @contextlib.contextmanager
    def _nothing_but(self, stage: Stage) -> Iterator[None]:
        """Let steps be parts of steps: of everything else there is nothing to do."""
        tables = self._tables
        idle = {
            Stage.SCATTER: {"active_count": 0, "colours": self._no_tiles},
            Stage.UPDATE: {"apart_count": 0, "place_count": 0},
            Stage.MOVE: {"count": 0, "tracer_count": 0},
        }
        changes = {name: value for each, part in idle.items() if each is not stage for name, value in part.items()}
        before = {name: getattr(tables, name) for name in changes}
        try:
            for name, value in changes.items():
                setattr(tables, name, value)
            yield
        finally:
            for name, value in before.items():
                setattr(tables, name, value)

    def _phases_of(self, stage: Stage) -> None:
        phases, tables = self._kernels.phases, self._tables
        match stage:
            case Stage.SCATTER:
                self._scatter_by_phase()
            case Stage.UPDATE:
                self._launch(phases.update, BLOCK_NODES * tables.apart_count, self._acting)
                if tables.place_count:
                    self._launch(phases.meet, tables.place_count, self._acting)
            case Stage.MOVE:
                self._launch(phases.move, self._count, self._acting)
                if tables.tracer_count > 0:
                    self._launch(phases.carry, tables.tracer_count, self._acting)
                self._launch(phases.finish, 1)

    def end_stages(self) -> tuple[bool, bool]:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        report = self._tables.report.numpy()
        return bool(report[DRIFTED]), bool(report[CLAMPED])

    def node_rows(self, rows: Array) -> Array:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        if not self._atomic:
            return self._tables.grid.numpy()[rows]
        found = self._empty(len(rows), self._tables.grid.dtype)
        self._launch_rows(self._kernels.phases.read_nodes, rows, found)
        return found.numpy().reshape(-1, 4)

    def put_nodes(self, rows: Array, nodes: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        if self._atomic:
            self._launch_rows(self._kernels.phases.put_nodes, rows, self._put(nodes, wp.vec4d))
        else:
            self._tables.grid.numpy()[rows] = nodes

    def put_velocities(self, rows: Array, velocities: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        tables = self._tables
        if self._atomic:
            self._launch_rows(self._kernels.phases.write_nodes, rows, self._put(velocities, wp.vec3d))
            return
        grid = tables.grid.numpy()
        grid[rows, :3] = velocities
        if tables.carries:
            carrier = tables.carrier.numpy()
            carrier[rows, :3] = carrier[rows, 3:] * grid[rows, :3]

    def moving(self, rows: Array) -> tuple[Array, Array]:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        if not self._atomic:
            return super().moving(rows)
        places, velocities = (self._empty(len(rows), wp.vec3d) for _ in range(2))
        self._launch_rows(self._kernels.phases.read_points, rows, places, velocities)
        cells = places.numpy().reshape(-1, 3)
        if self._stands.any():
            cells = cells - self._stands[self._bodies[self._ids[rows]]]
        return cells, velocities.numpy().reshape(-1, 3)

    def put_points(self, rows: Array, cells: Array, velocities: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        places = self._standing_cells(rows, cells)
        if self._atomic:
            given = (self._put(each, wp.vec3d) for each in (places, velocities))
            self._launch_rows(self._kernels.phases.put_points, rows, *given)
            return
        self._point_rows()[rows, at.VELOCITY : at.VELOCITY + 3] = velocities
        self._tables.x.numpy()[rows] = places

    def nudge(self, rows: Array, change: Array, step: float) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        if self._atomic:
            self._launch_rows(self._kernels.phases.nudge_points, rows, self._put(change, wp.vec3d), wp.float64(step))
            return
        cells, points = self._tables.x.numpy(), self._point_rows()
        points[rows, at.VELOCITY : at.VELOCITY + 3] += change.astype(points.dtype)
        cells[rows] += step * change

    def _launch_rows(self, kernel: Any, rows: Array, *inputs: Any) -> None:
        if len(rows):
            self._launch(kernel, len(rows), self._put(rows, wp.int32), *inputs)
