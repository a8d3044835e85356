# ruff: noqa: RUF046, SIM102, UP018 - Warp tells a variable int(0) from a constant 0; "if" of a constant alone.
"""The kernels of one MLS-MPM step, specialised by precision, by the kinds of material present and by the scatter.

Everything is in the engine's own units: cells, point masses, the stiffest material's stable step. With them float32
neither overflows nor underflows whatever the scene's size. Moving least squares MPM after Hu et al. 2018
(10.1145/3197517.3201293); `transfers` has the kernel.

Positions are float64 in every precision: x += dt v in float32 loses half an ulp a step, always in the same direction.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import COLOURS

from gasp_warp_mpm.barrier import take_next, wait_for_all
from gasp_warp_mpm.blocks import make_blocks
from gasp_warp_mpm.constitutive import make_response
from gasp_warp_mpm.contact import kept_out
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.meeting import make_meeting
from gasp_warp_mpm.native import GROUP, make_native
from gasp_warp_mpm.ordering import make_ordering
from gasp_warp_mpm.phases import THREADS, make_phases
from gasp_warp_mpm.subgrid import make_subgrid
from gasp_warp_mpm.survey import make_survey
from gasp_warp_mpm.tables import CLAMPED, DRIFTED, STEPS_DONE, Acting, stand_of, tables_of
from gasp_warp_mpm.tracers import make_tracers
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["make_kernels"]

_BLOCKS = 8
_POINTS = 512
"""What a thread takes at a time."""


@cache
def make_kernels(
    double: bool, kinds: frozenset[str], averaged: bool, several: bool, *, atomic: bool, native: bool
) -> SimpleNamespace:
    """Kernels for one precision and set of materials, and the module that holds them; compiled when it is loaded.

    Parameters
    ----------
    double
        float64 instead of float32 for everything but positions.
    kinds
        Kinds of material present: what is absent costs neither compilation nor a branch.
    averaged
        Something is nearly incompressible: its dilation is averaged over the nodes before it acts.
    several
        There are several bodies, which may meet.
    atomic
        Scatter with atomic additions, for GPUs; otherwise `steps`, for threads that share tiles of one colour.
    native
        The loops over nodes in native code, for the CPU and without atomic additions.
    """
    real = wp.float64 if double else wp.float32
    Tables = tables_of(real)
    Meeting = wp.array(dtype=wp.int32)
    transfers = make_transfers(double, averaged, native=native)
    row9, write9, write_stress = transfers.row9, transfers.write9, transfers.write_stress
    load, store = transfers.load, transfers.store
    material_row, gather, scatter = transfers.material_row, transfers.gather, transfers.scatter
    scatter_carried = transfers.scatter_carried
    scatter_dilation, keep_pressures = transfers.scatter_dilation, transfers.keep_pressures
    flows = bool(kinds - {"elastic", "neo-hookean"})
    blocks = make_blocks(double, averaged, flows)
    clear_block, divide_block = blocks.clear_block, blocks.divide_block
    settle_block, update_block = blocks.settle_block, blocks.update_block
    meet = make_meeting(double, averaged, flows, native=native).meet if several else None
    tracers = make_tracers(double, averaged, native=native)
    carry_one, carry_some = tracers.carry_one, tracers.carry_some
    lines = make_native(double, averaged)
    spread, spread_carried = lines.spread, lines.spread_carried
    move_elastic, move_neo_hookean = lines.move_elastic, lines.move_neo_hookean
    advance = make_response(double, kinds, advance=True)
    stress_of = make_response(double, kinds, advance=False)
    with_unseen = make_subgrid(double, averaged, "fluid" in kinds, native=native).with_unseen
    has_elastic, has_neo_hookean = "elastic" in kinds, "neo-hookean" in kinds
    zero, one, types = real(0.0), real(1.0), algebra(real)
    vec3, vec4, mat33 = types.vec3, types.vec4, types.mat33
    half_cell, one_cell, two_cells = wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    is_elastic, is_neo_hookean = at.KINDS["elastic"], at.KINDS["neo-hookean"]
    kind_names = "_".join(sorted(kind.replace("-", "_") for kind in kinds))
    traits = {"averaged": averaged, "several": several, "atomic": atomic, "native": native}
    name = "_".join(["f64" if double else "f32", kind_names, *(trait for trait, has in traits.items() if has)])
    module = wp.get_module(f"gasp_warp_mpm_{name}")
    # Loops along the three axes are unrolled and no others: eight copies of a scatter take long to compile.
    # A product and a sum are one operation where the processor has it: Clang does not contract them unless it is told.
    flags = f"{wp.config.cpu_compiler_flags or '-march=native'} -ffp-contract=fast"
    module.options.update(enable_backward=False, max_unroll=3, cpu_compiler_flags=flags, block_dim=THREADS)

    # ---- points -----------------------------------------------------------------------------------------------------

    @wp.func
    def move_point(s: Tables, acting: Acting, drive_set: int, p: int):
        """Grid to point, then F, the return mapping and the stress that the next scatter reads."""
        v, C, L = gather(s, p)
        o = p * at.POINT_WIDTH
        # The row in its parts of four, as `layout` has it.
        fixed, bent = load(s.points, o + at.MASS), load(s.points, o + at.HISTORY)
        more, last = load(s.points, o + at.HISTORY + 4), load(s.points, o + at.HISTORY + 8)
        yields = int(0)
        history = bent[0]
        aside = wp.vec3d()
        if flows:
            if int(s.materials[material_row(s, p) + at.KIND]) > is_neo_hookean:
                yields = 1
                aside = wp.vec3d(stand_of(s.stands, s.labels[p * at.LABEL_WIDTH + at.HOME] - s.lower[0]))
                v, C, history = with_unseen(s, acting, drive_set, p, s.x[p] - aside, v, C, L)
        H, gain, tau, dilation = advance(
            mat33(bent[1], bent[2], bent[3], more[0], more[1], more[2], more[3], last[0], last[1]),
            L,
            history,
            real(s.step),
            s.materials,
            material_row(s, p),
        )
        store(s.points, o + at.MASS, vec4(fixed[0], tau[0, 0], tau[1, 1], tau[2, 2]))
        store(s.points, o + at.MASS + 4, vec4(tau[0, 1], tau[0, 2], tau[1, 2], dilation))
        store(s.points, o + at.HISTORY, vec4(gain, H[0, 0], H[0, 1], H[0, 2]))
        store(s.points, o + at.HISTORY + 4, vec4(H[1, 0], H[1, 1], H[1, 2], H[2, 0]))
        store(s.points, o + at.HISTORY + 8, vec4(H[2, 1], H[2, 2], last[2], last[3]))
        u = wp.vec3d(v)
        if flows:
            if yields == 1 and acting.colliders > 0:
                half_width = wp.float64(last[3])
                u = kept_out(acting, u, s.x[p] - aside, half_width, s.step, drive_set)
                v = vec3(real(u[0]), real(u[1]), real(u[2]))
        place = s.x[p] + s.step * u
        if acting.clamp == 1:
            stand = wp.vec3d(stand_of(s.stands, s.labels[p * at.LABEL_WIDTH + at.HOME] - s.lower[0]))
            for d in range(3):
                if place[d] < acting.wall_low[d] + stand[d]:
                    place[d] = acting.wall_low[d] + stand[d]
                    v[d] = wp.max(v[d], zero)
                    s.report[CLAMPED] = 1
                elif place[d] > acting.wall_high[d] + stand[d]:
                    place[d] = acting.wall_high[d] + stand[d]
                    v[d] = wp.min(v[d], zero)
                    s.report[CLAMPED] = 1
        kept = one / (one + real(s.materials[material_row(s, p) + at.MASS_DAMPING] * s.step))
        store(s.points, o, kept * vec4(v[0], v[1], v[2], C[0, 0]))
        store(s.points, o + 4, kept * vec4(C[0, 1], C[0, 2], C[1, 0], C[1, 1]))
        store(s.points, o + 8, kept * vec4(C[1, 2], C[2, 0], C[2, 1], C[2, 2]))
        s.x[p] = place
        # Written so that NaN fails it: a point that is nowhere must not be scattered either.
        near = int(0)
        for d in range(3):
            drift = place[d] - half_cell - wp.float64(s.labels[p * at.LABEL_WIDTH + at.HOME + d])
            if drift >= -one_cell and drift < two_cells:
                near += 1
        if near < 3:
            s.report[DRIFTED] = 1

    @wp.func
    def find_stress(s: Tables, p: int, step: real):
        """The stress that belongs to a point as it is after a step, its velocity gradient taken for C."""
        o = p * at.POINT_WIDTH
        _H, _gain, tau, dilation = stress_of(
            row9(s.points, o + at.DISPLACEMENT_GRADIENT),
            row9(s.points, o + at.AFFINE),
            s.points[o + at.HISTORY],
            step,
            s.materials,
            material_row(s, p),
        )
        write_stress(s.points, o, tau, dilation)

    @wp.func
    def common_row(s: Tables, begin: int):
        """The material of a whole group of points, or -1."""
        row = material_row(s, begin)
        if begin + GROUP > s.count:
            row = -1
        else:
            for p in range(begin + 1, begin + GROUP):
                if material_row(s, p) != row:
                    row = -1
        return row

    @wp.func
    def move_group(s: Tables, acting: Acting, drive_set: int, begin: int):
        """Points begin .. begin + GROUP: those of one material together, where there is a native body for it."""
        row = int(-1)
        if native:
            row = common_row(s, begin)
        kind = int(-1)
        if row >= 0:
            kind = int(s.materials[row + at.KIND])
        left = int(-1)
        if has_elastic:
            if kind == is_elastic:
                left = move_elastic(s, acting, begin, row)
        if has_neo_hookean:
            if kind == is_neo_hookean:
                left = move_neo_hookean(s, acting, begin, row)
        if left < 0:
            for p in range(begin, wp.min(begin + GROUP, s.count)):
                move_point(s, acting, drive_set, p)
        elif left > 0:
            for lane in range(GROUP):
                if (left >> lane) & 1 == 1:
                    find_stress(s, begin + lane, real(s.step))

    @wp.func
    def scatter_tile(s: Tables, begin: int, end: int):
        """The points begin .. end of a tile, in their order."""
        if native:
            if averaged:
                keep_pressures(s, begin, end)
            spread(s, begin, end)
            if flows:
                spread_carried(s, begin, end)
        else:
            for p in range(begin, end):
                scatter(s, p)
                if flows:
                    scatter_carried(s, p)

    # ---- in threads: each takes a share of every phase and waits for the others -------------------------------------

    @wp.func
    def clear_share(s: Tables, meeting: Meeting):
        q = take_next(meeting, _BLOCKS)
        while q < s.active_count:
            for block in range(q, wp.min(q + _BLOCKS, s.active_count)):
                clear_block(s, block)
            q = take_next(meeting, _BLOCKS)

    @wp.func
    def divide_share(s: Tables, meeting: Meeting):
        q = take_next(meeting, _BLOCKS)
        while q < s.active_count:
            for block in range(q, wp.min(q + _BLOCKS, s.active_count)):
                divide_block(s, block)
            q = take_next(meeting, _BLOCKS)

    @wp.func
    def update_share(s: Tables, acting: Acting, drive_set: int, meeting: Meeting):
        q = take_next(meeting, _BLOCKS)
        if several:
            # These first, a few at a time: they take longest. Every number stands for a place, then for blocks.
            while q < s.place_count * _BLOCKS:
                meet(s, acting, drive_set, q // _BLOCKS)
                q = take_next(meeting, _BLOCKS)
            q = q - s.place_count * _BLOCKS
        while q < s.apart_count:
            for block in range(q, wp.min(q + _BLOCKS, s.apart_count)):
                update_block(s, acting, drive_set, block)
            q = take_next(meeting, _BLOCKS)
            if several:
                q = q - s.place_count * _BLOCKS

    @wp.func
    def average_share(s: Tables, colour: int, meeting: Meeting):
        q = s.colours[colour] + take_next(meeting, 1)
        while q < s.colours[colour + 1]:
            for p in range(s.tiles[2 * q], s.tiles[2 * q + 1]):
                scatter_dilation(s, p)
            q = s.colours[colour] + take_next(meeting, 1)

    @wp.func
    def scatter_share(s: Tables, colour: int, meeting: Meeting):
        q = s.colours[colour] + take_next(meeting, 1)
        while q < s.colours[colour + 1]:
            scatter_tile(s, s.tiles[2 * q], s.tiles[2 * q + 1])
            q = s.colours[colour] + take_next(meeting, 1)

    @wp.func
    def move_share(s: Tables, acting: Acting, drive_set: int, meeting: Meeting):
        p = take_next(meeting, _POINTS)
        while p < s.count:
            for group in range(_POINTS // GROUP):
                if p + group * GROUP < s.count:
                    move_group(s, acting, drive_set, p + group * GROUP)
            p = take_next(meeting, _POINTS)
        # The numbers go on: tracers come after the points.
        points = (s.count + _POINTS - 1) // _POINTS * _POINTS
        while p - points < s.tracer_count:
            carry_some(s, acting, p - points, wp.min(p - points + _POINTS, s.tracer_count))
            p = take_next(meeting, _POINTS)

    @wp.func
    def scatter_tiles(s: Tables, workers: int, meeting: Meeting, yield_address: wp.uint64):
        """Points to an empty grid. Tiles of one colour write disjoint nodes, each in the order of its points."""
        clear_share(s, meeting)
        wait_for_all(meeting, workers, yield_address)
        if averaged:
            for colour in range(COLOURS):
                average_share(s, colour, meeting)
                wait_for_all(meeting, workers, yield_address)
            divide_share(s, meeting)
            wait_for_all(meeting, workers, yield_address)
        for colour in range(COLOURS):
            scatter_share(s, colour, meeting)
            wait_for_all(meeting, workers, yield_address)

    if not atomic:

        @wp.kernel(module=module, enable_backward=False)
        def steps(
            s: Tables,
            acting: Acting,
            first: int,
            count: int,
            worker: int,
            workers: int,
            meeting: Meeting,
            yield_address: wp.uint64,
        ):
            """Up to `count` steps; stops after one that leaves a point too far from home. One launch a thread."""
            for step in range(count):
                if s.report[DRIFTED] == 0:
                    scatter_tiles(s, workers, meeting, yield_address)
                    update_share(s, acting, first + step, meeting)
                    wait_for_all(meeting, workers, yield_address)
                    move_share(s, acting, first + step, meeting)
                    if worker == 0:
                        s.report[STEPS_DONE] = s.report[STEPS_DONE] + 1
                    wait_for_all(meeting, workers, yield_address)

        @wp.kernel(module=module, enable_backward=False)
        def scatter_in_order(s: Tables, meeting: Meeting):
            """Points to an empty grid, in the calling thread."""
            scatter_tiles(s, 1, meeting, wp.uint64(0))

    @wp.kernel(module=module, enable_backward=False)
    def settle_nodes(s: Tables):
        """Momentum to velocity, an active block."""
        settle_block(s, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def learn_affine(s: Tables):
        """C of the velocity field that is on the grid; nothing moves and nothing deforms."""
        p = wp.tid()
        _v, C, _L = gather(s, p)
        write9(s.points, p * at.POINT_WIDTH + at.AFFINE, C)

    @wp.kernel(module=module, enable_backward=False)
    def strain(s: Tables):
        """The stress that belongs to a point as it is, its velocity gradient taken for C."""
        find_stress(s, wp.tid(), zero)

    kernels = SimpleNamespace(
        module=module,
        tables=Tables,
        settle_nodes=settle_nodes,
        learn_affine=learn_affine,
        strain=strain,
        survey=make_survey(double, module),
        order=make_ordering(module, double, transfers, alone=atomic),
    )
    if atomic:
        kernels.phases = make_phases(
            module,
            double,
            averaged,
            flows,
            meet,
            transfers=transfers,
            blocks=blocks,
            move_point=move_point,
            carry_one=carry_one,
        )
    else:
        kernels.steps, kernels.scatter_in_order = steps, scatter_in_order
    return kernels
