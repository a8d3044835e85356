"""How far apart two bodies are at the nodes of a place that both of them share, and along which normals.

What is computed is what gasp-reference-mpm's `separation` computes, where the words are explained. For each pair of
bodies at a place and each of its nodes there is a row of float64 numbers in the scratch.

Every function is compiled where it is called, so what is done for both bodies of a pair is in a loop over the two.
"""

from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import BETTER_GAP, FOREMOST, TURN_BELOW, TURNS
from gasp_taichi_mpm import words
from gasp_taichi_mpm.nodes import block_corner
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.transfers import columns, slopes, weights

__all__ = ["BEST", "GAP", "NODES", "SCRATCH_WIDTH", "STATE", "corner_of", "kept", "row_of", "separate"]

NODES = 64
# A row of the scratch.
_TRIED = 0
"""Three unit normals; before that, the outward normals of the first body and of the second in places 1 and 2."""
_REACH = 9
"""How far the first body reaches along each of the three, then the second; later along the one that is turned."""
BEST = 15
GAP = 18
_TURNED = 19
_FOREMOST = 22
"""Sum of the shares, and of the shares times the places, of the first body, then of the second."""
STATE = 30
SCRATCH_WIDTH = 32

# The state of a node for a pair: not a node of both is 0.
_SHARED = 1.0
_TURNING = 2.0

_NONE = -1e30
_TINY = 1e-300


@ti.func
def corner_of(met: ti.template(), control: ti.template(), m):
    """Place of a member's first node, from the grid's own first node."""
    return block_corner(control, met[control[words.MEMBERS_AT] + m])


