"""The kernels of one MLS-MPM step, specialised by precision and by the kinds of material present.

On the CPU one launch takes a batch of steps: its threads draw tickets, each a share of one phase of one step, and do
them in the order of the phases. A launch a phase would cost a fifth of a millisecond each time, to wake threads that
have slept for a few microseconds.
"""

from functools import cache
from types import SimpleNamespace

from gasp_mpm_host import layout as at

from gasp_taichi_mpm import words
from gasp_taichi_mpm.meeting import make_meet
from gasp_taichi_mpm.motion import make_move, make_strain
from gasp_taichi_mpm.nodes import make_node_work
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.survey import make_survey
from gasp_taichi_mpm.tracers import carry
from gasp_taichi_mpm.transfers import make_transfers

__all__ = ["make_kernels"]

_PATIENCE = 20_000
"""Looks at a neighbour's progress before a thread goes to sleep: about as long as it takes to wake one."""


@cache
def make_kernels(double: bool, kinds: frozenset[str], on_gpu: bool, averaged: bool, several: bool) -> SimpleNamespace:
    """Kernels for one precision and set of materials; compiled at first use.

    Parameters
    ----------
    double
        float64 instead of float32 for everything but positions and the grid.
    kinds
        Kinds of material present: what is absent costs neither compilation nor a branch.
    on_gpu
        Scatter with atomics, a point a thread.
    averaged
        Something is nearly incompressible: its dilation is averaged over the nodes before it acts.
    several
        There are several bodies, which may meet.
    """
    real = ti.f64 if double else ti.f32
    Positions = ti.types.ndarray(dtype=ti.types.vector(3, ti.f64), ndim=1)
    Points = ti.types.ndarray(dtype=ti.types.vector(4, real), ndim=1)
    Grid = ti.types.ndarray(dtype=ti.types.vector(4, ti.f64), ndim=1)
    Means = ti.types.ndarray(dtype=ti.types.vector(2, real), ndim=1)
    Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
    Doubles = ti.types.ndarray(dtype=ti.f64, ndim=1)

    flowing = bool(kinds - {"elastic", "neo-hookean"})
    transfers = make_transfers(real, averaged=averaged, flowing=flowing, atomic=on_gpu)
    scatter, scatter_dilation, gather = transfers.scatter, transfers.scatter_dilation, transfers.gather
    nodes = make_node_work(real, 0.0 if double else at.LEAST_MASS, averaged=averaged, flowing=flowing)
    clear_block, divide_block, update_block = nodes.clear_block, nodes.divide_block, nodes.update_block
    meet = make_meet(0.0 if double else at.LEAST_MASS, flowing=flowing)
    move_point = make_move(real, kinds, gather)
    strain_point = make_strain(real, kinds)

    @ti.kernel
    def march(
        x: Positions,
        points: Points,
        labels: Ints,
        grid: Grid,
        means: Means,
        tiles: Ints,
        active: Ints,
        materials: Doubles,
        batch: Doubles,
        forcing: Doubles,
        fields: Doubles,
        control: Ints,
        report: Ints,
        tracers: Positions,
        homes: Ints,
        carrier: Grid,
        met: Ints,
        scratch: Doubles,
        signs: Ints,
        first: ti.i32,
        count: ti.i32,
        threads: ti.i32,
    ):
        """Up to `count` steps in so many threads; stops after one that leaves a point too far from home.

        Which thread does what is chance, what comes out is not: the shares of a phase touch nothing in common. A thread
        that waits for the others too long keeps its ticket and leaves, so that processors which are not there do not
        matter: while work is left, the kernel is launched again.
        """
        ti.loop_config(block_dim=1)
        for thread in range(threads):
            tickets_a_step = control[words.PHASES_AT + words.PHASES]
            ticket = signs[words.HELD + thread]
            if ticket < 0:
                ticket = ti.atomic_add(signs[words.TICKET], 1)
            going = True
            while going:
                step = ticket // tickets_a_step
                share = ticket - step * tickets_a_step
                phase = 0
                while share >= control[words.PHASES_AT + phase + 1]:
                    phase += 1
                share -= control[words.PHASES_AT + phase]
                needed = ticket - share
                looks = 0
                # Adding nothing is the one way to read what another thread is writing.
                while step < count and looks < _PATIENCE and ti.atomic_add(signs[words.DONE], 0) < needed:
                    looks += 1
                if step >= count or ti.atomic_add(signs[words.DONE], 0) < needed:
                    going = False
                elif phase == words.CLEAR and ti.atomic_add(report[words.DRIFTED], 0) == 1:
                    signs[words.HALTED] = 1
                    going = False
                else:
                    begin = share * words.BLOCKS_A_TICKET
                    end = ti.min(begin + words.BLOCKS_A_TICKET, control[words.ACTIVE])
                    if phase == words.CLEAR:
                        for q in range(begin, end):
                            clear_block(grid, means, active, control, q)
                    elif phase == words.UPDATE:
                        # A place where several meet takes longest, so these come first.
                        rank = share - control[words.PLACES]
                        begin = ti.max(rank, 0) * words.BLOCKS_A_TICKET
                        end = ti.min(begin + words.BLOCKS_A_TICKET, control[words.APART])
                        if ti.static(several):  # noqa: SIM102 - it is known when this is compiled
                            if rank < 0:
                                end = begin
                                meet(
                                    x,
                                    points,
                                    labels,
                                    grid,
                                    carrier,
                                    materials,
                                    batch,
                                    forcing,
                                    fields,
                                    control,
                                    report,
                                    met,
                                    scratch,
                                    first + step,
                                    share,
                                )
                        for q in range(begin, end):
                            update_block(grid, carrier, met, batch, forcing, fields, control, report, first + step, q)
                    elif phase == words.MOVE:
                        begin = share * words.POINTS_A_TICKET
                        end = ti.min(begin + words.POINTS_A_TICKET, control[words.POINTS])
                        for p in range(begin, end):
                            move_point(
                                x,
                                points,
                                labels,
                                grid,
                                materials,
                                batch,
                                forcing,
                                fields,
                                control,
                                report,
                                met,
                                first + step,
                                p,
                            )
                    elif phase == words.CARRY:
                        begin = share * words.POINTS_A_TICKET
                        end = ti.min(begin + words.POINTS_A_TICKET, control[words.TRACERS])
                        for p in range(begin, end):
                            carry(tracers, homes, carrier, batch, control, report, met, p)
                    elif phase >= words.SCATTER:
                        q = control[words.COLOURS_AT + phase - words.SCATTER] + share
                        for p in range(tiles[2 * q], tiles[2 * q + 1]):
                            scatter(x, points, labels, grid, means, materials, batch, control, p)
                    if ti.static(averaged):
                        if phase >= words.AVERAGE and phase < words.DIVIDE:
                            q = control[words.COLOURS_AT + phase - words.AVERAGE] + share
                            for p in range(tiles[2 * q], tiles[2 * q + 1]):
                                scatter_dilation(x, points, labels, materials, means, control, p)
                        elif phase == words.DIVIDE:
                            for q in range(begin, end):
                                divide_block(means, active, control, q)
                    ti.atomic_add(signs[words.DONE], 1)
                    ticket = ti.atomic_add(signs[words.TICKET], 1)
            signs[words.HELD + thread] = ticket

    @ti.kernel
    def clear(grid: Grid, means: Means, active: Ints, control: Ints):
        """Empty the nodes that points can reach (GPU)."""
        for q in range(control[words.ACTIVE]):
            clear_block(grid, means, active, control, q)

    @ti.kernel
    def scatter_atomically(
        x: Positions,
        points: Points,
        labels: Ints,
        grid: Grid,
        means: Means,
        materials: Doubles,
        batch: Doubles,
        control: Ints,
    ):
        """Points to the grid, a point a thread (GPU)."""
        for p in range(control[words.POINTS]):
            scatter(x, points, labels, grid, means, materials, batch, control, p)

    @ti.kernel
    def average_atomically(x: Positions, points: Points, labels: Ints, means: Means, materials: Doubles, control: Ints):
        """Dilations to the grid, a point a thread (GPU)."""
        for p in range(control[words.POINTS]):
            scatter_dilation(x, points, labels, materials, means, control, p)

    @ti.kernel
    def divide(means: Means, active: Ints, control: Ints):
        """Sums of dilations to means (GPU)."""
        for q in range(control[words.ACTIVE]):
            divide_block(means, active, control, q)

    @ti.kernel
    def update_and_move(
        x: Positions,
        points: Points,
        labels: Ints,
        grid: Grid,
        materials: Doubles,
        batch: Doubles,
        forcing: Doubles,
        fields: Doubles,
        control: Ints,
        report: Ints,
        tracers: Positions,
        homes: Ints,
        carrier: Grid,
        met: Ints,
        scratch: Doubles,
        step: ti.i32,
    ):
        """The rest of step number `step` of the batch (GPU)."""
        if ti.static(several):
            for place in range(control[words.PLACES]):
                meet(
                    x,
                    points,
                    labels,
                    grid,
                    carrier,
                    materials,
                    batch,
                    forcing,
                    fields,
                    control,
                    report,
                    met,
                    scratch,
                    step,
                    place,
                )
        for q in range(control[words.APART]):
            update_block(grid, carrier, met, batch, forcing, fields, control, report, step, q)
        for p in range(control[words.POINTS]):
            move_point(x, points, labels, grid, materials, batch, forcing, fields, control, report, met, step, p)
        for p in range(control[words.TRACERS]):
            carry(tracers, homes, carrier, batch, control, report, met, p)

    @ti.kernel
    def strain(points: Points, labels: Ints, materials: Doubles, control: Ints):
        """The stress that belongs to the points as they are, their velocity gradient taken for C."""
        for p in range(control[words.POINTS]):
            strain_point(points, labels, materials, p)

    @ti.kernel
    def settle(x: Positions, labels: Ints, control: Ints):
        """Give every point the cell it is in as its home."""
        ti.loop_config(block_dim=1024)
        for p in range(control[words.POINTS]):
            cell = ti.cast(ti.floor(x[p] - 0.5), ti.i32)
            for d in ti.static(range(3)):
                labels[p * at.LABEL_WIDTH + at.HOME + d] = cell[d]

    @ti.kernel
    def permute(
        order: Ints,
        control: Ints,
        x: Positions,
        points: Points,
        labels: Ints,
        x_new: Positions,
        points_new: Points,
        labels_new: Ints,
    ):
        """Rows in a new order."""
        ti.loop_config(block_dim=1024)
        for q in range(control[words.POINTS]):
            p = order[q]
            x_new[q] = x[p]
            for c in range(words.POINT_ROWS):
                points_new[q * words.POINT_ROWS + c] = points[p * words.POINT_ROWS + c]
            for c in ti.static(range(at.LABEL_WIDTH)):
                labels_new[q * at.LABEL_WIDTH + c] = labels[p * at.LABEL_WIDTH + c]

    return SimpleNamespace(
        march=march,
        clear=clear,
        scatter_atomically=scatter_atomically,
        update_and_move=update_and_move,
        average_atomically=average_atomically,
        divide=divide,
        strain=strain,
        settle=settle,
        permute=permute,
        survey=make_survey(real, Positions, Points, Ints, Doubles),
    )
