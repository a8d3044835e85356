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
from gasp_core.stepping.mpm import averaged_lame
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import CellTables, arrange
from gasp_mpm_host.rows import DAMAGED, Rows
from gasp_mpm_host.scaling import Units
from gasp_mpm_host.session import FarAwayError
from gasp_mpm_host.tracers import TRACER_MARGIN, TracerRows, TracerTables, arrange_tracers

__all__ = ["SEEDING_PASSES", "SortedCloud"]

Array = NDArray[Any]

SEEDING_PASSES = 16
"""Of `SortedCloud._seed`."""
_NODE_LIMIT = 2**28
_CELL_LIMIT = 2.0**30
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
        self._fluids = np.array([material.kind == "fluid" for material in materials])
        self._traced = 0 if points.tracer_positions is None else len(points.tracer_positions)
        self._capacity = 0

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
        self._load(rows)
        self._load_tracers(tracers)
        self._ids, self._tracer_ids = rows.ids, tracers.ids
        if restart is None:
            self.sort()
            self._seed()
        else:
            found = self._tabulate(rows.labels[:, at.HOME : at.HOME + 3])
            if not np.array_equal(found.order, np.arange(self._count)):
                raise SceneError(f"{engine}: the checkpoint's points are not in the order of their cells: {DAMAGED}")
            self._wake(tracers, found)

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
    def _label_rows(self) -> Array:
        """(N, `layout.LABEL_WIDTH`) int32, as in `Rows.labels`."""

    @abstractmethod
    def _tracer_rows(self) -> TracerRows:
        """The tracers as they are."""

    @abstractmethod
    def _settle(self) -> None:
        """Give every point the cell it is in for its home."""

    @abstractmethod
    def _permute(self, order: Array) -> None:
        """Put the points into the order of the rows `order` (N,) int32."""

    @abstractmethod
    def _set_grid(self, found: CellTables) -> None:
        """From now on the grid and its tiles are these."""

    @abstractmethod
    def _make_room(self, nodes: int) -> None:
        """Replace the memory of the grid by one of so many nodes, its content undefined."""

    @abstractmethod
    def _set_active(self, woken: TracerTables, found: CellTables) -> None:
        """From now on these blocks are active and these tracers awake, on the grid of `found`."""

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
        if not float(np.abs(self._cell_rows()).max()) < _CELL_LIMIT:
            raise FarAwayError
        self._settle()
        found = self._tabulate(self._label_rows()[:, at.HOME : at.HOME + 3])
        self._permute(found.order)
        self._ids = self._ids[found.order]
        self._wake(self._tracer_rows().settled(), found)

    def _tabulate(self, home: Array) -> CellTables:
        """Fit the grid and the tiles to the points' homes."""
        found = arrange(home, _NODE_LIMIT, TRACER_MARGIN if self._traced else 0)
        self._set_grid(found)
        nodes = int(np.prod(found.shape))
        if nodes > self._capacity:
            # Some room to grow into; what is never touched costs no memory.
            self._capacity = min(_NODE_LIMIT, nodes + nodes // 2)
            self._make_room(self._capacity)
        return found

    def _wake(self, rows: TracerRows, found: CellTables) -> None:
        """Sort the tracers, and make the blocks active that they read."""
        woken = arrange_tracers(rows.homes, found)
        rows = rows.sorted(woken.order)
        self._load_tracers(rows)
        self._tracer_ids = rows.ids
        self._set_active(woken, found)

    # ---- reading ----------------------------------------------------------------------------------------------------

    def _rows(self) -> Rows:
        """The points as they are, in the engine's own order."""
        return Rows(cells=self._cell_rows(), points=self._point_rows(), labels=self._label_rows(), ids=self._ids)

    def positions(self) -> Array:
        """(N, 3) [m], in the given order."""
        positions = np.empty((self._count, 3))
        positions[self._ids] = self.units.world(self._cell_rows())
        return positions

    def velocities(self) -> Array:
        """(N, 3) [m/s], in the given order."""
        return self._rows().velocities(self.units)

    def deformation_gradients(self) -> Array:
        """(N, 3, 3), in the given order."""
        return self._rows().deformation_gradients(self._fluids)

    def tracer_positions(self) -> Array:
        """(M, 3) [m], in the given order."""
        return self._tracer_rows().positions(self.units)

    def checkpoint(self) -> dict[str, Array]:
        """The state, in the engine's own order and units."""
        return self._rows().checkpoint() | self._tracer_rows().checkpoint()
