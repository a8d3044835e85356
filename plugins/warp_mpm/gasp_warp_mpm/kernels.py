# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""The kernels of one MLS-MPM step, specialised by precision, by the kinds of material present and by the scatter.

Everything is in the engine's own units: cells, point masses, the stiffest material's stable step. With them a point's
stress gives a node -dt m tau' a / 4, tau' = 4 T^2 / (rho dx^2) tau and a the kernel of `gasp_core.engine.mpm`: no
volume is needed, and float32 neither overflows nor underflows whatever the scene's size. Moving least squares MPM
after Hu et al. 2018 (10.1145/3197517.3201293), quadratic B-splines; the part 4 (1 - s) w r of the kernel folds into
the affine velocity, what is left is s times the splines' gradient.

Positions are float64 in every precision: x += dt v in float32 loses half an ulp a step, always in the same direction.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import COLOURS

from gasp_core.engine.mpm import GRADIENT_SHARE
from gasp_warp_mpm.barrier import wait_for_all
from gasp_warp_mpm.constitutive import make_response
from gasp_warp_mpm.contact import constrain
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.native import make_native
from gasp_warp_mpm.survey import make_survey
from gasp_warp_mpm.tables import Acting, tables_of

__all__ = ["CLAMPED", "DRIFTED", "REPORT_WIDTH", "STEPS_DONE", "make_kernels"]

DRIFTED = 0
CLAMPED = 1
STEPS_DONE = 2
REPORT_WIDTH = 3
_BLOCK_NODES = 64


