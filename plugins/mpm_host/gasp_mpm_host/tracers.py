"""Massless points that the grid carries along: where they are, and which of them anything can move.

A tracer moves with the mean velocity of the nodes around it (`gasp_core.stepping.mpm.presence`). One with no mass in
reach rests: it is left out of the steps until the next sort, and costs nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointCloud
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_mpm_host.cells import BLOCK, CellTables, blocks_in_reach, cell_keys, stable_order
from gasp_mpm_host.rows import DAMAGED
from gasp_mpm_host.scaling import Units

__all__ = ["TRACER_MARGIN", "TracerRows", "TracerTables", "arrange_tracers", "homes_of"]

Array = NDArray[Any]

TRACER_MARGIN = 1
"""Blocks around the points' grid: what a tracer beside matter needs is at most one block farther out."""
_FARTHEST = 2**30
"""In cells: what lies farther rests anyway, and would overflow."""


def homes_of(cells: Array) -> Array:
    """The cells (M, 3) int32 that tracers at `cells` (M, 3) are in."""
    return np.clip(np.floor(cells - 0.5), -_FARTHEST, _FARTHEST).astype(np.int32)


@dataclass(frozen=True, slots=True, kw_only=True)
class TracerTables:
    """The order of the tracers and the blocks that are active with them.

    Parameters
    ----------
    order : (M,) int32
        Rows in their new order: those that something can move by block and cell, then the rest as they were.
    awake : int
        How many something can move.
    active : (B,) int32
        Blocks whose nodes a point or one of these tracers can reach, row-major in the grid's blocks.
    """

    order: Array
    awake: int
    active: Array


def arrange_tracers(home: Array, tables: CellTables, own: Array) -> TracerTables:
    """Tables for tracers with home cells (M, 3) int32, on the points' grid with `TRACER_MARGIN` around it.

    `own` (M,) says which of them are where the body that carries them is.
    """
    blocks = tables.shape // BLOCK
    first, last = tables.lower + 1, tables.lower + tables.shape - 4
    on_grid = np.flatnonzero(((home >= first) & (home <= last)).all(axis=1) & own)
    keys = cell_keys(home[on_grid], tables.lower, blocks)
    sorting = stable_order(keys)
    on_grid, keys = on_grid[sorting], keys[sorting]

    reached = np.zeros(int(np.prod(blocks)), dtype=np.bool_)
    reached[tables.active] = True
    cells, cell_of = np.unique(keys, return_inverse=True)
    near = blocks_in_reach(cells, blocks)
    moved = np.asarray(reached[near].any(axis=0))
    reached[near[:, moved]] = True
    awake = on_grid[moved[cell_of]]
    resting = np.ones(len(home), dtype=np.bool_)
    resting[awake] = False
    return TracerTables(
        order=np.concatenate([awake, np.flatnonzero(resting)]).astype(np.int32),
        awake=len(awake),
        active=np.flatnonzero(reached).astype(np.int32),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TracerRows:
    """Tracers as rows, in the engine's units and its own order.

    Parameters
    ----------
    cells : (M, 3) float64
        Positions.
    homes : (M, 3) int32
        The cells they were in when they were last sorted.
    ids : (M,) int32
        Which of the scene's tracers each row is.
    """

    cells: Array
    homes: Array
    ids: Array

    @classmethod
    def at_rest(cls, points: PointCloud, units: Units) -> Self:
        """Tracers in the order given; none where the scene has none."""
        places = np.zeros((0, 3)) if points.tracer_positions is None else points.tracer_positions
        cells = units.cells(places)
        return cls(cells=cells, homes=homes_of(cells), ids=np.arange(len(cells), dtype=np.int32))

    @classmethod
    def restored(cls, checkpoint: Mapping[str, Array], count: int, engine: str) -> Self:
        """Rows as `checkpoint` kept them.

        Raises
        ------
        SceneError
            Where the checkpoint is of another number of tracers, or says of them what no run has written.
        """
        shapes = {"tracer_cells": (count, 3), "tracer_homes": (count, 3), "tracer_ids": (count,)}
        arrays = checkpoint_arrays(checkpoint, shapes, engine)
        rows = cls(
            cells=arrays["tracer_cells"].astype(np.float64),
            homes=arrays["tracer_homes"].astype(np.int32),
            ids=arrays["tracer_ids"].astype(np.int32),
        )
        named = np.array_equal(np.sort(rows.ids), np.arange(count))
        # The farthest are homes of their own; what has drifted by more than a cell has been given another one.
        there = np.abs(homes_of(rows.cells).astype(np.int64) - rows.homes).max(initial=0) <= 1
        if not (named and there):
            raise SceneError(f"{engine}: the checkpoint's tracers are not those of a run: {DAMAGED}")
        return rows

    def checkpoint(self) -> dict[str, Array]:
        """Copies of everything."""
        return {"tracer_cells": self.cells.copy(), "tracer_homes": self.homes.copy(), "tracer_ids": self.ids.copy()}

    def positions(self, units: Units) -> Array:
        """(M, 3) [m], in the given order, owned."""
        given = np.empty(self.cells.shape)
        given[self.ids] = units.world(self.cells)
        return given

    def standing(self, stands: Array) -> Self:
        """The rows moved, cells and homes, by whole cells (M, 3), see `gasp_mpm_host.bodies`."""
        homes = self.homes.astype(np.int64) + stands
        return replace(self, cells=self.cells + stands, homes=np.clip(homes, -_FARTHEST, _FARTHEST).astype(np.int32))

    def settled(self) -> Self:
        """The rows with the cells they are in now as homes."""
        return replace(self, homes=homes_of(self.cells))

    def sorted(self, order: Array) -> Self:
        """The rows at `order` (M,)."""
        return replace(self, cells=self.cells[order], homes=self.homes[order], ids=self.ids[order])
