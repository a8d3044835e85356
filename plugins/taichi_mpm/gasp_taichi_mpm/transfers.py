"""Points to nodes and back: quadratic B-splines, affine transfers, stress by moving least squares and by gradients.

Everything is in the engine's own units (`scaling.Units`): cells, point masses, the stiffest material's stable step.
With them a point's stress gives a node -dt m tau' a / 4, tau' = 4 T^2 / (rho dx^2) tau and a the kernel of
`gasp_core.stepping.mpm`: no volume is needed, and float32 neither overflows nor underflows whatever the scene's size.
Moving least squares MPM after Hu et al. 2018 (10.1145/3197517.3201293); the part 4 (1 - s) w r of the kernel folds
into the affine velocity, what is left is s times the splines' gradient.

Positions are float64 in every precision: x += dt v in float32 loses half an ulp a step, always in the same direction.
So are the grid and the sums over it: where matter rests under stress the pulls on a node round alike at every step, and
momentum drifts; and vectors of four float64 are added as fast as vectors of four float32, without a conversion a node.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import GRADIENT_SHARE
from gasp_taichi_mpm import words
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["columns", "make_overwrite", "make_transfers", "numbers4", "slopes", "weights"]

_node4 = ti.types.vector(4, ti.f64)


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
def columns(table: ti.template(), row):
    """(3, 3), of three rows that hold its columns."""
    return ti.Matrix.cols(
        [
            ti.Vector([table[row][0], table[row][1], table[row][2]]),
            ti.Vector([table[row + 1][0], table[row + 1][1], table[row + 1][2]]),
            ti.Vector([table[row + 2][0], table[row + 2][1], table[row + 2][2]]),
        ]
    )


@ti.func
def row_of(M, k: ti.template()):
    return ti.Vector([M[k, 0], M[k, 1], M[k, 2]])


def make_overwrite(real: Any) -> Callable[..., None]:
    """Taichi function that stores a vector of four as one.

    Reading the places first makes Taichi compute their addresses before it stores to any of them; else it asks anew
    after each, because the store might have changed where the table is, and four stores and all that leads to them are
    compiled apart.
    """
    bits = ti.i64 if real == ti.f64 else ti.i32

    @ti.func
    def overwrite(table: ti.template(), row, value):
        before = table[row]
        for k in ti.static(range(4)):
            there = ti.bit_cast(before[k], bits)
            table[row][k] = ti.bit_cast(ti.bit_cast(value[k], bits) + (there ^ there), real)

    return overwrite


@ti.func
def cell_of(place):
    """Base cell of the stencil around a place."""
    return ti.cast(ti.floor(place - 0.5), ti.i32)


@ti.func
def has_drifted(cells):
    """Whether a point so many cells from home may reach nodes beyond its tile's.

    Of whole numbers, because the compiler is told that there is no NaN. One has some cell all the same, the same as in
    `stencil`: either it counts as drifted, or what it touches is there.
    """
    far = False
    for d in ti.static(range(3)):
        far = far or cells[d] < -1 or cells[d] > 1
    return far


@ti.func
def stencil(x: ti.template(), control: ti.template(), p):
    """Offset in the base cell, the linear index of the stencil's first node, and an index step along x and y."""
    place = x[p]
    base = ti.floor(place - 0.5)
    cell = cell_of(place)
    sy = control[words.SHAPE + 2]
    sx = control[words.SHAPE + 1] * sy
    first = (
        (cell[0] - control[words.LOWER]) * sx
        + (cell[1] - control[words.LOWER + 1]) * sy
        + (cell[2] - control[words.LOWER + 2])
    )
    return place - base, first, sx, sy


@ti.func
def numbers4(table: ti.template(), start):
    """Four numbers of a flat table."""
    return _node4(table[start], table[start + 1], table[start + 2], table[start + 3])


