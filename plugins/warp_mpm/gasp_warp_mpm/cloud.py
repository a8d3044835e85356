"""The points and the grid in Warp's memory: sorted, stepped, surveyed, read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.bodies import Meetings
from gasp_mpm_host.cells import COLOURS, CellTables
from gasp_mpm_host.cloud import SEEDING_PASSES
from gasp_mpm_host.forcing_tables import Forcing
from gasp_mpm_host.rows import Rows, Survey
from gasp_mpm_host.scaling import Units, material_table
from gasp_mpm_host.tracers import TracerRows, TracerTables
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_warp_mpm import runtime
from gasp_warp_mpm.barrier import BARRIER_WIDTH
from gasp_warp_mpm.blocks import BLOCK_NODES
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.kernels import make_kernels
from gasp_warp_mpm.phases import THREADS
from gasp_warp_mpm.runs import RUN
from gasp_warp_mpm.separation import SCRATCH_WIDTH
from gasp_warp_mpm.staging import StagedSteps
from gasp_warp_mpm.tables import CLAMPED, DRIFTED, FIRST_STEP, NEXT_STEP, REPORT_WIDTH, STEPS_DONE, Acting

__all__ = ["Cloud"]

Array = NDArray[Any]

_POINTS_OF_ROW = 16
_ROWS_OF_CHUNK = at.SURVEY_CHUNK // _POINTS_OF_ROW
"""Of a survey on a GPU: points that one thread looks at, and how many threads make a row of the chart."""


class Cloud(StagedSteps):
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
    device
        Warp's device.
    double
        float64 throughout; positions are float64 in any case.
    threads
        Processors to use on the CPU.
    atomic
        Scatter with atomic additions, phase by phase: the way of a GPU.
    native
        The loops over nodes in native code: the way of a CPU.
    """

    def __init__(
        self,
        problem: PointProblem,
        units: Units,
        restart: Mapping[str, Array] | None,
        engine: str,
        *,
        device: Any,
        double: bool,
        threads: int,
        atomic: bool,
        native: bool,
    ) -> None:
        self._atomic = atomic
        threads = 1 if atomic else threads
        super().__init__(problem, units, double=double, threads=threads)
        self._device = device
        self._block = 1 if device.is_cpu else THREADS
        self._runs = -(-self._count // RUN)
        self._real = wp.float64 if double else wp.float32
        self._kernels = make_kernels(
            double, self._kinds, self._averaged, len(self._stands) > 1, atomic=atomic, native=native
        )
        runtime.load(self._kernels.module, device)
        self._types = algebra(self._real)
        self._acting = Acting()
        self.set_fields(np.zeros(1))
        # Zeros, because rows of the chart are wider than what is written, and all of it is looked at.
        self._chart = self._put(np.zeros(self._chunks * at.SURVEY_WIDTH), wp.float64)
        self._meeting = self._put(np.zeros(BARRIER_WIDTH), wp.int32)
        self._yield_address = runtime.yield_address()
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._tables = self._kernels.tables()
        self._tables.count = self._count
        self._tables.materials = self._put(material_table(problem, units), wp.float64)
        self._tables.report = self._put(np.zeros(REPORT_WIDTH), wp.int32)
        self._tables.means = self._empty(1, self._types.vec2)
        self._tables.carrier = self._empty(1, self._types.vec4)
        self._tables.scratch = self._empty(1, self._real)
        self._no_tiles = self._put(np.zeros(COLOURS + 1), wp.int32)
        self._begin(problem, restart, engine)

    # ---- memory -----------------------------------------------------------------------------------------------------

    def _put(self, host: Array, kind: Any) -> Any:
        return wp.array(host, dtype=kind, device=self._device)

    def _empty(self, size: int, kind: Any) -> Any:
        return wp.empty(size, dtype=kind, device=self._device)

    def _launch(self, kernel: Any, size: int, *inputs: Any) -> None:
        inputs = (self._tables, *inputs)
        wp.launch(kernel, dim=size, inputs=inputs, device=self._device, block_dim=self._block)

    def _command(self, kernel: Any, size: int, *inputs: Any) -> Any:
        inputs = (self._tables, *inputs)
        return wp.launch(kernel, dim=size, inputs=inputs, device=self._device, block_dim=self._block, record_cmd=True)

    def _load(self, rows: Rows) -> None:
        tables = self._tables
        tables.x = self._put(rows.cells, wp.vec3d)
        tables.points = self._put(rows.points.reshape(-1), self._real)
        tables.labels = self._put(rows.labels.reshape(-1), wp.int32)
        self._spare = (
            self._empty(self._count, wp.vec3d),
            self._empty(rows.points.size, self._real),
            self._empty(rows.labels.size, wp.int32),
        )

    def _cell_rows(self) -> Array:
        return self._tables.x.numpy()

    def _point_rows(self) -> Array:
        """On the CPU the very memory, on a GPU a copy."""
        return self._tables.points.numpy().reshape(-1, at.POINT_WIDTH)

    def _write_points(self, points: Array) -> None:
        if not self._device.is_cpu:
            self._tables.points.assign(points.reshape(-1))

    def _velocity_rows(self) -> Array:
        return self._point_rows()[:, at.VELOCITY : at.VELOCITY + 3]

    def _label_rows(self) -> Array:
        return self._tables.labels.numpy().reshape(-1, at.LABEL_WIDTH)

    def _load_tracers(self, rows: TracerRows) -> None:
        self._tables.tracers = self._put(rows.cells, wp.vec3d)
        self._tables.tracer_homes = self._put(rows.homes.reshape(-1), wp.int32)

    def _tracer_rows(self) -> TracerRows:
        tables = self._tables
        return TracerRows(
            cells=tables.tracers.numpy(), homes=tables.tracer_homes.numpy().reshape(-1, 3), ids=self._tracer_ids
        )

    # ---- order ------------------------------------------------------------------------------------------------------

    def _place(self, cells: Array) -> None:
        self._tables.x = self._put(cells, wp.vec3d)

    def _settle(self) -> None:
        self._launch(self._kernels.order.settle, self._count)

    def _permute(self, order: Array) -> None:
        self._permute_by(self._put(order, wp.int32))

    def _permute_by(self, order: Any) -> None:
        self._launch(self._kernels.order.permute, self._count, order, *self._spare)
        tables, spare = self._tables, self._spare
        self._spare = (tables.x, tables.points, tables.labels)
        tables.x, tables.points, tables.labels = spare

    def _set_grid(self, found: CellTables, stands: Array) -> None:
        tables = self._tables
        tables.lower, tables.shape = wp.vec3i(*found.lower.tolist()), wp.vec3i(*found.shape.tolist())
        tables.tiles = self._put(found.tiles.reshape(-1), wp.int32)
        tables.colours = self._put(found.colour_offsets, wp.int32)
        tables.stands = self._put(stands.reshape(-1), wp.int32)

    def _make_room(self, nodes: int) -> None:
        tables = self._tables
        # One more, because native code reads nodes four at a time.
        tables.grid = self._empty(nodes + 1, self._types.vec4)
        if self._flowing:
            tables.carried = self._empty(nodes + 1, self._types.vec4)
        if self._averaged:
            tables.means = self._empty(nodes, self._types.vec2)
        if self._traced:
            tables.carrier = self._empty(nodes + 1, self._types.vec4)

    def _set_active(self, woken: TracerTables, found: CellTables, met: Meetings) -> None:
        tables = self._tables
        tables.tracer_count, tables.carries = woken.awake, int(woken.awake > 0)
        tables.active, tables.active_count = self._put(woken.active, wp.int32), len(woken.active)
        tables.apart, tables.apart_count = self._put(met.apart, wp.int32), len(met.apart)
        tables.apart_bodies = self._put(met.apart_bodies, wp.int32)
        tables.member_bodies = self._put(met.member_bodies, wp.int32)
        tables.members, tables.places = self._put(met.members, wp.int32), self._put(met.places, wp.int32)
        tables.place_count = len(met.places) - 1
        tables.pairs, tables.friction = self._put(met.pairs.reshape(-1), wp.int32), self._put(met.friction, wp.float64)
        tables.pair_begins = self._put(met.pair_begins, wp.int32)
        tables.near, tables.near_begins = self._put(met.near, wp.int32), self._put(met.near_begins, wp.int32)
        room = BLOCK_NODES * SCRATCH_WIDTH * len(met.pairs)
        if len(tables.scratch) < room:
            tables.scratch = self._empty(room + room // 2, self._real)

    # ---- stepping ---------------------------------------------------------------------------------------------------

    def _seed(self) -> None:
        self._tables.report.zero_()
        for _ in range(SEEDING_PASSES):
            self._scatter()
            self._launch(self._kernels.settle_nodes, self._tables.active_count)
            self._launch(self._kernels.learn_affine, self._count)
        self._launch(self._kernels.strain, self._count)

    def _scatter(self) -> None:
        """Mass and momentum of the points on an empty grid."""
        if self._atomic:
            self._scatter_by_phase()
        else:
            self._launch(self._kernels.scatter_in_order, 1, self._meeting)

    def _scatter_by_phase(self) -> None:
        phases, nodes = self._kernels.phases, BLOCK_NODES * self._tables.active_count
        self._launch(phases.clear, nodes)
        if self._averaged:
            self._launch(phases.average, self._runs)
            self._launch(phases.divide, nodes)
        self._launch(phases.scatter, self._runs)

    def set_walls(self, lower: Array, upper: Array) -> None:
        """Hold points and nodes within a box [m] from now on."""
        self._acting.clamp = 1
        self._acting.wall_low = wp.vec3d(*self.units.cells(lower).tolist())
        self._acting.wall_high = wp.vec3d(*self.units.cells(upper).tolist())

    def set_fields(self, numbers: Array) -> None:
        """Set the distance fields (M,) that rows of what acts name."""
        self._acting.fields = self._put(numbers, wp.float64)

    def begin_batch(self, step: float, gravity: Array, forcing: Forcing, looks: int = 1) -> None:
        """Set what acts during the next steps of `step` [s] each, besides gravity (3,) [m/s^2].

        At the first and then every `looks` steps it is looked how far apart bodies are.
        """
        self._tables.step = step / self.units.time
        acting = self._acting
        acting.looks = looks
        acting.gravity = wp.vec3d(*(gravity * step / self.units.speed).tolist())
        acting.colliders, acting.winds = forcing.colliders.shape[1], len(forcing.winds)
        acting.drives, acting.bodies = forcing.holding.shape
        acting.moving, acting.wind_begin = int(len(forcing.colliders) > 1), forcing.colliders.size
        acting.holding_begin = forcing.holding_begin
        acting.forcing = self._put(forcing.numbers, wp.float64)

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch, or fewer where a point drifts too far from home.

        Returns
        -------
        How many were done, whether a point drifted (it must be sorted before the next), whether the domain's edge
        held a node or a point back.
        """
        self._begin_report(first, first)
        if self._atomic:
            self._steps_by_phase(first, end)
        else:
            self._steps_in_threads(first, end)
        report = self._tables.report.numpy()
        return int(report[STEPS_DONE]), bool(report[DRIFTED]), bool(report[CLAMPED])

    def _begin_report(self, index: int, first: int) -> None:
        report = np.zeros(REPORT_WIDTH, dtype=np.int32)
        report[[NEXT_STEP, FIRST_STEP]] = index, first
        self._tables.report.assign(report)

    def _steps_in_threads(self, first: int, end: int) -> None:
        def share(worker: int) -> Any:
            mine = [first, end - first, worker, self._threads, self._meeting, self._yield_address]
            return self._command(self._kernels.steps, 1, self._acting, *mine)

        self._together([share(worker) for worker in range(self._threads)])

    def _together(self, shares: Sequence[Any]) -> None:
        """Launch kernels at once, a thread each. All of them are made before: if one never came, others might wait."""
        others = [self._pool.submit(each.launch) for each in shares[1:]] if self._pool else []
        shares[0].launch()
        for other in others:
            other.result()

    def _steps_by_phase(self, first: int, end: int) -> None:
        phases, tables = self._kernels.phases, self._tables
        with runtime.capture(self._device) as capture:
            self._scatter_by_phase()
            self._launch(phases.update, BLOCK_NODES * tables.apart_count, self._acting)
            if tables.place_count:
                self._launch(phases.meet, tables.place_count, self._acting)
            self._launch(phases.move, self._count, self._acting)
            if tables.tracer_count > 0:
                self._launch(phases.carry, tables.tracer_count, self._acting)
            self._launch(phases.finish, 1)
        # Kept until the next one: a GPU may still be at it when this returns.
        self._step = capture.graph
        for _ in range(first, end):
            wp.capture_launch(self._step)

    # ---- reading ----------------------------------------------------------------------------------------------------

    def survey(self) -> Survey:
        """Look at every point."""
        kernels, chunks = self._kernels.survey, self._chunks
        if self._atomic:
            # More threads than rows of the chart, and a second look over what they found.
            rows = self._empty(len(self._chart) * _ROWS_OF_CHUNK, wp.float64)
            count, size = -(-self._count // _POINTS_OF_ROW), _POINTS_OF_ROW
            self._launch(kernels.survey, count, rows, 0, size)
            self._launch(kernels.condense, chunks, rows, count, _ROWS_OF_CHUNK, self._chart)
        else:
            ends = [chunks * worker // self._threads for worker in range(self._threads + 1)]
            self._together(
                [
                    self._command(kernels.survey, end - begin, self._chart, begin, at.SURVEY_CHUNK)
                    for begin, end in pairwise(ends)
                    if end > begin
                ]
            )
        return Survey.of(self._chart.numpy().reshape(-1, at.SURVEY_WIDTH), self.units)

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
