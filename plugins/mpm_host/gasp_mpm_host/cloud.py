"""Points and a grid in a backend's memory: how a session begins and goes on, how points are sorted, what is read back.

It knows no backend: what the memory is, and what its kernels do in it, is the subclass's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.flow import is_flowing
from gasp_core.stepping.mpm import averaged_lame
from gasp_core.stepping.tracer_bodies import tracer_bodies
from gasp_mpm_host import layout as at
from gasp_mpm_host.bodies import Meetings, alone, bodies_of_columns, home_boxes, meetings, stands_for
from gasp_mpm_host.cells import BLOCK, CellTables, arrange, cell_order, grid_box, tabulate
from gasp_mpm_host.rows import DAMAGED, Rows
from gasp_mpm_host.scaling import Units
from gasp_mpm_host.session import FarAwayError
from gasp_mpm_host.tracers import TRACER_MARGIN, TracerRows, TracerTables, arrange_tracers

__all__ = ["CELL_LIMIT", "SEEDING_PASSES", "SortedCloud"]

Array = NDArray[Any]

SEEDING_PASSES = 16
"""Of `SortedCloud._seed`."""
_NODE_LIMIT = 2**28
CELL_LIMIT = 2.0**30
"""Cells from the anchor, so that integer cells never overflow."""


class SortedCloud(ABC):
    """The state of a session: the part of a `gasp_mpm_host.session.SteppedCloud` that needs no backend.

    A subclass makes its kernels and its memory, then calls `_begin`.

    Parameters
    ----------
    problem
        What is simulated.
    units
        The engine's units.
    double
        float64 throughout; positions are float64 in any case.
    threads
        Processors to use.
    """

    def __init__(self, problem: PointProblem, units: Units, *, double: bool, threads: int) -> None:
        points, materials = problem.points, problem.materials
        used = np.unique(points.material_ids)
        self.units = units
        self._threads = threads
        self._count = len(points)
        self._chunks = -(-self._count // at.SURVEY_CHUNK)
        self._host_real = np.float64 if double else np.float32
        self._kinds = frozenset(materials[index].kind for index in used)
        self._averaged = any(averaged_lame(materials[index]) > 0 for index in used)
        self._flowing = any(is_flowing(materials[index]) for index in used)
        self._fluids = np.array([material.kind == "fluid" for material in materials])
        self._traced = 0 if points.tracer_positions is None else len(points.tracer_positions)
        self._margin = TRACER_MARGIN if self._traced else 0
        self._capacity = 0
        self._problem = problem
        self._bodies = points.body_ids
        self._tracer_bodies = tracer_bodies(points)
        self._stands = np.zeros((int(points.body_ids.max()) + 1, 3), dtype=np.int64)
        flows = np.array([material.kind not in ("elastic", "neo-hookean") for material in materials])
        self._flows = flows[points.material_ids]

    def _begin(self, problem: PointProblem, restart: Mapping[str, Array] | None, engine: str) -> None:
        """Fill the memory with the problem at rest, or with what `checkpoint` gave.

        Raises
        ------
        SceneError
            For a checkpoint of something else; `engine` is who says so.
        FarAwayError, GridTooLargeError
            As `sort`.
        """
        if restart is None:
            rows = Rows.at_rest(problem, self.units, self._host_real)
            tracers = TracerRows.at_rest(problem.points, self.units)
        else:
            rows = Rows.restored(restart, problem.points.material_ids, self._host_real, engine)
            tracers = TracerRows.restored(restart, self._traced, engine)
            self._stands = self._kept_stands(restart, engine)
        self._load(rows)
        self._load_tracers(tracers)
        self._ids, self._tracer_ids = rows.ids, tracers.ids
        if restart is None:
            self.sort()
            self._seed()
        else:
            homes = rows.labels[:, at.HOME : at.HOME + 3]
            found, order = arrange(homes, _NODE_LIMIT, self._margin)
            if not np.array_equal(order, np.arange(self._count)):
                raise SceneError(f"{engine}: the checkpoint's points are not in the order of their cells: {DAMAGED}")
            self._use(found, home_boxes(homes, self._bodies[rows.ids], len(self._stands)))
            self._wake(tracers, found)

    def _kept_stands(self, restart: Mapping[str, Array], engine: str) -> Array:
        """The bodies' stands as `checkpoint` kept them; refused where no run has written them."""
        kept = checkpoint_arrays(restart, {"stands": self._stands.shape}, engine)["stands"]
        whole = np.rint(np.nan_to_num(kept)).astype(np.int64) if np.abs(kept).max() < CELL_LIMIT else None
        if whole is None or (whole != kept).any() or (whole % (2 * BLOCK)).any():
            raise SceneError(f"{engine}: the checkpoint's bodies stand between the cells of the grid: {DAMAGED}")
        return whole

    # ---- what a backend does ----------------------------------------------------------------------------------------

    @abstractmethod
    def _load(self, rows: Rows) -> None:
        """Put the points into memory, and make room for as many to sort them into."""

    @abstractmethod
    def _load_tracers(self, rows: TracerRows) -> None:
        """Put the tracers into memory."""

    @abstractmethod
    def _cell_rows(self) -> Array:
        """(N, 3) float64, as in `Rows.cells`."""

    @abstractmethod
    def _point_rows(self) -> Array:
        """(N, `layout.POINT_WIDTH`), as in `Rows.points`."""

    @abstractmethod
    def _write_points(self, points: Array) -> None:
        """Put rows, (N, `layout.POINT_WIDTH`), as `_point_rows` gave them, back where they are kept."""

    @abstractmethod
    def _velocity_rows(self) -> Array:
        """(N, 3) in the engine's units: on a CPU the very memory."""

    @abstractmethod
    def _label_rows(self) -> Array:
        """(N, `layout.LABEL_WIDTH`) int32, as in `Rows.labels`."""

    @abstractmethod
    def _tracer_rows(self) -> TracerRows:
        """The tracers as they are."""

    @abstractmethod
    def _place(self, cells: Array) -> None:
        """Put the points at `cells` (N, 3) float64, in their present order."""

    @abstractmethod
    def _settle(self) -> None:
        """Give every point the cell it is in for its home."""

    @abstractmethod
    def _permute(self, order: Array) -> None:
        """Put the points into the order of the rows `order` (N,) int32."""

    @abstractmethod
    def _set_grid(self, found: CellTables, stands: Array) -> None:
        """From now on the grid and its tiles are these, `stands` (X, 3) int32 being those of its columns of blocks."""

    @abstractmethod
    def _make_room(self, nodes: int) -> None:
        """Replace the memory of the grid by one of so many nodes, its content undefined."""

    @abstractmethod
    def _set_active(self, woken: TracerTables, found: CellTables, met: Meetings) -> None:
        """From now on these blocks are active, these tracers awake and these bodies near, on the grid of `found`."""

    @abstractmethod
    def _seed(self) -> None:
        """Affine velocities that belong to the velocities, and the stress of the start.

        Started with C = 0, a spinning block would hide a part of its angular momentum. Every one of `SEEDING_PASSES`
        takes C from the field that the velocities and the last C make together; the passes converge geometrically.
        """

    # ---- order ------------------------------------------------------------------------------------------------------

    def sort(self) -> None:
        """Put the points into the order of the cells they are in, on a grid that fits them.

        Raises
        ------
        FarAwayError, GridTooLargeError
            Where they have no cell, or the grid would be too large.
        """
        boxes = self._settled()
        tracers = self._tracer_rows()
        change = self._put_apart(boxes)
        if change.any():
            self._place(self._cell_rows() + change[self._bodies[self._ids]])
            boxes = self._settled()
            tracers = tracers.standing(change[self._tracer_bodies[tracers.ids]])
        lower, shape = grid_box(boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0), _NODE_LIMIT, self._margin)
        found = tabulate(lower, shape, *self._put_in_order(lower, shape))
        self._use(found, boxes)
        self._wake(tracers.settled(), found)

    def _settled(self) -> Array:
        """Give every point the cell it is in for its home; the boxes of these, see `bodies.home_boxes`.

        Raises
        ------
        FarAwayError
            Where a point is too far away for a cell.
        """
        if not float(np.abs(self._cell_rows()).max()) < CELL_LIMIT:
            raise FarAwayError
        self._settle()
        return home_boxes(self._home_rows(), self._bodies[self._ids], len(self._stands))

    def _put_in_order(self, lower: Array, shape: Array) -> tuple[Array, Array]:
        """Put the points into the order of their homes; cells (C,) and counts (C,) as in `CellTables`."""
        order, cells, counts = cell_order(self._home_rows(), lower, shape)
        self._permute(order)
        self._ids = self._ids[order]
        return cells, counts

    def _home_rows(self) -> Array:
        return self._label_rows()[:, at.HOME : at.HOME + 3]

    def _put_apart(self, boxes: Array) -> Array:
        """By how much the stands (B, 3) of the bodies had to change and did; `boxes` are those of their homes."""
        found = stands_for(boxes - self._stands[:, None], self._stands, self._margin)
        change = found - self._stands
        self._stands = found
        return change

    def _use(self, found: CellTables, boxes: Array) -> None:
        """Take these tables from now on; the boxes are those of the homes in them."""
        self._columns = bodies_of_columns(boxes, found, self._margin)
        self._set_grid(found, self._stands[self._columns].astype(np.int32))
        nodes = int(np.prod(found.shape))
        if nodes > self._capacity:
            # Some room to grow into; what is never touched costs no memory.
            self._capacity = min(_NODE_LIMIT, nodes + nodes // 2)
            self._make_room(self._capacity)

    def _wake(self, rows: TracerRows, found: CellTables) -> None:
        """Sort the tracers, make the blocks active that they read, and see which bodies meet."""
        column = (rows.homes[:, 0].astype(np.int64) - found.lower[0]) // BLOCK
        there = self._columns[np.clip(column, 0, len(self._columns) - 1)]
        woken = arrange_tracers(rows.homes, found, there == self._tracer_bodies[rows.ids])
        self._found = found
        rows = rows.sorted(woken.order)
        self._load_tracers(rows)
        self._tracer_ids = rows.ids
        if len(self._stands) == 1:
            met = alone(woken.active, np.zeros(len(woken.active)))
        else:
            met = meetings(self._problem, self._bodies[self._ids], self._stands, woken.active, found)
        self._set_active(woken, found, met)

    # ---- between the stages of a step -------------------------------------------------------------------------------

    def rows_of(self, nodes: Array, bodies: Array) -> Array:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        found = self._found
        x, y, z = (nodes + self._stands[bodies] - found.lower).T
        return (x * found.shape[1] + y) * found.shape[2] + z

    def rows_of_points(self, points: Array) -> Array:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        places = np.empty(self._count, dtype=np.int64)
        places[self._ids] = np.arange(self._count)
        return places[points]

    def _standing_cells(self, rows: Array, cells: Array) -> Array:
        """Places (K, 3) in the scene of points in rows (K,), where the grid has them."""
        return cells + self._stands[self._bodies[self._ids[rows]]] if self._stands.any() else cells

    def all_cells(self) -> Array:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        cells = self._cell_rows()
        return cells - self._stands[self._bodies[self._ids]] if self._stands.any() else cells

    def traits(self, rows: Array) -> tuple[Array, Array, Array, Array]:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        own = self._ids[rows]
        half_widths = 0.5 * np.cbrt(self._problem.points.reference_volumes[own]) / self.units.spacing
        return half_widths, self._problem.masses[own] / self.units.mass, self._bodies[own], self._flows[own]

    def moving(self, rows: Array) -> tuple[Array, Array]:
        """See `gasp_mpm_host.stages.StagedCloud`."""
        return self._scene_cells(rows), self._velocity_rows()[rows].astype(np.float64)

    def _scene_cells(self, rows: Array) -> Array:
        cells = self._cell_rows()[rows]
        return cells - self._stands[self._bodies[self._ids[rows]]] if self._stands.any() else cells

    # ---- writing ----------------------------------------------------------------------------------------------------

    def push(self, members: Array, change: Array) -> None:
        """Add `change` (3,) [m/s] to the velocities of the points `members` (N,) bool, in the given order."""
        points = self._point_rows()
        points[members[self._ids], at.VELOCITY : at.VELOCITY + 3] += (change / self.units.speed).astype(points.dtype)
        self._write_points(points)

    def weigh(self, masses: Array) -> None:
        """Have points count with masses (N,) [kg], in the given order, from now on: with its mass goes its stress."""
        points = self._point_rows()
        points[:, at.MASS] = masses[self._ids] / self.units.mass
        self._write_points(points)

    # ---- reading ----------------------------------------------------------------------------------------------------

    def _rows(self) -> Rows:
        """The points as they are, in the engine's own order."""
        return Rows(cells=self._cell_rows(), points=self._point_rows(), labels=self._label_rows(), ids=self._ids)

    def positions(self) -> Array:
        """(N, 3) [m], in the given order."""
        cells = self._cell_rows()
        if self._stands.any():
            cells = cells - self._stands[self._bodies[self._ids]]
        positions = np.empty((self._count, 3))
        positions[self._ids] = self.units.world(cells)
        return positions

    def velocities(self) -> Array:
        """(N, 3) [m/s], in the given order."""
        return self._rows().velocities(self.units)

    def deformation_gradients(self) -> Array:
        """(N, 3, 3), in the given order."""
        return self._rows().deformation_gradients(self._fluids)

    def tracer_positions(self) -> Array:
        """(M, 3) [m], in the given order."""
        rows = self._tracer_rows()
        return rows.standing(-self._stands[self._tracer_bodies[rows.ids]]).positions(self.units)

    def checkpoint(self) -> dict[str, Array]:
        """The state, in the engine's own order and units."""
        # Where the grid has them: a place without its stand has other digits, and what is rounded away does not come
        # back with the stand.
        kept = {"stands": self._stands.astype(np.float64)}
        return self._rows().checkpoint() | self._tracer_rows().checkpoint() | kept