def make_transfers(real: Any, *, averaged: bool, flowing: bool, atomic: bool) -> SimpleNamespace:
    """Taichi functions for one precision of the points.

    Parameters
    ----------
    averaged
        Something is nearly incompressible: its dilation is averaged over the nodes before it acts.
    flowing
        What the points bring is also kept as it is before anything acts on it.
    atomic
        Points that share a node may be scattered at the same time.
    """
    vec2 = ti.types.vector(2, real)

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
            w = weights(ti.cast(offset, real))
            r = (p & words.POINT_BITS) * words.POINT_ROWS
            volume = points[r + words.MASS][3] * ti.cast(materials[row + at.LIGHTNESS], real)
            given = volume * vec2(stiffness * points[r + words.DILATION][3], 1)
            for i, j in ti.static(ti.ndrange(3, 3)):
                part = (w[i, 0] * w[j, 1]) * given
                line = (first + i * sx + j * sy) & words.NODE_BITS
                for k in ti.static(range(3)):
                    if ti.static(atomic):
                        means[line + k] += w[k, 2] * part
                    else:
                        means[line + k] = means[line + k] + w[k, 2] * part

    @ti.func
    def mean_pressure(
        points: ti.template(),
        labels: ti.template(),
        materials: ti.template(),
        means: ti.template(),
        offset,
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
            w = weights(ti.cast(offset, real))
            for i, j in ti.static(ti.ndrange(3, 3)):
                line = (first + i * sx + j * sy) & words.NODE_BITS
                along = w[0, 2] * means[line][0] + w[1, 2] * means[line + 1][0] + w[2, 2] * means[line + 2][0]
                pressure += (w[i, 0] * w[j, 1]) * along
            pressure *= stiffness * ti.cast(materials[row + at.LIGHTNESS], real)
            if ti.cast(materials[row + at.KIND], ti.i32) == ti.static(at.KINDS["elastic"]):
                # d(J - 1) = J tr L dt, where d(ln J) = tr L dt.
                H = columns(points, (p & words.POINT_BITS) * words.POINT_ROWS + words.DISPLACEMENT_GRADIENT)
                pressure *= (H + ti.Matrix.identity(real, 3)).determinant()
        return pressure

    @ti.func
    def scatter_carried(
        points: ti.template(), grid: ti.template(), control: ti.template(), offset, w, first, sx, sy, p
    ):
        """As `scatter`, without what stress gives."""
        r = (p & words.POINT_BITS) * words.POINT_ROWS
        m = ti.cast(points[r + words.MASS][3], ti.f64)
        ax = ti.cast(points[r + words.AFFINE], ti.f64)
        ay = ti.cast(points[r + words.AFFINE + 1], ti.f64)
        az = ti.cast(points[r + words.AFFINE + 2], ti.f64)
        start = ti.cast(points[r + words.VELOCITY], ti.f64) - (offset[0] * ax + offset[1] * ay + offset[2] * az)
        start[3] = 1.0
        for i in ti.static(range(3)):
            wi = m * w[i, 0]
            along_x = wi * (start + i * ax)
            for j in ti.static(range(3)):
                wij = wi * w[j, 1]
                along_xy = w[j, 1] * along_x + (j * wij) * ay
                line = (first + i * sx + j * sy) & words.NODE_BITS
                for k in ti.static(range(3)):
                    given = w[k, 2] * (along_xy + (k * wij) * az)
                    if ti.static(atomic):
                        grid[line + k] += given
                    else:
                        grid[line + k] = grid[line + k] + given

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
        """Give the nodes a point's mass and momentum: w m (v + C r) and its stress."""
        offset, first, sx, sy = stencil(x, control, p)
        w = weights(offset)
        d = slopes(offset)
        r = (p & words.POINT_BITS) * words.POINT_ROWS
        m = ti.cast(points[r + words.MASS][3], ti.f64)
        step = numbers4(batch, words.STEP_VECTOR)
        tx = step * ti.cast(points[r + words.STRESS], ti.f64)
        ty = step * ti.cast(points[r + words.STRESS + 1], ti.f64)
        tz = step * ti.cast(points[r + words.STRESS + 2], ti.f64)
        if ti.static(averaged):
            pressure = mean_pressure(points, labels, materials, means, offset, first, sx, sy, p)
            push = step[0] * ti.cast(pressure, ti.f64)
            tx[0] += push
            ty[1] += push
            tz[2] += push
        ax = ti.cast(points[r + words.AFFINE], ti.f64) - (1 - GRADIENT_SHARE) * tx
        ay = ti.cast(points[r + words.AFFINE + 1], ti.f64) - (1 - GRADIENT_SHARE) * ty
        az = ti.cast(points[r + words.AFFINE + 2], ti.f64) - (1 - GRADIENT_SHARE) * tz
        start = ti.cast(points[r + words.VELOCITY], ti.f64) + numbers4(batch, words.MASS_AXIS)
        start -= offset[0] * ax + offset[1] * ay + offset[2] * az
        tx *= -GRADIENT_SHARE / 4
        ty *= -GRADIENT_SHARE / 4
        tz *= -GRADIENT_SHARE / 4
        # The sum over the three axes of what grows along them, w (v + C r) + w' t, taken apart by axis.
        for i in ti.static(range(3)):
            wi = m * w[i, 0]
            along_x = wi * (start + i * ax) + (m * d[i, 0]) * tx
            for j in ti.static(range(3)):
                along_xy = w[j, 1] * along_x + wi * ((j * w[j, 1]) * ay + d[j, 1] * ty)
                wij = wi * w[j, 1]
                line = (first + i * sx + j * sy) & words.NODE_BITS
                for k in ti.static(range(3)):
                    given = w[k, 2] * along_xy + wij * ((k * w[k, 2]) * az + d[k, 2] * tz)
                    if ti.static(atomic):
                        grid[line + k] += given
                    else:
                        grid[line + k] = grid[line + k] + given

        if ti.static(flowing):
            scatter_carried(points, grid, control, offset, w, control[words.CARRIED_AT] + first, sx, sy, p)

    @ti.func
    def gather(x: ti.template(), grid: ti.template(), control: ti.template(), shift, p):
        """Velocity, the columns of its affine part C and those of the velocity gradient L at a point.

        Of the grid after all that acts with a `shift` of 0, of what the points brought with one of CARRIED_AT.
        """
        offset, first, sx, sy = stencil(x, control, p)
        w = weights(offset)
        d = slopes(offset)
        # Each of the seven is a sum over the nodes, with numbers of its own along one axis, weights along the others.
        # No sum has more than a dozen operations one after the other: deeper ones the compiler no longer sees as four
        # lanes that do the same.
        c = 4.0 * ti.Matrix.rows([-offset * row_of(w, 0), (1.0 - offset) * row_of(w, 1), (2.0 - offset) * row_of(w, 2)])
        e = (1 - GRADIENT_SHARE) * c + GRADIENT_SHARE * d
        V, CX, CY, CZ = _node4(0), _node4(0), _node4(0), _node4(0)
        LX, LY, LZ = _node4(0), _node4(0), _node4(0)
        for i in ti.static(range(3)):
            s, sc, se = _node4(0), _node4(0), _node4(0)
            cs, es = _node4(0), _node4(0)
            for j in ti.static(range(3)):
                line = (shift + first + i * sx + j * sy) & words.NODE_BITS
                g0 = grid[line]
                g1 = grid[line + 1]
                g2 = grid[line + 2]
                along = w[0, 2] * g0 + w[1, 2] * g1 + w[2, 2] * g2
                along_c = c[0, 2] * g0 + c[1, 2] * g1 + c[2, 2] * g2
                along_e = e[0, 2] * g0 + e[1, 2] * g1 + e[2, 2] * g2
                if ti.static(j == 0):
                    s, cs, es = w[j, 1] * along, c[j, 1] * along, e[j, 1] * along
                    sc, se = w[j, 1] * along_c, w[j, 1] * along_e
                else:
                    s += w[j, 1] * along
                    cs += c[j, 1] * along
                    es += e[j, 1] * along
                    sc += w[j, 1] * along_c
                    se += w[j, 1] * along_e
            if ti.static(i == 0):
                V, CX, LX = w[i, 0] * s, c[i, 0] * s, e[i, 0] * s
                CY, LY, CZ, LZ = w[i, 0] * cs, w[i, 0] * es, w[i, 0] * sc, w[i, 0] * se
            else:
                V += w[i, 0] * s
                CX += c[i, 0] * s
                LX += e[i, 0] * s
                CY += w[i, 0] * cs
                LY += w[i, 0] * es
                CZ += w[i, 0] * sc
                LZ += w[i, 0] * se
        return V, CX, CY, CZ, LX, LY, LZ

    return SimpleNamespace(scatter=scatter, scatter_dilation=scatter_dilation, gather=gather)
