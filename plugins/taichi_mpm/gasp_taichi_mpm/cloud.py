"""The points and the grid in the kernels' memory: sorted, stepped, surveyed, read back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gasp_mpm_host import layout as at
from gasp_mpm_host.bodies import Meetings
from gasp_mpm_host.cells import COLOURS, CellTables
from gasp_mpm_host.cloud import SEEDING_PASSES, SortedCloud
from gasp_mpm_host.forcing_tables import Forcing
from gasp_mpm_host.rows import Rows, Survey
from gasp_mpm_host.scaling import Units, material_table
from gasp_mpm_host.stages import Stage
from gasp_mpm_host.tracers import TracerRows, TracerTables
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_taichi_mpm import runtime, words
from gasp_taichi_mpm.kernels import make_kernels
from gasp_taichi_mpm.memory import Memory
from gasp_taichi_mpm.packing import packed, unpacked
from gasp_taichi_mpm.separation import SCRATCH_WIDTH

__all__ = ["Cloud"]

Array = NDArray[Any]

_STAGES = np.repeat([0, 1, 2], [words.UPDATE, 1, words.PHASES - words.MOVE])
"""Of the phases of a step."""


class Cloud(SortedCloud):
    """The state of a session; see `gasp_mpm_host.cloud.SortedCloud`.

    Parameters
    ----------
    problem
        What is simulated.
    units
        The engine's units.
    restart
        Arrays as `checkpoint` gave them, or None.
    engine
        Its name, for messages.
    double
        float64 throughout; positions are float64 in any case.
    threads
        Processors to use.
    on_gpu
        Run on the GPU.
    """

    def __init__(
        self,
        problem: PointProblem,
        units: Units,
        restart: Mapping[str, Array] | None,
        engine: str,
        *,
        double: bool,
        threads: int,
        on_gpu: bool,
    ) -> None:
        super().__init__(problem, units, double=double, threads=threads)
        self._runtime = runtime.current()
        self._memory = Memory(on_gpu=on_gpu)
        self._kernels = make_kernels(double, self._kinds, on_gpu, self._averaged, len(self._stands) > 1)
        self._materials = self._memory.put(material_table(problem, units))
        self._control = np.zeros(words.CONTROL_WIDTH, dtype=np.int32)
        self._control[words.POINTS] = self._count
        self._batch = np.zeros(words.BATCH_WIDTH)
        self._batch[words.MASS_AXIS + 3] = 1
        self._grid: Any = None
        self._means: Any = self._memory.empty((1, 2), self._host_real)
        self._carrier: Any = self._memory.empty((1, 4), np.float64)
        self._chart = self._memory.put(np.zeros(self._chunks * at.SURVEY_WIDTH))
        self._scratch: Any = None
        self._report = self._memory.put(np.zeros(words.REPORT_WIDTH, dtype=np.int32))
        self.set_fields(np.zeros(1))
        self._begin(problem, restart, engine)

    def _seed(self) -> None:
        self.begin_batch(0.0, np.zeros(3), Forcing.none(SEEDING_PASSES))
        self._control[words.SEEDING] = 1
        self.steps(0, SEEDING_PASSES)
        self._control[words.SEEDING] = 0
        self._kernels.strain(self._points, self._labels, self._materials, self._put_control())

    def _load(self, rows: Rows) -> None:
        put, empty = self._memory.put, self._memory.empty
        self._x, self._x_spare = put(rows.cells), empty(rows.cells.shape, np.float64)
        points = packed(rows.points)
        self._points, self._points_spare = put(points), empty(points.shape, self._host_real)
        self._labels, self._labels_spare = put(rows.labels.reshape(-1)), empty((rows.labels.size,), np.int32)

    def _cell_rows(self) -> Array:
        runtime.require(self._runtime)
        return self._memory.get(self._x)

    def _point_rows(self) -> Array:
        return unpacked(self._memory.get(self._points))

    def _write_points(self, points: Array) -> None:
        runtime.require(self._runtime)
        self._memory.write(self._points, packed(points))

    def _velocity_rows(self) -> Array:
        return self._memory.get(self._points).reshape(-1, words.POINT_ROWS, 4)[:, words.VELOCITY, :3]

    def _label_rows(self) -> Array:
        return self._memory.get(self._labels).reshape(-1, at.LABEL_WIDTH)

    def _load_tracers(self, rows: TracerRows) -> None:
        # One more than there are: some kernels' arguments must not be empty.
        cells = np.concatenate([rows.cells, np.zeros((1, 3))])
        homes = np.concatenate([rows.homes.reshape(-1), np.zeros(1, dtype=np.int32)])
        self._tracers, self._homes = self._memory.put(cells), self._memory.put(homes)

    def _tracer_rows(self) -> TracerRows:
        runtime.require(self._runtime)
        get = self._memory.get
        return TracerRows(
            cells=get(self._tracers)[:-1], homes=get(self._homes)[:-1].reshape(-1, 3), ids=self._tracer_ids
        )

    def _put_control(self) -> Any:
        return self._memory.put(self._control) if self._memory.on_gpu else self._control

    def _place(self, cells: Array) -> None:
        self._memory.write(self._x, cells)

    def _settle(self) -> None:
        self._kernels.settle(self._x, self._labels, self._put_control())

    def _permute(self, order: Array) -> None:
        self._kernels.permute(
            self._memory.put(order),
            self._put_control(),
            self._x,
            self._points,
            self._labels,
            self._x_spare,
            self._points_spare,
            self._labels_spare,
        )
        self._x, self._x_spare = self._x_spare, self._x
        self._points, self._points_spare = self._points_spare, self._points
        self._labels, self._labels_spare = self._labels_spare, self._labels

    def _set_grid(self, found: CellTables, stands: Array) -> None:
        self._control[words.LOWER : words.LOWER + 3] = found.lower
        self._control[words.SHAPE : words.SHAPE + 3] = found.shape
        self._control[words.COLOURS_AT : words.COLOURS_AT + 9] = found.colour_offsets
        self._tiles = self._memory.put(found.tiles.reshape(-1))
        self._stand_table = stands

    def _make_room(self, nodes: int) -> None:
        self._grid = None
        self._control[words.CARRIED_AT] = nodes
        self._grid = self._memory.empty(((2 if self._flowing else 1) * nodes, 4), np.float64)
        if self._averaged:
            self._means = None
            self._means = self._memory.empty((nodes, 2), self._host_real)
        if self._traced:
            self._carrier = None
            self._carrier = self._memory.empty((nodes, 4), np.float64)

    def _set_active(self, woken: TracerTables, found: CellTables, met: Meetings) -> None:
        self._set_meetings(met)
        self._active = self._memory.put(woken.active)
        self._control[words.ACTIVE] = len(woken.active)
        self._control[words.TRACERS], self._control[words.CARRIES] = woken.awake, woken.awake > 0
        self._control[words.PHASES_AT : words.PHASES_AT + words.PHASES + 1] = self._tickets(found)

    def _set_meetings(self, met: Meetings) -> None:
        """Who meets, in one table."""
        tables = {
            words.STANDS_AT: self._stand_table,
            words.APART_AT: met.apart,
            words.MEMBERS_AT: met.members,
            words.MEMBER_BEGINS_AT: met.places,
            words.PAIRS_AT: met.pairs,
            words.PAIR_BEGINS_AT: met.pair_begins,
            words.NEAR_AT: met.near,
            words.NEAR_BEGINS_AT: met.near_begins,
            words.APART_BODIES_AT: met.apart_bodies,
            words.MEMBER_BODIES_AT: met.member_bodies,
        }
        begin = 0
        for word, table in tables.items():
            self._control[word] = begin
            begin += table.size
        self._met = self._memory.put(np.concatenate([table.reshape(-1) for table in tables.values()]).astype(np.int32))
        self._control[words.APART], self._control[words.PLACES] = len(met.apart), len(met.places) - 1
        self._control[words.SCRATCH_AT] = len(met.friction)
        scratch = np.zeros(len(met.friction) + 64 * SCRATCH_WIDTH * len(met.pairs) + 1)
        scratch[: len(met.friction)] = met.friction
        self._scratch = self._memory.put(scratch)

    def _tickets(self, tables: CellTables) -> Array:
        """Where the phases of a step begin in its tickets, and the end."""
        blocks = -(-int(self._control[words.ACTIVE]) // words.BLOCKS_A_TICKET)
        tiles = np.diff(tables.colour_offsets)
        counts = np.zeros(words.PHASES, dtype=np.int32)
        counts[words.CLEAR] = blocks
        alone = -(-int(self._control[words.APART]) // words.BLOCKS_A_TICKET)
        counts[words.UPDATE] = self._control[words.PLACES] + alone
        counts[words.MOVE] = -(-self._count // words.POINTS_A_TICKET)
        counts[words.CARRY] = -(-int(self._control[words.TRACERS]) // words.POINTS_A_TICKET)
        counts[words.SCATTER : words.SCATTER + COLOURS] = tiles
        if self._averaged:
            counts[words.AVERAGE : words.AVERAGE + COLOURS] = tiles
            counts[words.DIVIDE] = blocks
        return np.concatenate([[0], np.cumsum(counts)])

    def set_walls(self, lower: Array, upper: Array) -> None:
        """Hold points and nodes within a box [m] from now on."""
        self._control[words.CLAMP] = 1
        self._batch[words.WALL_LOW : words.WALL_LOW + 3] = self.units.cells(lower)
        self._batch[words.WALL_HIGH : words.WALL_HIGH + 3] = self.units.cells(upper)

    def set_fields(self, numbers: Array) -> None:
        """Set the distance fields (M,) that rows of what acts name."""
        self._fields = self._memory.put(numbers)

    def begin_batch(self, step: float, gravity: Array, forcing: Forcing, looks: int = 1) -> None:
        """Set what acts during the next steps of `step` [s] each, besides gravity (3,) [m/s^2].

        At the first and then every `looks` steps it is looked how far apart bodies are.
        """
        runtime.require(self._runtime)
        self._batch[words.STEP] = self._batch[words.STEP_VECTOR : words.STEP_VECTOR + 3] = step / self.units.time
        self._batch[words.GRAVITY : words.GRAVITY + 3] = gravity * step / self.units.speed
        self._control[words.LOOKS] = looks
        self._control[words.COLLIDERS] = forcing.colliders.shape[1]
        self._control[words.MOVING] = len(forcing.colliders) > 1
        self._control[words.WINDS_AT] = forcing.colliders.size
        self._control[words.WINDS] = len(forcing.winds)
        self._control[[words.DRIVES, words.BODIES]] = forcing.holding.shape
        self._control[words.HOLDING_AT] = forcing.holding_begin
        self._forcing = self._memory.put(forcing.numbers)
        self._batch_argument = self._memory.put(self._batch) if self._memory.on_gpu else self._batch

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch, or fewer where a point drifts too far from home.

        Returns
        -------
        How many were done, whether a point drifted (it must be sorted before the next), whether the domain's edge
        held a node or a point back.
        """
        runtime.require(self._runtime)
        self._memory.write(self._report, np.zeros(words.REPORT_WIDTH, dtype=np.int32))
        self._control[words.FIRST_STEP] = first
        done = self._launch_by_phase(first, end) if self._memory.on_gpu else self._march(first, end)
        return done, *self.end_stages()

    def _march(self, first: int, end: int) -> int:
        """Steps first..end, or fewer, in as many threads as there are; returns how many."""
        signs = np.zeros(words.HELD + self._threads, dtype=np.int32)
        signs[words.HELD :] = -1
        tickets = self._control[words.PHASES_AT + words.PHASES]
        while signs[words.DONE] < (end - first) * tickets and not signs[words.HALTED]:
            self._kernels.march(
                self._x,
                self._points,
                self._labels,
                self._grid,
                self._means,
                self._tiles,
                self._active,
                self._materials,
                self._batch,
                self._forcing,
                self._fields,
                self._control,
                self._report,
                self._tracers,
                self._homes,
                self._carrier,
                self._met,
                self._scratch,
                signs,
                first,
                end - first,
                self._threads,
            )
        return int(signs[words.DONE] // tickets)

    def _launch_by_phase(self, first: int, end: int) -> int:
        """Steps first..end, or fewer, a launch a phase; returns how many."""
        for step in range(first, end):
            self._launch_scatter()
            self._launch_rest(step)
            if self._memory.get(self._report)[words.DRIFTED]:
                return step + 1 - first
        return end - first

    def _launch_scatter(self) -> None:
        kernels, cloud, control = self._kernels, (self._x, self._points, self._labels), self._put_control()
        kernels.clear(self._grid, self._means, self._active, control)
        if self._averaged:
            kernels.average_atomically(*cloud, self._means, self._materials, control)
            kernels.divide(self._means, self._active, control)
        kernels.scatter_atomically(*cloud, self._grid, self._means, self._materials, self._batch_argument, control)

    def _launch_rest(self, step: int) -> None:
        cloud, control = (self._x, self._points, self._labels), self._put_control()
        acting = (self._materials, self._batch_argument, self._forcing, self._fields, control, self._report)
        carried = (self._tracers, self._homes, self._carrier)
        self._kernels.update_and_move(*cloud, self._grid, *acting, *carried, self._met, self._scratch, step)

    def begin_stages(self, index: int, first: int) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        runtime.require(self._runtime)
        self._memory.write(self._report, np.zeros(words.REPORT_WIDTH, dtype=np.int32))
        self._control[words.FIRST_STEP] = first

    def stage(self, stage: Stage, index: int) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        # Steps are parts of steps where of everything else there is nothing to do.
        kept = self._control.copy()
        if self._memory.on_gpu:
            self._launch_stage(stage, index)
        else:
            tickets = self._control[words.PHASES_AT : words.PHASES_AT + words.PHASES + 1]
            counts = np.where(list(Stage).index(stage) == _STAGES, np.diff(tickets), 0)
            tickets[1:] = np.cumsum(counts)
            if counts.any():
                self._march(index, index + 1)
        self._control[:] = kept

    def _launch_stage(self, stage: Stage, index: int) -> None:
        if stage is Stage.SCATTER:
            self._launch_scatter()
            return
        idle = (words.POINTS, words.TRACERS) if stage is Stage.UPDATE else (words.APART, words.PLACES)
        self._control[list(idle)] = 0
        self._launch_rest(index)

    def end_stages(self) -> tuple[bool, bool]:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        report = self._memory.get(self._report)
        return bool(report[words.DRIFTED]), bool(report[words.CLAMPED])

    def node_rows(self, rows: Array) -> Array:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        return self._memory.get(self._grid)[rows]

    def put_nodes(self, rows: Array, nodes: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        grid = self._memory.get(self._grid)
        grid[rows] = nodes
        self._memory.write(self._grid, grid)

    def put_velocities(self, rows: Array, velocities: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        grid = self._memory.get(self._grid)
        grid[rows, :3] = velocities
        self._memory.write(self._grid, grid)
        if self._control[words.CARRIES]:
            carrier = self._memory.get(self._carrier)
            carrier[rows, :3] = carrier[rows, 3:] * grid[rows, :3]
            self._memory.write(self._carrier, carrier)

    def put_points(self, rows: Array, cells: Array, velocities: Array) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        places, points = self._memory.get(self._x), self._memory.get(self._points)
        points.reshape(-1, words.POINT_ROWS, 4)[rows, words.VELOCITY, :3] = velocities
        places[rows] = self._standing_cells(rows, cells)
        self._memory.write(self._points, points)
        self._memory.write(self._x, places)

    def nudge(self, rows: Array, change: Array, step: float) -> None:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        cells, points = self._memory.get(self._x), self._memory.get(self._points)
        points.reshape(-1, words.POINT_ROWS, 4)[rows, words.VELOCITY, :3] += change.astype(self._host_real)
        cells[rows] += step * change
        self._memory.write(self._points, points)
        self._memory.write(self._x, cells)

    def survey(self) -> Survey:
        """Look at every point."""
        runtime.require(self._runtime)
        self._kernels.survey(
            self._x, self._points, self._labels, self._materials, self._put_control(), self._met, self._chart
        )
        return Survey.of(self._memory.get(self._chart).reshape(-1, at.SURVEY_WIDTH), self.units)

    def close(self) -> None:
        """Leave Taichi to whoever else uses it."""
        runtime.release()
