"""A step as a GPU does it: a kernel a phase, a thread for each point or node, and no word with the host in between.

What is launched after the step in which a point drifted too far from home does nothing (`HALTED`), so that a whole
batch can be launched before the host looks. The kernels of a step take the same arguments at every step: they are
captured once and replayed.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from types import SimpleNamespace
from typing import Any

import warp as wp

from gasp_warp_mpm.blocks import BLOCK_NODES
from gasp_warp_mpm.pool import make_pool
from gasp_warp_mpm.tables import DRIFTED, HALTED, NEXT_STEP, STEPS_DONE, Acting, tables_of

__all__ = ["make_phases"]


def make_phases(
    module: Any,
    double: bool,
    averaged: bool,
    flowing: bool,
    meet: Any,
    *,
    transfers: SimpleNamespace,
    blocks: SimpleNamespace,
    move_point: Any,
    carry_one: Any,
) -> SimpleNamespace:
    """Kernels clear, scatter, update, move, carry, finish; where it is `averaged`, average and divide; meet, if given.

    They are in Warp's module `module`.
    """
    Tables = tables_of(wp.float64 if double else wp.float32)
    scatter_one, scatter_dilation = transfers.scatter, transfers.scatter_dilation
    scatter_carried = transfers.scatter_carried
    block_corner, clear_node = blocks.block_corner, blocks.clear_node
    lone_corner = blocks.lone_corner
    divide_node, update_node = blocks.divide_node, blocks.update_node
    pooled = make_pool(double)
    open_pool, corner_of, share_of = pooled.open_pool, pooled.corner_of, pooled.share_of
    give_sums, give_mean_sums = pooled.give_sums, pooled.give_mean_sums

    @wp.kernel(module=module, enable_backward=False)
    def clear(s: Tables):
        """Empty a node of an active block."""
        if s.report[HALTED] == 0:
            clear_node(s, block_corner(s, wp.tid() // BLOCK_NODES), wp.tid() % BLOCK_NODES)

    @wp.kernel(module=module, enable_backward=False)
    def scatter(s: Tables, lanes: int):
        """The points of a tile to the grid, `lanes` threads together."""
        if s.report[HALTED] == 0:
            tile, lane = wp.tid() // lanes, wp.tid() % lanes
            begin = s.tiles[2 * tile]
            corner = corner_of(s, begin)
            pool = open_pool(lane, lanes)
            first, end = share_of(begin, s.tiles[2 * tile + 1], lane, lanes)
            for p in range(first, end):
                scatter_one(s, p, pool, corner)
            give_sums(s, s.grid, pool, corner, lane, lanes)
            if flowing:
                pool = open_pool(lane, lanes)
                for p in range(first, end):
                    scatter_carried(s, p, pool, corner)
                give_sums(s, s.carried, pool, corner, lane, lanes)

    @wp.kernel(module=module, enable_backward=False)
    def update(s: Tables, acting: Acting):
        """What acts on a node of an active block."""
        if s.report[HALTED] == 0:
            corner = lone_corner(s, wp.tid() // BLOCK_NODES)
            update_node(s, acting, s.report[NEXT_STEP], corner, wp.tid() % BLOCK_NODES)

    @wp.kernel(module=module, enable_backward=False)
    def move(s: Tables, acting: Acting):
        """Grid to a point."""
        if s.report[HALTED] == 0:
            move_point(s, acting, s.report[NEXT_STEP], wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def carry(s: Tables, acting: Acting):
        """Carry a tracer."""
        if s.report[HALTED] == 0:
            carry_one(s, acting, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def finish(s: Tables):
        """Count the step, in one thread."""
        if s.report[HALTED] == 0:
            s.report[STEPS_DONE] = s.report[STEPS_DONE] + 1
            s.report[NEXT_STEP] = s.report[NEXT_STEP] + 1
            s.report[HALTED] = s.report[DRIFTED]

    phases = SimpleNamespace(clear=clear, scatter=scatter, update=update, move=move, carry=carry, finish=finish)
    if meet is not None:

        @wp.kernel(module=module, enable_backward=False)
        def meet_all(s: Tables, acting: Acting):
            """What acts on the nodes of a place of several bodies, and their contact."""
            if s.report[HALTED] == 0:
                meet(s, acting, s.report[NEXT_STEP], wp.tid())

        phases.meet = meet_all
    if averaged:

        @wp.kernel(module=module, enable_backward=False)
        def average(s: Tables, lanes: int):
            """The dilations of a tile to the grid, `lanes` threads together."""
            if s.report[HALTED] == 0:
                tile, lane = wp.tid() // lanes, wp.tid() % lanes
                begin = s.tiles[2 * tile]
                corner = corner_of(s, begin)
                pool = open_pool(lane, lanes)
                first, end = share_of(begin, s.tiles[2 * tile + 1], lane, lanes)
                for p in range(first, end):
                    scatter_dilation(s, p, pool, corner)
                give_mean_sums(s, pool, corner, lane, lanes)

        @wp.kernel(module=module, enable_backward=False)
        def divide(s: Tables):
            """Sums of dilations to means, at a node of an active block."""
            if s.report[HALTED] == 0:
                divide_node(s, block_corner(s, wp.tid() // BLOCK_NODES), wp.tid() % BLOCK_NODES)

        phases.average, phases.divide = average, divide
    return phases
