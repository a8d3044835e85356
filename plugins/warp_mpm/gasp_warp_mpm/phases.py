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
from gasp_warp_mpm.rows import make_rows
from gasp_warp_mpm.runs import RUN, make_runs
from gasp_warp_mpm.tables import DRIFTED, HALTED, NEXT_STEP, STEPS_DONE, Acting, tables_of

__all__ = ["THREADS", "make_phases"]

THREADS = 64
"""Of a block on a GPU. The module is compiled for it: for a launch of another number Warp compiles it once more."""


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
    """Kernels clear, scatter, update, move, carry, finish; where it is `averaged`, average and divide; meet, if given;
    and those of `rows`.

    They are in Warp's module `module`.
    """
    Tables = tables_of(wp.float64 if double else wp.float32)
    keep_pressures = transfers.keep_pressures
    runs = make_runs(double, averaged)
    give, give_carried, give_dilation = runs.give, runs.give_carried, runs.give_dilation
    block_corner, clear_node = blocks.block_corner, blocks.clear_node
    lone_corner = blocks.lone_corner
    divide_node, update_node = blocks.divide_node, blocks.update_node

    @wp.kernel(module=module, enable_backward=False)
    def clear(s: Tables):
        """Empty a node of an active block."""
        if s.report[HALTED] == 0:
            clear_node(s, block_corner(s, wp.tid() // BLOCK_NODES), wp.tid() % BLOCK_NODES)

    @wp.kernel(module=module, enable_backward=False)
    def scatter(s: Tables):
        """A run of points to the grid."""
        if s.report[HALTED] == 0:
            begin = wp.tid() * RUN
            end = wp.min(begin + RUN, s.count)
            if averaged:
                keep_pressures(s, begin, end)
            give(s, begin, end)
            if flowing:
                give_carried(s, begin, end)

    @wp.kernel(module=module, enable_backward=False)
    def update(s: Tables, acting: Acting):
        """What acts on a node of an active block."""
        if s.report[HALTED] == 0:
            block = wp.tid() // BLOCK_NODES
            corner, body = lone_corner(s, block), s.apart_bodies[block]
            update_node(s, acting, s.report[NEXT_STEP], corner, body, wp.tid() % BLOCK_NODES)

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

    phases = make_rows(module, double)
    vars(phases).update(clear=clear, scatter=scatter, update=update, move=move, carry=carry, finish=finish)
    if meet is not None:

        @wp.kernel(module=module, enable_backward=False)
        def meet_all(s: Tables, acting: Acting):
            """What acts on the nodes of a place of several bodies, and their contact."""
            if s.report[HALTED] == 0:
                meet(s, acting, s.report[NEXT_STEP], wp.tid())

        phases.meet = meet_all
    if averaged:

        @wp.kernel(module=module, enable_backward=False)
        def average(s: Tables):
            """The dilations of a run of points to the grid."""
            if s.report[HALTED] == 0:
                begin = wp.tid() * RUN
                give_dilation(s, begin, wp.min(begin + RUN, s.count))

        @wp.kernel(module=module, enable_backward=False)
        def divide(s: Tables):
            """Sums of dilations to means, at a node of an active block."""
            if s.report[HALTED] == 0:
                divide_node(s, block_corner(s, wp.tid() // BLOCK_NODES), wp.tid() % BLOCK_NODES)

        phases.average, phases.divide = average, divide
    return phases
