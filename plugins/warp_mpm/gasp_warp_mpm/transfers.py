"""Between points and nodes: mass, momentum and dilation one way, velocity and its gradients the other.

With cells for lengths and point masses for masses a point's stress gives a node -dt m tau' a / 4, tau' = 4 T^2 /
(rho dx^2) tau and a the kernel of `gasp_core.stepping.mpm`: no volume is needed. Its part 4 (1 - s) w r folds into the
affine velocity, what is left is s times the splines' gradient. Quadratic B-splines and affine transfers after Hu et
al. 2018 (10.1145/3197517.3201293).
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import GRADIENT_SHARE
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.native import make_native
from gasp_warp_mpm.native_words import worded
from gasp_warp_mpm.tables import tables_of

__all__ = ["make_transfers"]


# Four numbers that lie together, in as few accesses to memory as there can be.
_QUAD = """
    struct alignas(16) quad { REAL v[4]; };
"""
_LOAD = (
    _QUAD
    + """
    const quad q = *(const quad*)((const REAL*)table.data + start);
    return wp::vec_t<4, REAL>(q.v[0], q.v[1], q.v[2], q.v[3]);
"""
)
_STORE = (
    _QUAD
    + """
    *(quad*)((REAL*)table.data + start) = quad{{numbers[0], numbers[1], numbers[2], numbers[3]}};
"""
)
_NODE = (
    _QUAD
    + """
    const quad q = ((const quad*)grid.data)[node];
    return wp::vec_t<4, REAL>(q.v[0], q.v[1], q.v[2], q.v[3]);
