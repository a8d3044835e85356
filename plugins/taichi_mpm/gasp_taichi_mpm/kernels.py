"""The kernels of one MLS-MPM step, specialised by precision, by the kinds of material present and by threads.

Everything is in the engine's own units (`scaling.Units`): cells, point masses, the stiffest material's stable step.
With them a point's stress gives a node -dt m tau' a / 4, tau' = 4 T^2 / (rho dx^2) tau and a the kernel of
`gasp_core.engine.mpm`: no volume is needed, and float32 neither overflows nor underflows whatever the scene's size.
Moving least squares MPM after Hu et al. 2018 (10.1145/3197517.3201293), quadratic B-splines; the part 4 (1 - s) w r of
the kernel folds into the affine velocity, what is left is s times the splines' gradient.

Positions are float64 in every precision: x += dt v in float32 loses half an ulp a step, always in the same direction.
So is the grid: where matter rests under stress the pulls on a node round alike at every step, and momentum drifts.
"""

from functools import cache
from types import SimpleNamespace

from gasp_mpm_host import layout as at

from gasp_core.engine.mpm import GRADIENT_SHARE
from gasp_taichi_mpm import words
from gasp_taichi_mpm.constitutive import make_response
from gasp_taichi_mpm.contact import constrain
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["make_kernels"]


@ti.func
def row3(table: ti.template(), start):
    return ti.Vector([table[start], table[start + 1], table[start + 2]])


@ti.func
def row9(table: ti.template(), start):
    return ti.Matrix(
        [
            [table[start], table[start + 1], table[start + 2]],
            [table[start + 3], table[start + 4], table[start + 5]],
            [table[start + 6], table[start + 7], table[start + 8]],
        ]
    )


