"""The points and the grid in the kernels' memory: sorted, stepped, surveyed, read back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.mpm import averaged_lame
from gasp_core.errors import SceneError
from gasp_taichi_mpm import layout as at
from gasp_taichi_mpm.cells import COLOURS, arrange
from gasp_taichi_mpm.kernels import make_kernels
from gasp_taichi_mpm.memory import Memory
from gasp_taichi_mpm.scaling import Units, material_table

__all__ = ["Cloud", "FarAwayError", "Survey"]

Array = NDArray[Any]

_NODE_LIMIT = 2**28
_SEEDING_PASSES = 16
_CELL_LIMIT = 2.0**30
"""Cells from the anchor, so that integer cells never overflow."""


class FarAwayError(Exception):
    """A point is too many cells away to be given a cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What the next step depends on, in SI units.

    Parameters
    ----------
    finite
        Whether every velocity, position and deformation gradient is.
    stress
        Smallest stable step at the points' present stretch [s].
    speed, velocity_gradient
        Largest |v| [m/s] and |C| [1/s].
    inverted
        Points whose deformation gradient has a determinant <= 0.
    low, high : (3,) [m]
        The points' bounding box.
    """

    finite: bool
    stress: float
    speed: float
    velocity_gradient: float
    inverted: int
    low: Array
    high: Array


class Cloud:
    """The state of a session.

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
    on_gpu
        Run on the GPU.
    restart
        Arrays as `checkpoint` gave them.
    """

    def __init__(
        self,
        problem: PointProblem,
        units: Units,
        *,
        double: bool,
        threads: int,
        on_gpu: bool,
        restart: Mapping[str, Array] | None,
    ) -> None:
        self.units = units
        self.real = np.float64 if double else np.float32
        self.count = len(problem.points)
        self._serial = threads == 1 and not on_gpu
        self._memory = Memory(on_gpu=on_gpu)
        used = np.unique(problem.points.material_ids)
        kinds = frozenset(problem.materials[index].kind for index in used)
        self._averaged = any(averaged_lame(problem.materials[index]) > 0 for index in used)
        self._kernels = make_kernels(double, kinds, threads, on_gpu, self._averaged)
        self._fluid = np.array([material.kind == "fluid" for material in problem.materials])
        self._materials = self._memory.put(material_table(problem, units))
        self._control = np.zeros(at.CONTROL_WIDTH, dtype=np.int32)
        self._control[at.POINTS] = self.count
        self._batch = np.zeros(at.BATCH_WIDTH)
        self._grid: Any = None
        self._means: Any = self._memory.empty((1, 2), self.real)
        self._capacity = 0
        chunks = -(-self.count // at.SURVEY_CHUNK)
        self._chart = self._memory.put(np.zeros(chunks * at.SURVEY_WIDTH))
        self._report = self._memory.put(np.zeros(at.REPORT_WIDTH, dtype=np.int32))
        if restart is None:
            self._begin(problem)
        else:
            self._resume(restart)

    def _begin(self, problem: PointProblem) -> None:
        rows = np.zeros((self.count, at.POINT_WIDTH), dtype=self.real)
        rows[:, at.VELOCITY : at.VELOCITY + 3] = problem.points.initial_velocities / self.units.speed
        rows[:, at.MASS] = problem.masses / self.units.mass
        rows[:, [at.DEFORMATION, at.DEFORMATION + 4, at.DEFORMATION + 8]] = 1
        labels = np.zeros((self.count, at.LABEL_WIDTH), dtype=np.int32)
        labels[:, at.MATERIAL] = problem.points.material_ids
        self.ids = np.arange(self.count, dtype=np.int32)
        self._load(self.units.cells(problem.points.reference_positions), rows, labels)
        self.sort()
        # Started with C = 0, a spinning block would hide a part of its angular momentum. Every pass takes C from the
        # field that the velocities and the last C make together; the passes converge geometrically.
        self._batch_argument = self._memory.put(self._batch)
        for _ in range(_SEEDING_PASSES):
            self._scatter(self._put_control())
            self._kernels.learn_affine(self._x, self._points, self._grid, self._active, self._put_control())
        self._kernels.strain(self._points, self._labels, self._materials, self._put_control())

    def _scatter(self, control: Any) -> None:
        """Empty the grid and put mass and momentum of the points on it."""
        kernels, cloud = self._kernels, (self._x, self._points, self._labels)
        kernels.clear(self._grid, self._means, self._active, control)
        if self._averaged:
            if self._memory.on_gpu:
                kernels.average_atomically(*cloud, self._means, self._materials, control)
            else:
                for colour in range(COLOURS):
                    kernels.average_colour(*cloud, self._means, self._tiles, self._materials, control, colour)
            kernels.divide(self._means, self._active, control)
        laws = (self._materials, self._batch_argument, control)
        if self._memory.on_gpu:
            kernels.scatter_atomically(*cloud, self._grid, self._means, *laws)
            return
        for colour in range(COLOURS):
            kernels.scatter_colour(*cloud, self._grid, self._means, self._tiles, *laws, colour)

    def _load(self, cells: Array, rows: Array, labels: Array) -> None:
        put, empty = self._memory.put, self._memory.empty
        self._x, self._x_spare = put(cells), empty(cells.shape, np.float64)
        self._points, self._points_spare = put(rows.reshape(-1)), empty((rows.size,), self.real)
        self._labels, self._labels_spare = put(labels.reshape(-1)), empty((labels.size,), np.int32)

    def _resume(self, restart: Mapping[str, Array]) -> None:
        shapes = {
            "cells": (self.count, 3),
            "rows": (self.count, at.POINT_WIDTH),
            "labels": (self.count, at.LABEL_WIDTH),
            "ids": (self.count,),
            "layout": (),
        }
        for name, shape in shapes.items():
            found = np.shape(restart[name]) if name in restart else None
            if found != shape:
                raise SceneError(
                    f"taichi-mpm: checkpoint array {name!r} has shape {found}, expected {shape}:"
                    " the checkpoint belongs to another scene, engine or version; start without it"
                )
        if restart["layout"] != at.LAYOUT:
            raise SceneError(
                f"taichi-mpm: the checkpoint has layout {restart['layout']}, this version reads {at.LAYOUT}:"
                " go on with the version that wrote it, or start without it"
            )
        if restart["rows"].dtype != self.real:
            raise SceneError(
                f"taichi-mpm: the checkpoint holds {restart['rows'].dtype}, the session was opened in"
                f" {np.dtype(self.real)}: resume with the precision the run was started with"
            )
        self.ids = np.array(restart["ids"], dtype=np.int32)
        labels = np.array(restart["labels"], dtype=np.int32)
        self._load(np.asarray(restart["cells"], dtype=np.float64), np.asarray(restart["rows"]), labels)
        self._tabulate(labels[:, at.HOME : at.HOME + 3])

    def checkpoint(self) -> dict[str, Array]:
        """The state, in the engine's own order and units, so that a resumed run is equal bit for bit."""
        get = self._memory.get
        return {
            "cells": get(self._x).copy(),
            "rows": get(self._points).reshape(-1, at.POINT_WIDTH).copy(),
            "labels": get(self._labels).reshape(-1, at.LABEL_WIDTH).copy(),
            "ids": self.ids.copy(),
            "layout": np.array(at.LAYOUT),
        }

    def _put_control(self) -> Any:
        return self._memory.put(self._control) if self._memory.on_gpu else self._control

    def sort(self) -> None:
        """Put the points into the order of the cells they are in, on a grid that fits them.

        Raises
        ------
        FarAwayError, GridTooLargeError
            Where they have no cell, or the grid would be too large.
        """
        if not float(np.abs(self._memory.get(self._x)).max()) < _CELL_LIMIT:
            raise FarAwayError
        self._kernels.settle(self._x, self._labels, self._put_control())
        home = self._memory.get(self._labels).reshape(-1, at.LABEL_WIDTH)[:, at.HOME : at.HOME + 3]
        order = self._tabulate(home)
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
        self.ids = self.ids[order]

    def _tabulate(self, home: Array) -> Array:
        """Fit the grid and the lists of blocks to the points' homes; returns the sorted order."""
        tables = arrange(home, _NODE_LIMIT)
        self._control[at.LOWER : at.LOWER + 3] = tables.lower
        self._control[at.SHAPE : at.SHAPE + 3] = tables.shape
        self._control[at.ACTIVE] = len(tables.active)
        self._control[at.COLOURS_AT : at.COLOURS_AT + 9] = tables.colour_offsets
        self._tiles = self._memory.put(tables.tiles.reshape(-1))
        self._active = self._memory.put(tables.active)
        nodes = int(np.prod(tables.shape))
        if nodes > self._capacity:
            # Some room to grow into; what is never touched costs no memory.
            self._capacity = min(_NODE_LIMIT, nodes + nodes // 2)
            self._grid = None
            self._grid = self._memory.empty((self._capacity, 4), np.float64)
            if self._averaged:
                self._means = None
                self._means = self._memory.empty((self._capacity, 2), self.real)
        return tables.order

    def set_walls(self, lower: Array, upper: Array) -> None:
        """Hold points and nodes within a box [m] from now on."""
        self._control[at.CLAMP] = 1
        self._batch[at.WALL_LOW : at.WALL_LOW + 3] = self.units.cells(lower)
        self._batch[at.WALL_HIGH : at.WALL_HIGH + 3] = self.units.cells(upper)

    def begin_batch(
        self, step: float, gravity: Array, colliders: Array, winds: Array, drives: Array, drive_count: int
    ) -> None:
        """Set what acts during the next steps of `step` [s] each; `drives` holds `drive_count` rows for every step."""
        self._batch[at.STEP] = step / self.units.time
        self._batch[at.GRAVITY : at.GRAVITY + 3] = gravity * step / self.units.speed
        self._control[at.COLLIDERS] = len(colliders)
        self._control[at.WINDS] = len(winds)
        self._control[at.DRIVES] = drive_count
        rows = np.concatenate([colliders.reshape(-1), winds.reshape(-1), drives.reshape(-1), np.zeros(1)])
        self._forcing = self._memory.put(rows)
        self._batch_argument = self._memory.put(self._batch) if self._memory.on_gpu else self._batch

    def steps(self, first: int, end: int) -> tuple[int, bool, int]:
        """Do steps first..end of the batch, or fewer where a point drifts too far from home.

        Returns
        -------
        How many were done, whether a point drifted (it must be sorted before the next), how often the domain's edge
        held a node or a point back.
        """
        self._memory.write(self._report, np.zeros(at.REPORT_WIDTH, dtype=np.int32))
        control, moved = self._put_control(), (self._x, self._points, self._labels, self._grid)
        acting = (self._materials, self._batch_argument, self._forcing, control, self._report)
        done = 0
        if self._serial:
            self._kernels.steps_in_thread(*moved, self._means, self._tiles, self._active, *acting, first, end - first)
            done = int(self._report[at.STEPS_DONE])
        else:
            for step in range(first, end):
                self._scatter(control)
                self._kernels.update_and_move(*moved, self._active, *acting, step)
                done += 1
                if self._memory.get(self._report)[at.DRIFTED]:
                    break
        report = self._memory.get(self._report)
        return done, bool(report[at.DRIFTED]), int(report[at.CLAMPED])

    def survey(self) -> Survey:
        """Look at every point."""
        self._kernels.survey(self._x, self._points, self._labels, self._materials, self._put_control(), self._chart)
        chart = self._memory.get(self._chart).reshape(-1, at.SURVEY_WIDTH)
        stiffness = float(chart[:, at.SURVEY_STIFFNESS].max())
        return Survey(
            # Chunks report maxima of finite points alone; an overflow of the maxima themselves is not finite either.
            finite=not chart[:, at.SURVEY_BAD].any() and bool(np.isfinite(chart).all()),
            stress=1 / math.sqrt(stiffness) if stiffness > 0 else math.inf,
            speed=math.sqrt(float(chart[:, at.SURVEY_SPEED].max())) * self.units.speed,
            velocity_gradient=math.sqrt(float(chart[:, at.SURVEY_GRADIENT].max())) / self.units.time,
            inverted=int(chart[:, at.SURVEY_INVERTED].sum()),
            low=self.units.world(chart[:, at.SURVEY_LOW : at.SURVEY_LOW + 3].min(axis=0)),
            high=self.units.world(chart[:, at.SURVEY_HIGH : at.SURVEY_HIGH + 3].max(axis=0)),
        )

    def _restored(self, values: Array) -> Array:
        """Rows in the order in which the points were given, owned."""
        given = np.empty(values.shape, dtype=np.float64)
        given[self.ids] = values
        return given

    def positions(self) -> Array:
        """(N, 3) [m] in the given order."""
        return self._restored(self.units.world(self._memory.get(self._x)))

    def velocities(self) -> Array:
        """(N, 3) [m/s] in the given order."""
        rows = self._memory.get(self._points).reshape(-1, at.POINT_WIDTH)
        return self._restored(rows[:, at.VELOCITY : at.VELOCITY + 3].astype(np.float64) * self.units.speed)

    def deformation_gradients(self) -> Array:
        """(N, 3, 3) in the given order."""
        rows = self._memory.get(self._points).reshape(-1, at.POINT_WIDTH)
        F = rows[:, at.DEFORMATION : at.DEFORMATION + 9].astype(np.float64).reshape(-1, 3, 3)
        material = self._memory.get(self._labels).reshape(-1, at.LABEL_WIDTH)[:, at.MATERIAL]
        fluid = self._fluid[material]
        F[fluid] = np.cbrt(1 + rows[fluid, at.HISTORY].astype(np.float64))[:, None, None] * np.eye(3)
        return self._restored(F)

    def push(self, members: Array, change: Array) -> None:
        """Add `change` (3,) [m/s] to the velocities of the points `members` (N,) bool, in the given order."""
        rows = self._memory.get(self._points).reshape(-1, at.POINT_WIDTH)
        rows[members[self.ids], at.VELOCITY : at.VELOCITY + 3] += (change / self.units.speed).astype(self.real)
        if self._memory.on_gpu:
            self._memory.write(self._points, rows.reshape(-1))