"""
)


@cache
def make_transfers(double: bool, averaged: bool, *, native: bool) -> SimpleNamespace:
    """Functions scatter_dilation, mean_pressure, scatter, gather and those for rows; parameters as `make_kernels`.

    scatter_carried and gather_carried do the same with the grid before anything acts on it.
    """
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec2, vec3, vec4, mat33 = types.vec2, types.vec3, types.vec4, types.mat33
    Reals = wp.array(dtype=real)
    Grid = wp.array(dtype=vec4)
    Tables = tables_of(real)
    lines = make_native(double, averaged)
    collect, collect_carried = lines.collect, lines.collect_carried
    mat74 = wp.types.matrix((7, 4), real)
    zero, one, two, four = real(0.0), real(1.0), real(2.0), real(4.0)
    half, three_halves = real(0.5), real(1.5)
    half_cell = wp.float64(0.5)
    # The nodes of a stencil, in cells; Warp takes a real(i) of an unrolled i for all later uses of i.
    along = vec3(0.0, 1.0, 2.0)
    folded, shared = real(1 - GRADIENT_SHARE), real(GRADIENT_SHARE)
    shared_force = real(-GRADIENT_SHARE / 4)
    is_elastic = at.KINDS["elastic"]
    unit = mat33(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    # ---- rows -------------------------------------------------------------------------------------------------------

    @wp.func
    def row3(table: Reals, start: int):
        return vec3(table[start], table[start + 1], table[start + 2])

    @wp.func_native(worded(double, _LOAD))
    def load(table: Reals, start: int) -> vec4:
        """Four numbers from one that is a multiple of four."""

    @wp.func_native(worded(double, _STORE))
    def store(table: Reals, start: int, numbers: vec4):
        """The other way."""

    @wp.func_native(worded(double, _NODE))
    def node_of(grid: Grid, node: int) -> vec4:
        """What is at a node, as `load`."""

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
            c = offset[d] - half
            w[0, d] = half * a * a
            w[2, d] = half * c * c
            # Not 3/4 - (offset - 1)^2: the three are to add up to one.
            w[1, d] = one - (w[0, d] + w[2, d])
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
                pressure *= wp.determinant(unit + row9(s.points, p * at.POINT_WIDTH + at.DISPLACEMENT_GRADIENT))
        return pressure

    @wp.func
    def keep_pressures(s: Tables, begin: int, end: int):
        """Write the mean pressure of points begin .. end into their rows, for native code that gives their momentum."""
        for p in range(begin, end):
            offset, first, sx, sy = stencil(s, p)
            s.points[p * at.POINT_WIDTH + at.MEAN_PRESSURE] = mean_pressure(s, p, weights(offset), first, sx, sy)

    @wp.func
    def spread(s: Tables, grid: Grid, p: int, stress: mat33):
        """A point's mass and momentum, and what its stress gives in the step, to the 27 nodes around it."""
        offset, first, sx, sy = stencil(s, p)
        w = weights(offset)
        d = slopes(offset)
        o = p * at.POINT_WIDTH
        m = s.points[o + at.MASS]
        A = row9(s.points, o + at.AFFINE) - folded * stress
        u = row3(s.points, o + at.VELOCITY) - A @ offset
        S = (shared_force * m) * stress
        start = vec4(u[0], u[1], u[2], one)
        ax = vec4(A[0, 0], A[1, 0], A[2, 0], zero)
        ay = vec4(A[0, 1], A[1, 1], A[2, 1], zero)
        az = vec4(A[0, 2], A[1, 2], A[2, 2], zero)
        px = vec4(S[0, 0], S[1, 0], S[2, 0], zero)
        py = vec4(S[0, 1], S[1, 1], S[2, 1], zero)
        pz = vec4(S[0, 2], S[1, 2], S[2, 2], zero)
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
                    node = line + k
                    grid[node] = grid[node] + (w[k, 2] * (b + along[k] * zij) + d[k, 2] * pzij)

    @wp.func
    def scatter(s: Tables, p: int):
        """A point's mass and momentum, with the step's stress."""
        t = p * at.POINT_WIDTH + at.STRESS
        diagonal = row3(s.points, t)
        shear = row3(s.points, t + 3)
        if averaged:
            offset, first, sx, sy = stencil(s, p)
            diagonal = diagonal + vec3(mean_pressure(s, p, weights(offset), first, sx, sy))
        S = real(s.step) * mat33(
            diagonal[0], shear[0], shear[1], shear[0], diagonal[1], shear[2], shear[1], shear[2], diagonal[2]
        )
        spread(s, s.grid, p, S)

    @wp.func
    def scatter_carried(s: Tables, p: int):
        """What the point brings alone."""
        spread(s, s.carried, p, mat33())

    @wp.func
    def gather_from(s: Tables, grid: Grid, p: int):
        """Velocity and, where it is kept, mass, the affine part C and the velocity gradient L at a point."""
        offset, first, sx, sy = stencil(s, p)
        w = weights(offset)
        d = slopes(offset)
        # Relative to the middle node: what moves as one does not change its velocity, in whatever precision.
        middle = node_of(grid, first + sx + sy + 1)
        V, CX, CY, CZ = vec4(), vec4(), vec4(), vec4()
        GX, GY, GZ = vec4(), vec4(), vec4()
        for i in range(3):
            si, siy, siz = vec4(), vec4(), vec4()
            diy, diz = vec4(), vec4()
            for j in range(3):
                line = first + i * sx + j * sy
                g0 = node_of(grid, line) - middle
                g1 = node_of(grid, line + 1) - middle
                g2 = node_of(grid, line + 2) - middle
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
        V = V + middle
        C = mat33(CX[0], CY[0], CZ[0], CX[1], CY[1], CZ[1], CX[2], CY[2], CZ[2])
        G = mat33(GX[0], GY[0], GZ[0], GX[1], GY[1], GZ[1], GX[2], GY[2], GZ[2])
        return V, C, folded * C + shared * G

    @wp.func
    def gather(s: Tables, p: int):
        """At a point, of the grid after all that acts."""
        V, C, L = gather_from(s, s.grid, p)
        return vec3(V[0], V[1], V[2]), C, L

    @wp.func
    def gather_carried(s: Tables, p: int):
        """Velocity, C and mass that the points brought."""
        V, C, _L = gather_from(s, s.carried, p)
        return vec3(V[0], V[1], V[2]), C, V[3]

    @wp.func
    def affine_of(f: mat74):
        return mat33(f[1, 0], f[2, 0], f[3, 0], f[1, 1], f[2, 1], f[3, 1], f[1, 2], f[2, 2], f[3, 2])

    @wp.func
    def collected(s: Tables, p: int):
        """As `gather`, by the native loops."""
        f = collect(s, p)
        L = mat33(f[4, 0], f[5, 0], f[6, 0], f[4, 1], f[5, 1], f[6, 1], f[4, 2], f[5, 2], f[6, 2])
        return vec3(f[0, 0], f[0, 1], f[0, 2]), affine_of(f), L

    @wp.func
    def collected_carried(s: Tables, p: int):
        """As `gather_carried`, by the native loops."""
        f = collect_carried(s, p)
        return vec3(f[0, 0], f[0, 1], f[0, 2]), affine_of(f), f[0, 3]

    return SimpleNamespace(
        row3=row3,
        row9=row9,
        load=load,
        store=store,
        write9=write9,
        write_stress=write_stress,
        material_row=material_row,
        stencil=stencil,
        weights=weights,
        slopes=slopes,
        scatter_dilation=scatter_dilation,
        keep_pressures=keep_pressures,
        scatter=scatter,
        scatter_carried=scatter_carried,
        gather=collected if native else gather,
        gather_carried=collected_carried if native else gather_carried,
    )