@ti.func
def row_of(control: ti.template(), corner, n):
    """Linear index of a block's node."""
    line = (corner[0] + n // 16) * control[words.SHAPE + 1] + corner[1] + n // 4 % 4
    return line * control[words.SHAPE + 2] + corner[2] + n % 4


@ti.func
def kept(scratch: ti.template(), begin):
    """Three numbers of the scratch."""
    return ti.Vector([scratch[begin], scratch[begin + 1], scratch[begin + 2]])


@ti.func
def _keep(scratch: ti.template(), begin, v):
    for d in ti.static(range(3)):
        scratch[begin + d] = v[d]


@ti.func
def _unit(v):
    length = v.norm()
    u = v * 0.0
    if length > _TINY:
        u = v / length
    return u


@ti.func
def _tried(scratch: ti.template(), row):
    """The three tried normals, a row each."""
    return ti.Matrix.rows([kept(scratch, row + _TRIED + 3 * t) for t in range(3)])


@ti.func
def _shape_of(points: ti.template(), labels: ti.template(), materials: ti.template(), p):
    """(s/2)^2 F F^T of what a point stands for, and its volume, to a common factor."""
    r = p * words.POINT_ROWS
    side = ti.cast(points[r + words.HALF_SIDE][3], ti.f64)
    F = ti.cast(columns(points, r + words.DISPLACEMENT_GRADIENT), ti.f64) + ti.Matrix.identity(ti.f64, 3)
    J = F.determinant()
    square = (side * side) * (F @ F.transpose())
    row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
    if ti.cast(materials[row + at.KIND], ti.i32) == ti.static(at.KINDS["fluid"]):
        J = 1.0 + ti.cast(points[r + words.HISTORY][3], ti.f64)
        square = (side * side * J ** (2.0 / 3.0)) * ti.Matrix.identity(ti.f64, 3)
    return square, side * side * side * J


@ti.func
def _offset_and_cell(x: ti.template(), control: ti.template(), p, corner):
    """A point's offset in its base cell, and that cell, counted from a member's first node."""
    base = ti.floor(x[p] - 0.5)
    low = ti.Vector([control[words.LOWER + d] for d in range(3)])
    return x[p] - base, ti.cast(base, ti.i32) - low - corner


@ti.func
def _nodes_within(offset, cell):
    """Of the three nodes along each axis, the first one that is within a block and has a weight, and the end."""
    first, end = cell * 0, cell * 0
    for d in ti.static(range(3)):
        first[d] = ti.max(0, -cell[d])
        end[d] = ti.min(ti.select(offset[d] <= 0.5, 2, 3), 4 - cell[d])
    return first, end


@ti.func
def _turn_node(scratch: ti.template(), row, turn):
    """Take a turned normal if its gap is larger, and turn it on, to where what is foremost would not overlap."""
    normal = kept(scratch, row + _TURNED)
    gap = -scratch[row + _REACH + 3] - scratch[row + _REACH]
    if turn > 0 and gap > scratch[row + GAP] + BETTER_GAP:
        _keep(scratch, row + BEST, normal)
        scratch[row + GAP] = gap
    last = kept(scratch, row + _FOREMOST + 1) / scratch[row + _FOREMOST]
    front = kept(scratch, row + _FOREMOST + 5) / scratch[row + _FOREMOST + 4]
    lever = front - last
    lever = lever - lever.dot(normal) * normal
    angle = ti.f64(0.0)
    if gap < -TURN_BELOW:
        angle = -gap / ti.max(lever.norm_sqr(), 0.25)
    _keep(scratch, row + _TURNED, _unit(normal + angle * lever))


@ti.func
def _choose(scratch: ti.template(), row):
    """Of the three tried normals the one along which the gap is largest; whether it is worth turning."""
    gap = ti.f64(_NONE)
    normal = kept(scratch, row + _TRIED) * 0.0
    for t in range(3):
        tried = kept(scratch, row + _TRIED + 3 * t)
        other = ti.f64(_NONE)
        if tried.norm_sqr() > 0.5:
            other = -scratch[row + _REACH + 3 + t] - scratch[row + _REACH + t]
        if other > gap + BETTER_GAP:
            gap = other
            normal = tried
    _keep(scratch, row + BEST, normal)
    _keep(scratch, row + _TURNED, normal)
    scratch[row + GAP] = gap
    state = ti.f64(_SHARED)
    if gap == _NONE:
        state = 0.0
    elif gap < -TURN_BELOW:
        state = _TURNING
    scratch[row + STATE] = state
    return state == _TURNING


@ti.func
def separate(
    x: ti.template(),
    points: ti.template(),
    labels: ti.template(),
    grid: ti.template(),
    materials: ti.template(),
    control: ti.template(),
    met: ti.template(),
    scratch: ti.template(),
    pair,
):
    """Normals and gaps of a pair at the nodes it shares."""
    entry = control[words.PAIRS_AT] + 3 * pair
    rows = control[words.SCRATCH_AT] + pair * NODES * SCRATCH_WIDTH
    corner1, corner2 = corner_of(met, control, met[entry]), corner_of(met, control, met[entry + 1])
    shared = 0
    for n in range(NODES):
        row = rows + n * SCRATCH_WIDTH
        for c in range(SCRATCH_WIDTH):
            scratch[row + c] = 0.0
        if grid[row_of(control, corner1, n)][3] >= 0 and grid[row_of(control, corner2, n)][3] >= 0:
            scratch[row + STATE] = _SHARED
            shared += 1
    # The slopes first, then how far the bodies reach along three normals, then along the one that is turned.
    looks = 0
    if shared > 0:
        looks = 2
    look = 0
    while look < looks:
        for side in range(2):
            m = met[entry + side]
            sign = ti.f64(1.0 - 2.0 * side)
            corner = corner_of(met, control, m)
            begin = met[control[words.NEAR_BEGINS_AT] + m]
            end = met[control[words.NEAR_BEGINS_AT] + m + 1]
            for e in range(begin, end):
                p = met[control[words.NEAR_AT] + e]
                offset, cell = _offset_and_cell(x, control, p, corner)
                low, high = _nodes_within(offset, cell)
                if low[0] < high[0] and low[1] < high[1] and low[2] < high[2]:
                    square, volume = _shape_of(points, labels, materials, p)
                    w, d = weights(offset), slopes(offset)
                    for i in range(low[0], high[0]):
                        for j in range(low[1], high[1]):
                            for k in range(low[2], high[2]):
                                n = (cell[0] + i) * 16 + (cell[1] + j) * 4 + cell[2] + k
                                row = rows + n * SCRATCH_WIDTH
                                state = scratch[row + STATE]
                                way = offset - ti.Vector([i, j, k])
                                if look == 0:
                                    if state > 0:
                                        wx, wy, wz = _entry(w, i, 0), _entry(w, j, 1), _entry(w, k, 2)
                                        dx, dy, dz = _entry(d, i, 0), _entry(d, j, 1), _entry(d, k, 2)
                                        to = row + _TRIED + 3 + 3 * side
                                        scratch[to] += volume * (dx * wy * wz)
                                        scratch[to + 1] += volume * (wx * dy * wz)
                                        scratch[to + 2] += volume * (wx * wy * dz)
                                elif look == 1:
                                    if state > 0:
                                        N = _tried(scratch, row)
                                        depths, spread = N @ way, N @ square
                                        for t in ti.static(range(3)):
                                            width = ti.f64(0.0)
                                            for c in ti.static(range(3)):
                                                width += spread[t, c] * N[t, c]
                                            reach = sign * depths[t] + ti.sqrt(ti.max(width, 0.0))
                                            to = row + _REACH + 3 * side + t
                                            scratch[to] = ti.max(scratch[to], reach)
                                elif state == _TURNING:
                                    normal = kept(scratch, row + _TURNED)
                                    depth = sign * normal.dot(way)
                                    reach = depth + ti.sqrt(ti.max(normal.dot(square @ normal), 0.0))
                                    to = row + _REACH + 3 * side
                                    scratch[to] = ti.max(scratch[to], reach)
                                    share = ti.exp(FOREMOST * depth)
                                    to = row + _FOREMOST + 4 * side
                                    scratch[to] += share
                                    for c in ti.static(range(3)):
                                        scratch[to + 1 + c] += share * way[c]
        turning = 0
        for n in range(NODES):
            row = rows + n * SCRATCH_WIDTH
            if scratch[row + STATE] > 0:
                if look == 0:
                    out_of_first = _unit(kept(scratch, row + _TRIED + 3))
                    into_second = -_unit(kept(scratch, row + _TRIED + 6))
                    _keep(scratch, row + _TRIED, _unit(out_of_first + into_second))
                    _keep(scratch, row + _TRIED + 3, out_of_first)
                    _keep(scratch, row + _TRIED + 6, into_second)
                elif look == 1:
                    if _choose(scratch, row):
                        turning += 1
                elif scratch[row + STATE] == _TURNING:
                    _turn_node(scratch, row, look - 2)
                for t in range(6):
                    scratch[row + _REACH + t] = _NONE
                for t in range(8):
                    scratch[row + _FOREMOST + t] = 0.0
        if turning > 0:
            looks = 3 + TURNS
        look += 1


@ti.func
def _entry(M, row, column: ti.template()):
    """An entry of a matrix (3, 3) in a row that is known when it runs."""
    return ti.select(row == 0, M[0, column], ti.select(row == 1, M[1, column], M[2, column]))