@cache
def make_kernels(double: bool, kinds: frozenset[str], averaged: bool, *, atomic: bool, native: bool) -> SimpleNamespace:
    """Kernels for one precision and set of materials, and the module that holds them; compiled when it is loaded.

    Parameters
    ----------
    double
        float64 instead of float32 for everything but positions.
    kinds
        Kinds of material present: what is absent costs neither compilation nor a branch.
    averaged
        Something is nearly incompressible: its dilation is averaged over the nodes before it acts.
    atomic
        Scatter with atomic additions, for GPUs; otherwise `steps`, for threads that share tiles of one colour.
    native
        The loops over nodes in native code, for the CPU and without atomic additions.
    """
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec2, vec3, vec4, mat33 = types.vec2, types.vec3, types.vec4, types.mat33
    Reals = wp.array(dtype=real)
    Tables = tables_of(real)
    lines = make_native(double)
    spread, collect = lines.spread, lines.collect
    advance = make_response(double, kinds, advance=True)
    stress_of = make_response(double, kinds, advance=False)
    zero, one, two, four = real(0.0), real(1.0), real(2.0), real(4.0)
    half, three_halves, three_quarters = real(0.5), real(1.5), real(0.75)
    # The nodes of a stencil, in cells; Warp takes a real(i) of an unrolled i for all later uses of i.
    along = vec3(0.0, 1.0, 2.0)
    folded, shared = real(1 - GRADIENT_SHARE), real(GRADIENT_SHARE)
    shared_force = real(-GRADIENT_SHARE / 4)
    least_mass = real(0.0 if double else at.LEAST_MASS)
    half_cell, one_cell, two_cells = wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    is_elastic = at.KINDS["elastic"]
    kind_names = "_".join(sorted(kind.replace("-", "_") for kind in kinds))
    name = f"{'f64' if double else 'f32'}_{kind_names}{'_averaged' * averaged}{'_atomic' * atomic}{'_native' * native}"
    module = wp.get_module(f"gasp_warp_mpm_{name}")
    # Loops along the three axes are unrolled and no others: eight copies of a scatter take long to compile.
    module.options.update(enable_backward=False, max_unroll=3)

    # ---- rows -------------------------------------------------------------------------------------------------------

    @wp.func
    def row3(table: Reals, start: int):
        return vec3(table[start], table[start + 1], table[start + 2])

    @wp.func
    def row9(table: Reals, start: int):
        return mat33(
            table[start],
            table[start + 1],
            table[start + 2],
            table[start + 3],
            table[start + 4],
            table[start + 5],
            table[start + 6],
            table[start + 7],
            table[start + 8],
        )

    @wp.func
    def write9(table: Reals, start: int, M: mat33):
        for r in range(3):
            for c in range(3):
                table[start + 3 * r + c] = M[r, c]

    @wp.func
    def write_stress(points: Reals, o: int, S: mat33, dilation: real):
        for c in range(3):
            points[o + at.STRESS + c] = S[c, c]
        points[o + at.STRESS + 3] = S[0, 1]
        points[o + at.STRESS + 4] = S[0, 2]
        points[o + at.STRESS + 5] = S[1, 2]
        points[o + at.DILATION] = dilation

    @wp.func
    def material_row(s: Tables, p: int):
        return s.labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH

    # ---- transfers --------------------------------------------------------------------------------------------------

    @wp.func
    def stencil(s: Tables, p: int):
        """Offset in the base cell, the linear index of the stencil's first node, and the strides along x and y."""
        place = s.x[p]
        bx = wp.floor(place[0] - half_cell)
        by = wp.floor(place[1] - half_cell)
        bz = wp.floor(place[2] - half_cell)
        offset = vec3(real(place[0] - bx), real(place[1] - by), real(place[2] - bz))
        sy = s.shape[2]
        sx = s.shape[1] * sy
        first = (int(bx) - s.lower[0]) * sx + (int(by) - s.lower[1]) * sy + (int(bz) - s.lower[2])
        return offset, first, sx, sy

    @wp.func
    def weights(offset: vec3):
        """Rows: the three weights along each axis; column: the axis."""
        w = mat33()
        for d in range(3):
            a = three_halves - offset[d]
            b = offset[d] - one
            c = offset[d] - half
            w[0, d] = half * a * a
            w[1, d] = three_quarters - b * b
            w[2, d] = half * c * c
        return w

    @wp.func
    def slopes(offset: vec3):
        """The weights' derivatives, as `weights`."""
        w = mat33()
        for d in range(3):
            w[0, d] = offset[d] - three_halves
            w[1, d] = two - two * offset[d]
            w[2, d] = offset[d] - half
        return w

    @wp.func
    def scatter_dilation(s: Tables, p: int):
        """Give the nodes a point's dilation times the root of its stiffness, weighed by its volume."""
        row = material_row(s, p)
        stiffness = real(s.materials[row + at.MEAN_STIFFNESS])
        if stiffness > zero:
            offset, first, sx, sy = stencil(s, p)
            w = weights(offset)
            o = p * at.POINT_WIDTH
            volume = s.points[o + at.MASS] * real(s.materials[row + at.LIGHTNESS])
            given = volume * vec2(stiffness * s.points[o + at.DILATION], one)
            for i in range(3):
                for j in range(3):
                    part = (w[i, 0] * w[j, 1]) * given
                    line = first + i * sx + j * sy
                    for k in range(3):
                        if atomic:
                            wp.atomic_add(s.means, line + k, w[k, 2] * part)
                        else:
                            s.means[line + k] = s.means[line + k] + w[k, 2] * part

    @wp.func
    def mean_pressure(s: Tables, p: int, w: mat33, first: int, sx: int, sy: int):
        """What the mean dilation around a point adds to its scaled stress, along the diagonal."""
        row = material_row(s, p)
        stiffness = real(s.materials[row + at.MEAN_STIFFNESS])
        pressure = real(0.0)
        if stiffness > zero:
            for i in range(3):
                for j in range(3):
                    line = first + i * sx + j * sy
                    m0 = s.means[line]
                    m1 = s.means[line + 1]
                    m2 = s.means[line + 2]
                    pressure += (w[i, 0] * w[j, 1]) * (w[0, 2] * m0[0] + w[1, 2] * m1[0] + w[2, 2] * m2[0])
            pressure *= stiffness * real(s.materials[row + at.LIGHTNESS])
            if int(s.materials[row + at.KIND]) == is_elastic:
                # d(J - 1) = J tr L dt, where d(ln J) = tr L dt.
                pressure *= one + s.points[p * at.POINT_WIDTH + at.DILATION]
        return pressure

    @wp.func
    def scatter(s: Tables, p: int):
        """A point's mass and momentum to the 27 nodes around it."""
        offset, first, sx, sy = stencil(s, p)
        w = weights(offset)
        d = slopes(offset)
        o = p * at.POINT_WIDTH
        t = o + at.STRESS
        m = s.points[o + at.MASS]
        diagonal = row3(s.points, t)
        shear = row3(s.points, t + 3)
        if averaged:
            diagonal = diagonal + vec3(mean_pressure(s, p, w, first, sx, sy))
        S = real(s.step) * mat33(
            diagonal[0], shear[0], shear[1], shear[0], diagonal[1], shear[2], shear[1], shear[2], diagonal[2]
        )
        A = row9(s.points, o + at.AFFINE) - folded * S
        u = row3(s.points, o + at.VELOCITY) - A @ offset
        S = (shared_force * m) * S
        start = vec4(u[0], u[1], u[2], one)
        ax = vec4(A[0, 0], A[1, 0], A[2, 0], zero)
        ay = vec4(A[0, 1], A[1, 1], A[2, 1], zero)
        az = vec4(A[0, 2], A[1, 2], A[2, 2], zero)
        px = vec4(S[0, 0], S[1, 0], S[2, 0], zero)
        py = vec4(S[0, 1], S[1, 1], S[2, 1], zero)
        pz = vec4(S[0, 2], S[1, 2], S[2, 2], zero)
        if native:
            spread(s.grid, first, sx, sy, w, d, m, wp.matrix_from_rows(start, ax, ay, az, px, py, pz))
        else:
            for i in range(3):
                wi = w[i, 0] * m
                bi = wi * (start + along[i] * ax) + d[i, 0] * px
                yi = wi * ay
                zi = wi * az
                pyi = w[i, 0] * py
                pzi = w[i, 0] * pz
                for j in range(3):
                    b = w[j, 1] * (bi + along[j] * yi) + d[j, 1] * pyi
                    zij = w[j, 1] * zi
                    pzij = w[j, 1] * pzi
                    line = first + i * sx + j * sy
                    for k in range(3):
                        part = w[k, 2] * (b + along[k] * zij) + d[k, 2] * pzij
                        if atomic:
                            wp.atomic_add(s.grid, line + k, part)
                        else:
                            s.grid[line + k] = s.grid[line + k] + part

    @wp.func
    def gather(s: Tables, p: int):
        """Velocity, its affine part C and the velocity gradient L at a point."""
        offset, first, sx, sy = stencil(s, p)
        w = weights(offset)
        d = slopes(offset)
        V, CX, CY, CZ = vec4(), vec4(), vec4(), vec4()
        GX, GY, GZ = vec4(), vec4(), vec4()
        if native:
            found = collect(s.grid, first, sx, sy, w, d)
            V, CX, CY, CZ = found[0], found[1], found[2], found[3]
            GX, GY, GZ = found[4], found[5], found[6]
        else:
            for i in range(3):
                si, siy, siz = vec4(), vec4(), vec4()
                diy, diz = vec4(), vec4()
                for j in range(3):
                    line = first + i * sx + j * sy
                    g0 = s.grid[line]
                    g1 = s.grid[line + 1]
                    g2 = s.grid[line + 2]
                    t1 = w[1, 2] * g1
                    t2 = w[2, 2] * g2
                    s0 = w[0, 2] * g0 + t1 + t2
                    si = si + w[j, 1] * s0
                    siz = siz + w[j, 1] * (t1 + two * t2)
                    diy = diy + d[j, 1] * s0
                    diz = diz + w[j, 1] * (d[0, 2] * g0 + d[1, 2] * g1 + d[2, 2] * g2)
                    siy = siy + (along[j] * w[j, 1]) * s0
                V = V + w[i, 0] * si
                CX = CX + (along[i] * w[i, 0]) * si
                CY = CY + w[i, 0] * siy
                CZ = CZ + w[i, 0] * siz
                GX = GX + d[i, 0] * si
                GY = GY + w[i, 0] * diy
                GZ = GZ + w[i, 0] * diz
        CX = four * (CX - offset[0] * V)
        CY = four * (CY - offset[1] * V)
        CZ = four * (CZ - offset[2] * V)
        C = mat33(CX[0], CY[0], CZ[0], CX[1], CY[1], CZ[1], CX[2], CY[2], CZ[2])
        G = mat33(GX[0], GY[0], GZ[0], GX[1], GY[1], GZ[1], GX[2], GY[2], GZ[2])
        return vec3(V[0], V[1], V[2]), C, folded * C + shared * G

    @wp.func
    def move_point(s: Tables, acting: Acting, p: int):
        """Grid to point, then F, the return mapping and the stress that the next scatter reads."""
        v, C, L = gather(s, p)
        o = p * at.POINT_WIDTH
        F, gain, tau, dilation = advance(
            row9(s.points, o + at.DEFORMATION),
            L,
            s.points[o + at.HISTORY],
            real(s.step),
            s.materials,
            material_row(s, p),
        )
        write_stress(s.points, o, tau, dilation)
        write9(s.points, o + at.DEFORMATION, F)
        write9(s.points, o + at.AFFINE, C)
        s.points[o + at.HISTORY] = gain
        place = s.x[p] + s.step * wp.vec3d(v)
        if acting.clamp == 1:
            for d in range(3):
                if place[d] < acting.wall_low[d]:
                    place[d] = acting.wall_low[d]
                    v[d] = wp.max(v[d], zero)
                    s.report[CLAMPED] = 1
                elif place[d] > acting.wall_high[d]:
                    place[d] = acting.wall_high[d]
                    v[d] = wp.min(v[d], zero)
                    s.report[CLAMPED] = 1
        for d in range(3):
            s.points[o + at.VELOCITY + d] = v[d]
        s.x[p] = place
        # Written so that NaN fails it: a point that is nowhere must not be scattered either.
        near = int(0)
        for d in range(3):
            drift = place[d] - half_cell - wp.float64(s.labels[p * at.LABEL_WIDTH + at.HOME + d])
            if drift >= -one_cell and drift < two_cells:
                near += 1
        if near < 3:
            s.report[DRIFTED] = 1

    # ---- blocks of 4^3 nodes ----------------------------------------------------------------------------------------

    @wp.func
    def block_corner(s: Tables, q: int):
        """Place of the first node of an active block, from the grid's own first node."""
        block = s.active[q]
        by = s.shape[1] // 4
        bz = s.shape[2] // 4
        return wp.vec3i(block // (by * bz) * 4, block // bz % by * 4, block % bz * 4)

    @wp.func
    def node_of(corner: wp.vec3i, n: int):
        return wp.vec3i(corner[0] + n // 16, corner[1] + n // 4 % 4, corner[2] + n % 4)

    @wp.func
    def row_of(s: Tables, node: wp.vec3i):
        return (node[0] * s.shape[1] + node[1]) * s.shape[2] + node[2]

    @wp.func
    def clear_block(s: Tables, q: int):
        corner = block_corner(s, q)
        for n in range(_BLOCK_NODES):
            row = row_of(s, node_of(corner, n))
            s.grid[row] = vec4()
            if averaged:
                s.means[row] = vec2()

    @wp.func
    def divide_block(s: Tables, q: int):
        """Sums over volumes to means, at the nodes of one block."""
        corner = block_corner(s, q)
        for n in range(_BLOCK_NODES):
            row = row_of(s, node_of(corner, n))
            total = s.means[row]
            mean = real(0.0)
            if total[1] > least_mass:
                mean = total[0] / total[1]
            s.means[row] = vec2(mean, total[1])

    @wp.func
    def settle_block(s: Tables, q: int):
        """Momentum to velocity and nothing else, at the nodes of one block."""
        corner = block_corner(s, q)
        for n in range(_BLOCK_NODES):
            row = row_of(s, node_of(corner, n))
            g = s.grid[row]
            v = vec4()
            if g[3] > least_mass:
                v = vec4(g[0], g[1], g[2], zero) / g[3]
            s.grid[row] = v

    @wp.func
    def update_block(s: Tables, acting: Acting, drive_set: int, q: int):
        """Momentum to velocity, then whatever acts on it, at the nodes of one block."""
        corner = block_corner(s, q)
        for n in range(_BLOCK_NODES):
            node = node_of(corner, n)
            row = row_of(s, node)
            g = s.grid[row]
            v = vec4()
            if g[3] > least_mass:
                velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2])) / wp.float64(g[3])
                u, held = constrain(acting, velocity, wp.vec3d(s.lower + node), drive_set)
                v = vec4(real(u[0]), real(u[1]), real(u[2]), zero)
                if held == 1:
                    s.report[CLAMPED] = 1
            s.grid[row] = v

    # ---- in threads: each takes its share of every phase and waits for the others -----------------------------------

    @wp.func
    def scatter_tiles(
        s: Tables, worker: int, workers: int, meeting: wp.array(dtype=wp.int32), yield_address: wp.uint64
    ):
        """Points to an empty grid. Tiles of one colour write disjoint nodes, each in the order of its points."""
        for q in range(worker, s.active_count, workers):
            clear_block(s, q)
        wait_for_all(meeting, workers, yield_address)
        if averaged:
            for colour in range(COLOURS):
                for q in range(s.colours[colour] + worker, s.colours[colour + 1], workers):
                    for p in range(s.tiles[2 * q], s.tiles[2 * q + 1]):
                        scatter_dilation(s, p)
                wait_for_all(meeting, workers, yield_address)
            for q in range(worker, s.active_count, workers):
                divide_block(s, q)
            wait_for_all(meeting, workers, yield_address)
        for colour in range(COLOURS):
            for q in range(s.colours[colour] + worker, s.colours[colour + 1], workers):
                for p in range(s.tiles[2 * q], s.tiles[2 * q + 1]):
                    scatter(s, p)
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
            meeting: wp.array(dtype=wp.int32),
            yield_address: wp.uint64,
        ):
            """Up to `count` steps; stops after one that leaves a point too far from home. One launch a thread."""
            begin = int(wp.int64(s.count) * wp.int64(worker) / wp.int64(workers))
            end = int(wp.int64(s.count) * wp.int64(worker + 1) / wp.int64(workers))
            for step in range(count):
                if s.report[DRIFTED] == 0:
                    scatter_tiles(s, worker, workers, meeting, yield_address)
                    for q in range(worker, s.active_count, workers):
                        update_block(s, acting, first + step, q)
                    wait_for_all(meeting, workers, yield_address)
                    for p in range(begin, end):
                        move_point(s, acting, p)
                    if worker == 0:
                        s.report[STEPS_DONE] = s.report[STEPS_DONE] + 1
                    wait_for_all(meeting, workers, yield_address)

        @wp.kernel(module=module, enable_backward=False)
        def scatter_in_order(s: Tables, meeting: wp.array(dtype=wp.int32)):
            """Points to an empty grid, in the calling thread."""
            scatter_tiles(s, 0, 1, meeting, wp.uint64(0))

    # ---- phase by phase ---------------------------------------------------------------------------------------------

    @wp.kernel(module=module, enable_backward=False)
    def clear(s: Tables):
        """Empty an active block."""
        clear_block(s, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def average(s: Tables):
        """A point's dilation to the grid."""
        scatter_dilation(s, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def divide(s: Tables):
        """Sums of dilations to means, an active block."""
        divide_block(s, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def scatter_point(s: Tables):
        """A point to the grid."""
        scatter(s, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def update(s: Tables, acting: Acting, drive_set: int):
        """What acts on an active block."""
        update_block(s, acting, drive_set, wp.tid())

    @wp.kernel(module=module, enable_backward=False)
    def move(s: Tables, acting: Acting):
        """Grid to a point."""
        move_point(s, acting, wp.tid())

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
        p = wp.tid()
        o = p * at.POINT_WIDTH
        _F, _gain, tau, dilation = stress_of(
            row9(s.points, o + at.DEFORMATION),
            row9(s.points, o + at.AFFINE),
            s.points[o + at.HISTORY],
            zero,
            s.materials,
            material_row(s, p),
        )
        write_stress(s.points, o, tau, dilation)

    # ---- order ------------------------------------------------------------------------------------------------------

    @wp.kernel(module=module, enable_backward=False)
    def settle(s: Tables):
        """Give a point the cell it is in as its home."""
        p = wp.tid()
        place = s.x[p]
        for d in range(3):
            s.labels[p * at.LABEL_WIDTH + at.HOME + d] = int(wp.floor(place[d] - half_cell))

    @wp.kernel(module=module, enable_backward=False)
    def permute(
        s: Tables,
        order: wp.array(dtype=wp.int32),
        x: wp.array(dtype=wp.vec3d),
        points: Reals,
        labels: wp.array(dtype=wp.int32),
    ):
        """A row in its new place."""
        q = wp.tid()
        p = order[q]
        x[q] = s.x[p]
        for c in range(at.POINT_WIDTH):
            points[q * at.POINT_WIDTH + c] = s.points[p * at.POINT_WIDTH + c]
        for c in range(at.LABEL_WIDTH):
            labels[q * at.LABEL_WIDTH + c] = s.labels[p * at.LABEL_WIDTH + c]

    kernels = SimpleNamespace(
        module=module,
        tables=Tables,
        clear=clear,
        average=average,
        divide=divide,
        scatter_point=scatter_point,
        update=update,
        move=move,
        settle_nodes=settle_nodes,
        learn_affine=learn_affine,
        strain=strain,
        settle=settle,
        permute=permute,
        survey=make_survey(double, module),
    )
    if not atomic:
        kernels.steps, kernels.scatter_in_order = steps, scatter_in_order
    return kernels