@cache
def make_kernels(double: bool, kinds: frozenset[str], threads: int, on_gpu: bool, averaged: bool) -> SimpleNamespace:
    """Kernels for one precision and set of materials; compiled at first use.

    Parameters
    ----------
    double
        float64 instead of float32 for everything but positions.
    kinds
        Kinds of material present: what is absent costs neither compilation nor a branch.
    threads
        Loops run on this many; 1 runs them in the calling thread, without the hand-over to a pool.
    on_gpu
        Scatter with atomics, a point a thread.
    averaged
        Something is nearly incompressible: its dilation is averaged over the nodes before it acts.
    """
    real = ti.f64 if double else ti.f32
    vec3 = ti.types.vector(3, real)
    vec4 = ti.types.vector(4, real)
    vec2 = ti.types.vector(2, real)
    Positions = ti.types.ndarray(dtype=ti.types.vector(3, ti.f64), ndim=1)
    Reals = ti.types.ndarray(dtype=real, ndim=1)
    node4 = ti.types.vector(4, ti.f64)
    Grid = ti.types.ndarray(dtype=node4, ndim=1)
    Means = ti.types.ndarray(dtype=vec2, ndim=1)
    Ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
    Doubles = ti.types.ndarray(dtype=ti.f64, ndim=1)
    serial = threads == 1 and not on_gpu
    pool = max(1, threads)
    advance = make_response(real, kinds, advance=True)
    stress_of = make_response(real, kinds, advance=False)
    least_mass = 0.0 if double else at.LEAST_MASS

    @ti.func
    def stencil(x: ti.template(), control: ti.template(), p):
        """Offset in the base cell, and the linear index of the stencil's first node."""
        place = x[p]
        base = ti.floor(place - 0.5)
        offset = ti.cast(place - base, real)
        cell = ti.cast(base, ti.i32)
        sy = control[words.SHAPE + 2]
        sx = control[words.SHAPE + 1] * sy
        first = (
            (cell[0] - control[words.LOWER]) * sx
            + (cell[1] - control[words.LOWER + 1]) * sy
            + (cell[2] - control[words.LOWER + 2])
        )
        return offset, first, sx, sy

    @ti.func
    def weights(offset):
        """Rows: the three weights along each axis; column: the axis."""
        a, c = 1.5 - offset, offset - 0.5
        low, high = 0.5 * a * a, 0.5 * c * c
        # Not 3/4 - (offset - 1)^2: the three are to add up to one.
        return ti.Matrix.rows([low, 1.0 - (low + high), high])

    @ti.func
    def slopes(offset):
        """The weights' derivatives, as `weights`."""
        return ti.Matrix.rows([offset - 1.5, 2.0 - 2.0 * offset, offset - 0.5])

    @ti.func
    def scatter_dilation(
        x: ti.template(),
        points: ti.template(),
        labels: ti.template(),
        materials: ti.template(),
        means: ti.template(),
        control: ti.template(),
        p,
    ):
        """Give the nodes a point's dilation times the root of its stiffness, weighed by its volume."""
        row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
        stiffness = ti.cast(materials[row + at.MEAN_STIFFNESS], real)
        if stiffness > 0:
            offset, first, sx, sy = stencil(x, control, p)
            w = weights(offset)
            o = p * at.POINT_WIDTH
            volume = points[o + at.MASS] * ti.cast(materials[row + at.LIGHTNESS], real)
            given = volume * vec2(stiffness * points[o + at.DILATION], 1)
            for i, j in ti.static(ti.ndrange(3, 3)):
                part = (w[i, 0] * w[j, 1]) * given
                line = first + i * sx + j * sy
                for k in ti.static(range(3)):
                    if ti.static(on_gpu):
                        means[line + k] += w[k, 2] * part
                    else:
                        means[line + k] = means[line + k] + w[k, 2] * part

    @ti.func
    def mean_pressure(
        points: ti.template(),
        labels: ti.template(),
        materials: ti.template(),
        means: ti.template(),
        w,
        first,
        sx,
        sy,
        p,
    ):
        """What the mean dilation around a point adds to its scaled stress, along the diagonal."""
        row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
        stiffness = ti.cast(materials[row + at.MEAN_STIFFNESS], real)
        pressure = real(0.0)
        if stiffness > 0:
            for i, j in ti.static(ti.ndrange(3, 3)):
                line = first + i * sx + j * sy
                along = w[0, 2] * means[line][0] + w[1, 2] * means[line + 1][0] + w[2, 2] * means[line + 2][0]
                pressure += (w[i, 0] * w[j, 1]) * along
            pressure *= stiffness * ti.cast(materials[row + at.LIGHTNESS], real)
            if ti.cast(materials[row + at.KIND], ti.i32) == ti.static(at.KINDS["elastic"]):
                # d(J - 1) = J tr L dt, where d(ln J) = tr L dt.
                pressure *= 1 + points[p * at.POINT_WIDTH + at.DILATION]
        return pressure

    @ti.func
    def scatter(
        x: ti.template(),
        points: ti.template(),
        labels: ti.template(),
        grid: ti.template(),
        means: ti.template(),
        materials: ti.template(),
        batch: ti.template(),
        control: ti.template(),
        p,
    ):
        offset, first, sx, sy = stencil(x, control, p)
        w = weights(offset)
        d = slopes(offset)
        o = p * at.POINT_WIDTH
        m = points[o + at.MASS]
        t = o + at.STRESS
        S = ti.Matrix(
            [
                [points[t], points[t + 3], points[t + 4]],
                [points[t + 3], points[t + 1], points[t + 5]],
                [points[t + 4], points[t + 5], points[t + 2]],
            ]
        )
        if ti.static(averaged):
            pressure = mean_pressure(points, labels, materials, means, w, first, sx, sy, p)
            for axis in ti.static(range(3)):
                S[axis, axis] += pressure
        S *= ti.cast(batch[words.STEP], real)
        A = row9(points, o + at.AFFINE) - real(1 - GRADIENT_SHARE) * S
        u = row3(points, o + at.VELOCITY) - A @ offset
        S *= real(-GRADIENT_SHARE / 4) * m
        start = vec4(u[0], u[1], u[2], 1)
        ax = vec4(A[0, 0], A[1, 0], A[2, 0], 0)
        ay = vec4(A[0, 1], A[1, 1], A[2, 1], 0)
        az = vec4(A[0, 2], A[1, 2], A[2, 2], 0)
        px = vec4(S[0, 0], S[1, 0], S[2, 0], 0)
        py = vec4(S[0, 1], S[1, 1], S[2, 1], 0)
        pz = vec4(S[0, 2], S[1, 2], S[2, 2], 0)
        for i in ti.static(range(3)):
            wi = w[i, 0] * m
            bi = wi * (start + i * ax) + d[i, 0] * px
            yi = wi * ay
            zi = wi * az
            pyi = w[i, 0] * py
            pzi = w[i, 0] * pz
            for j in ti.static(range(3)):
                b = w[j, 1] * (bi + j * yi) + d[j, 1] * pyi
                zij = w[j, 1] * zi
                pzij = w[j, 1] * pzi
                line = first + i * sx + j * sy
                for k in ti.static(range(3)):
                    given = ti.cast(w[k, 2] * (b + k * zij) + d[k, 2] * pzij, ti.f64)
                    if ti.static(on_gpu):
                        grid[line + k] += given
                    else:
                        grid[line + k] = grid[line + k] + given

    @ti.func
    def gather(x: ti.template(), grid: ti.template(), control: ti.template(), p):
        """Velocity, its affine part C and the velocity gradient L at a point."""
        offset, first, sx, sy = stencil(x, control, p)
        w = weights(offset)
        d = slopes(offset)
        # Relative to the middle node: what moves as one does not change its velocity, in whatever precision.
        middle = grid[first + sx + sy + 1]
        V, CX, CY, CZ = vec4(0), vec4(0), vec4(0), vec4(0)
        GX, GY, GZ = vec4(0), vec4(0), vec4(0)
        for i in ti.static(range(3)):
            si, siy, siz = vec4(0), vec4(0), vec4(0)
            diy, diz = vec4(0), vec4(0)
            for j in ti.static(range(3)):
                line = first + i * sx + j * sy
                g0 = ti.cast(grid[line] - middle, real)
                g1 = ti.cast(grid[line + 1] - middle, real)
                g2 = ti.cast(grid[line + 2] - middle, real)
                t1 = w[1, 2] * g1
                t2 = w[2, 2] * g2
                s0 = w[0, 2] * g0 + t1 + t2
                si += w[j, 1] * s0
                siz += w[j, 1] * (t1 + 2.0 * t2)
                diy += d[j, 1] * s0
                diz += w[j, 1] * (d[0, 2] * g0 + d[1, 2] * g1 + d[2, 2] * g2)
                if ti.static(j > 0):
                    siy += (j * w[j, 1]) * s0
            V += w[i, 0] * si
            CY += w[i, 0] * siy
            CZ += w[i, 0] * siz
            GX += d[i, 0] * si
            GY += w[i, 0] * diy
            GZ += w[i, 0] * diz
            if ti.static(i > 0):
                CX += (i * w[i, 0]) * si
        CX = 4.0 * (CX - offset[0] * V)
        CY = 4.0 * (CY - offset[1] * V)
        CZ = 4.0 * (CZ - offset[2] * V)
        C = ti.Matrix([[CX[0], CY[0], CZ[0]], [CX[1], CY[1], CZ[1]], [CX[2], CY[2], CZ[2]]])
        G = ti.Matrix([[GX[0], GY[0], GZ[0]], [GX[1], GY[1], GZ[1]], [GX[2], GY[2], GZ[2]]])
        L = real(1 - GRADIENT_SHARE) * C + real(GRADIENT_SHARE) * G
        V += ti.cast(middle, real)
        return vec3(V[0], V[1], V[2]), C, L

    @ti.func
    def write9(table: ti.template(), start, M):
        for r in ti.static(range(3)):
            for c in ti.static(range(3)):
                table[start + 3 * r + c] = M[r, c]

    @ti.func
    def write_stress(points: ti.template(), o, S, dilation):
        for c in ti.static(range(3)):
            points[o + at.STRESS + c] = S[c, c]
        points[o + at.STRESS + 3] = S[0, 1]
        points[o + at.STRESS + 4] = S[0, 2]
        points[o + at.STRESS + 5] = S[1, 2]
        points[o + at.DILATION] = dilation

    @ti.func
    def move_point(
        x: ti.template(),
        points: ti.template(),
        labels: ti.template(),
        grid: ti.template(),
        materials: ti.template(),
        batch: ti.template(),
        control: ti.template(),
        report: ti.template(),
        p,
    ):
        """Grid to point, then F, the return mapping and the stress that the next scatter reads."""
        v, C, L = gather(x, grid, control, p)
        dt = ti.cast(batch[words.STEP], real)
        o = p * at.POINT_WIDTH
        F = row9(points, o + at.DEFORMATION)
        row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
        F, history, tau, dilation = advance(F, L, points[o + at.HISTORY], dt, materials, row)
        write_stress(points, o, tau, dilation)
        write9(points, o + at.DEFORMATION, F)
        write9(points, o + at.AFFINE, C)
        points[o + at.HISTORY] = history
        for d in ti.static(range(3)):
            points[o + at.VELOCITY + d] = v[d]
        place = x[p] + batch[words.STEP] * ti.cast(v, ti.f64)
        if control[words.CLAMP] == 1:
            held = 0
            for d in ti.static(range(3)):
                if place[d] < batch[words.WALL_LOW + d]:
                    place[d] = batch[words.WALL_LOW + d]
                    points[o + at.VELOCITY + d] = ti.max(v[d], real(0.0))
                    held = 1
                elif place[d] > batch[words.WALL_HIGH + d]:
                    place[d] = batch[words.WALL_HIGH + d]
                    points[o + at.VELOCITY + d] = ti.min(v[d], real(0.0))
                    held = 1
            if held == 1:
                ti.atomic_add(report[words.CLAMPED], 1)
        x[p] = place
        # Written so that NaN fails it: a point that is nowhere must not be scattered either.
        near = True
        for d in ti.static(range(3)):
            drift = place[d] - 0.5 - ti.cast(labels[p * at.LABEL_WIDTH + at.HOME + d], ti.f64)
            near = near and drift >= -1.0 and drift < 2.0
        if not near:
            report[words.DRIFTED] = 1

    @ti.func
    def block_corner(control: ti.template(), block):
        by = control[words.SHAPE + 1] // 4
        bz = control[words.SHAPE + 2] // 4
        return ti.Vector([block // (by * bz), block // bz % by, block % bz]) * 4

    @ti.func
    def line_of(control: ti.template(), corner, i, j):
        """The first of four nodes along z."""
        return ((corner[0] + i) * control[words.SHAPE + 1] + corner[1] + j) * control[words.SHAPE + 2] + corner[2]

    @ti.func
    def clear_block(grid: ti.template(), means: ti.template(), active: ti.template(), control: ti.template(), q):
        corner = block_corner(control, active[q])
        for i in range(4):
            for j in range(4):
                line = line_of(control, corner, i, j)
                for k in ti.static(range(4)):
                    grid[line + k] = node4(0)
                    if ti.static(averaged):
                        means[line + k] = vec2(0)

    @ti.func
    def divide_block(means: ti.template(), active: ti.template(), control: ti.template(), q):
        """Sums over volumes to means, at the nodes of one block."""
        corner = block_corner(control, active[q])
        for i in range(4):
            for j in range(4):
                line = line_of(control, corner, i, j)
                for k in range(4):
                    total = means[line + k]
                    if total[1] > least_mass:
                        means[line + k][0] = total[0] / total[1]
                    else:
                        means[line + k][0] = 0

    @ti.func
    def update_block(
        grid: ti.template(),
        active: ti.template(),
        batch: ti.template(),
        forcing: ti.template(),
        control: ti.template(),
        report: ti.template(),
        drive_set,
        q,
    ):
        """Momentum to velocity, then whatever acts on it, at the nodes of one block."""
        corner = block_corner(control, active[q])
        kick = ti.Vector([batch[words.GRAVITY], batch[words.GRAVITY + 1], batch[words.GRAVITY + 2]])
        for i in range(4):
            for j in range(4):
                line = line_of(control, corner, i, j)
                for k in range(4):
                    g = grid[line + k]
                    v = kick * 0
                    if g[3] > least_mass:
                        u = ti.Vector([g[0], g[1], g[2]]) / g[3] + kick
                        node = ti.Vector([control[words.LOWER + d] for d in range(3)]) + corner + ti.Vector([i, j, k])
                        place = ti.cast(node, ti.f64)
                        v = constrain(u, place, batch, forcing, control, report, drive_set)
                    grid[line + k] = node4(v[0], v[1], v[2], 0)

    @ti.kernel
    def steps_in_thread(
        x: Positions,
        points: Reals,
        labels: Ints,
        grid: Grid,
        means: Means,
        tiles: Ints,
        active: Ints,
        materials: Doubles,
        batch: Doubles,
        forcing: Doubles,
        control: Ints,
        report: Ints,
        first: ti.i32,
        count: ti.i32,
    ):
        """Up to `count` steps in the calling thread; stops after one that leaves a point too far from home."""
        ti.loop_config(serialize=True)
        for step in range(count):
            if report[words.DRIFTED] == 0:
                for q in range(control[words.ACTIVE]):
                    clear_block(grid, means, active, control, q)
                if ti.static(averaged):
                    for q in range(control[words.COLOURS_AT + 8]):
                        for p in range(tiles[2 * q], tiles[2 * q + 1]):
                            scatter_dilation(x, points, labels, materials, means, control, p)
                    for q in range(control[words.ACTIVE]):
                        divide_block(means, active, control, q)
                for q in range(control[words.COLOURS_AT + 8]):
                    for p in range(tiles[2 * q], tiles[2 * q + 1]):
                        scatter(x, points, labels, grid, means, materials, batch, control, p)
                for q in range(control[words.ACTIVE]):
                    update_block(grid, active, batch, forcing, control, report, first + step, q)
                for p in range(control[words.POINTS]):
                    move_point(x, points, labels, grid, materials, batch, control, report, p)
                report[words.STEPS_DONE] += 1

    @ti.kernel
    def clear(grid: Grid, means: Means, active: Ints, control: Ints):
        """Empty the nodes that points can reach."""
        ti.loop_config(parallelize=pool)
        for q in range(control[words.ACTIVE]):
            clear_block(grid, means, active, control, q)

    @ti.kernel
    def scatter_colour(
        x: Positions,
        points: Reals,
        labels: Ints,
        grid: Grid,
        means: Means,
        tiles: Ints,
        materials: Doubles,
        batch: Doubles,
        control: Ints,
        colour: ti.i32,
    ):
        """Points to the grid, the tiles of one colour: they write disjoint nodes, each tile in order.

        A launch a colour, because eight copies of the loop in one kernel take four times as long to compile.
        """
        ti.loop_config(parallelize=pool)
        for q in range(control[words.COLOURS_AT + colour], control[words.COLOURS_AT + colour + 1]):
            for p in range(tiles[2 * q], tiles[2 * q + 1]):
                scatter(x, points, labels, grid, means, materials, batch, control, p)

    @ti.kernel
    def scatter_atomically(
        x: Positions,
        points: Reals,
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
    def average_colour(
        x: Positions,
        points: Reals,
        labels: Ints,
        means: Means,
        tiles: Ints,
        materials: Doubles,
        control: Ints,
        colour: ti.i32,
    ):
        """Dilations to the grid, as `scatter_colour`."""
        ti.loop_config(parallelize=pool)
        for q in range(control[words.COLOURS_AT + colour], control[words.COLOURS_AT + colour + 1]):
            for p in range(tiles[2 * q], tiles[2 * q + 1]):
                scatter_dilation(x, points, labels, materials, means, control, p)

    @ti.kernel
    def average_atomically(x: Positions, points: Reals, labels: Ints, means: Means, materials: Doubles, control: Ints):
        """Dilations to the grid, a point a thread (GPU)."""
        for p in range(control[words.POINTS]):
            scatter_dilation(x, points, labels, materials, means, control, p)

    @ti.kernel
    def divide(means: Means, active: Ints, control: Ints):
        """Sums of dilations to means."""
        ti.loop_config(parallelize=pool)
        for q in range(control[words.ACTIVE]):
            divide_block(means, active, control, q)

    @ti.kernel
    def update_and_move(
        x: Positions,
        points: Reals,
        labels: Ints,
        grid: Grid,
        active: Ints,
        materials: Doubles,
        batch: Doubles,
        forcing: Doubles,
        control: Ints,
        report: Ints,
        step: ti.i32,
    ):
        """The rest of step number `step` of the batch."""
        ti.loop_config(parallelize=pool)
        for q in range(control[words.ACTIVE]):
            update_block(grid, active, batch, forcing, control, report, step, q)
        ti.loop_config(parallelize=pool)
        for p in range(control[words.POINTS]):
            move_point(x, points, labels, grid, materials, batch, control, report, p)

    @ti.kernel
    def strain(points: Reals, labels: Ints, materials: Doubles, control: Ints):
        """The stress that belongs to the points as they are, their velocity gradient taken for C."""
        ti.loop_config(serialize=serial, parallelize=pool)
        for p in range(control[words.POINTS]):
            o = p * at.POINT_WIDTH
            L = row9(points, o + at.AFFINE)
            F = row9(points, o + at.DEFORMATION)
            row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
            F, _, tau, dilation = stress_of(F, L, points[o + at.HISTORY], real(0.0), materials, row)
            write_stress(points, o, tau, dilation)

    @ti.kernel
    def learn_affine(x: Positions, points: Reals, grid: Grid, active: Ints, control: Ints):
        """C of the velocity field that was scattered; nothing moves and nothing deforms."""
        ti.loop_config(serialize=serial, parallelize=pool)
        for q in range(control[words.ACTIVE]):
            corner = block_corner(control, active[q])
            for i in range(4):
                for j in range(4):
                    line = line_of(control, corner, i, j)
                    for k in range(4):
                        g = grid[line + k]
                        v = node4(0)
                        if g[3] > least_mass:
                            v = g / g[3]
                        grid[line + k] = v
        ti.loop_config(serialize=serial, parallelize=pool)
        for p in range(control[words.POINTS]):
            _v, C, _L = gather(x, grid, control, p)
            write9(points, p * at.POINT_WIDTH + at.AFFINE, C)

    @ti.kernel
    def settle(x: Positions, labels: Ints, control: Ints):
        """Give every point the cell it is in as its home."""
        ti.loop_config(serialize=serial, parallelize=pool)
        for p in range(control[words.POINTS]):
            cell = ti.cast(ti.floor(x[p] - 0.5), ti.i32)
            for d in ti.static(range(3)):
                labels[p * at.LABEL_WIDTH + at.HOME + d] = cell[d]

    @ti.kernel
    def permute(
        order: Ints,
        control: Ints,
        x: Positions,
        points: Reals,
        labels: Ints,
        x_new: Positions,
        points_new: Reals,
        labels_new: Ints,
    ):
        """Rows in a new order."""
        ti.loop_config(serialize=serial, parallelize=pool)
        for q in range(control[words.POINTS]):
            p = order[q]
            x_new[q] = x[p]
            for c in range(at.POINT_WIDTH):
                points_new[q * at.POINT_WIDTH + c] = points[p * at.POINT_WIDTH + c]
            for c in ti.static(range(at.LABEL_WIDTH)):
                labels_new[q * at.LABEL_WIDTH + c] = labels[p * at.LABEL_WIDTH + c]

    @ti.kernel
    def survey(x: Positions, points: Reals, labels: Ints, materials: Doubles, control: Ints, result: Doubles):
        """What the next step depends on, a row per chunk of points: maxima, extents, and what is not finite."""
        ti.loop_config(serialize=serial, parallelize=pool)
        for chunk in range((control[words.POINTS] + at.SURVEY_CHUNK - 1) // at.SURVEY_CHUNK):
            stiffness, speed, gradient = ti.f64(0.0), ti.f64(0.0), ti.f64(0.0)
            bad, inverted = 0, 0
            begin = chunk * at.SURVEY_CHUNK
            low, high = x[begin], x[begin]
            for p in range(begin, ti.min(begin + at.SURVEY_CHUNK, control[words.POINTS])):
                o = p * at.POINT_WIDTH
                v = ti.cast(row3(points, o + at.VELOCITY), ti.f64)
                C = ti.cast(row9(points, o + at.AFFINE), ti.f64)
                F = ti.cast(row9(points, o + at.DEFORMATION), ti.f64)
                history = ti.cast(points[o + at.HISTORY], ti.f64)
                place = x[p]
                # x - x is 0 but for infinities and NaN, and a sum of zeros is 0 but for any NaN among them.
                residue = (v - v).sum() + (C - C).sum() + (F - F).sum() + (history - history) + (place - place).sum()
                if not (residue == 0.0):  # noqa: SIM201 - NaN is neither equal nor unequal
                    bad += 1
                else:
                    row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
                    J = F.determinant()
                    # `gasp_core.engine.stability.stiffening`, in its words: the largest root of s^3 - |F|^2 s + 2 |J|.
                    scale = ti.sqrt(ti.max(F.norm_sqr() / 3.0, ti.f64(1e-200)))
                    angle = ti.acos(-ti.min(ti.abs(J) / (scale * scale * scale), ti.f64(1.0))) / 3.0
                    longest = 2.0 * scale * ti.cos(angle)
                    stretch = ti.max(longest, ti.abs(J), ti.f64(1.0))
                    factor = 2.0 * stretch * stretch - stretch
                    kind = ti.cast(materials[row + at.KIND], ti.i32)
                    if kind >= ti.static(at.KINDS["metal"]):
                        # `hencky_stiffening`: x coth x.
                        apart = 3.0 * ti.log(longest) - ti.log(ti.max(ti.abs(J), ti.f64(1e-200)))
                        apart = ti.max(apart, ti.f64(1e-9))
                        factor = apart / ti.tanh(apart)
                    if kind == ti.static(at.KINDS["snow"]):
                        # `snow_stiffening`.
                        pressed = 1.0 - ti.exp(ti.min(history, ti.f64(1.0)))
                        grown = ti.max(materials[row + at.HARDENING] * pressed, ti.f64(0.0))
                        factor *= ti.exp(ti.min(grown, ti.f64(200.0)))
                    if kind == ti.static(at.KINDS["fluid"]):
                        # F = J^(1/3) I; Cole's pressure stiffens with J^-6, one power more each way leaves room.
                        J = 1.0 + history
                        stretch = ti.max(J, ti.f64(1.0))
                        factor = ti.max(2.0 * stretch * stretch - stretch, 1.0 / (J * J * J * J * J * J * J * J))
                    stiffness = ti.max(stiffness, factor * materials[row + at.INVERSE_BOUND])
                    speed = ti.max(speed, v.norm_sqr())
                    gradient = ti.max(gradient, C.norm_sqr())
                    if J <= 0:
                        inverted += 1
                    low = ti.min(low, place)
                    high = ti.max(high, place)
            o = chunk * at.SURVEY_WIDTH
            result[o + at.SURVEY_STIFFNESS] = stiffness
            result[o + at.SURVEY_SPEED] = speed
            result[o + at.SURVEY_GRADIENT] = gradient
            result[o + at.SURVEY_BAD] = bad
            result[o + at.SURVEY_INVERTED] = inverted
            for d in ti.static(range(3)):
                result[o + at.SURVEY_LOW + d] = low[d]
                result[o + at.SURVEY_HIGH + d] = high[d]

    return SimpleNamespace(
        steps_in_thread=steps_in_thread,
        clear=clear,
        scatter_colour=scatter_colour,
        scatter_atomically=scatter_atomically,
        update_and_move=update_and_move,
        average_colour=average_colour,
        average_atomically=average_atomically,
        divide=divide,
        strain=strain,
        learn_affine=learn_affine,
        settle=settle,
        permute=permute,
        survey=survey,
    )
