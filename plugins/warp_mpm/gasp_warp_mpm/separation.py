# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""How far apart two bodies are at the nodes of a place that both of them share, and along which normals.

What is computed is what gasp-reference-mpm's `separation` computes, where the words are explained. For each pair of
bodies at a place and each of its nodes there is a row of numbers in `s.scratch`.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import BETTER_GAP, FOREMOST, TURN_BELOW, TURNS
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import tables_of
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["BEST", "GAP", "NODES", "SCRATCH_WIDTH", "STATE", "make_separation"]

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

# The state of a node for a pair.
_APART = 0
"""Not a node of both."""
_SHARED = 1
_TURNING = 2


@cache
def make_separation(double: bool, averaged: bool, *, native: bool) -> SimpleNamespace:
    """The function separate, and corner_of and node_row of members; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, mat33 = types.vec3, types.mat33
    Tables = tables_of(real)
    transfers = make_transfers(double, averaged, native=native)
    row9, material_row, weights, slopes = transfers.row9, transfers.material_row, transfers.weights, transfers.slopes
    zero, one, half = real(0.0), real(1.0), real(0.5)
    none, half_cell = real(-1e30), wp.float64(0.5)
    foremost, better, turn_below = real(FOREMOST), real(BETTER_GAP), real(TURN_BELOW)
    shortest_lever = real(0.25)
    tiny = real(1e-300 if double else 1e-30)
    is_fluid = at.KINDS["fluid"]

    @wp.func
    def corner_of(s: Tables, m: int):
        """Place of a member's first node, from the grid's own first node."""
        block = s.members[m]
        by = s.shape[1] // 4
        bz = s.shape[2] // 4
        return wp.vec3i(block // (by * bz) * 4, block // bz % by * 4, block % bz * 4)

    @wp.func
    def node_row(s: Tables, corner: wp.vec3i, n: int):
        return ((corner[0] + n // 16) * s.shape[1] + corner[1] + n // 4 % 4) * s.shape[2] + corner[2] + n % 4

    @wp.func
    def unit(v: vec3):
        length = wp.length(v)
        u = vec3()
        if length > tiny:
            u = v / length
        return u

    @wp.func
    def kept3(s: Tables, begin: int):
        return vec3(s.scratch[begin], s.scratch[begin + 1], s.scratch[begin + 2])

    @wp.func
    def keep3(s: Tables, begin: int, v: vec3):
        for d in range(3):
            s.scratch[begin + d] = v[d]

    @wp.func
    def shape_of(s: Tables, p: int):
        """(s/2)^2 F F^T of what a point stands for, and its volume, to a common factor."""
        o = p * at.POINT_WIDTH
        side = s.points[o + at.HALF_SIDE]
        F = row9(s.points, o + at.DISPLACEMENT_GRADIENT) + wp.identity(n=3, dtype=real)
        J = wp.determinant(F)
        square = (side * side) * (F @ wp.transpose(F))
        if int(s.materials[material_row(s, p) + at.KIND]) == is_fluid:
            J = one + s.points[o + at.HISTORY]
            stretch = wp.cbrt(J)
            square = (side * side * stretch * stretch) * wp.identity(n=3, dtype=real)
        return square, side * side * side * J

    @wp.func
    def offset_and_cell(s: Tables, p: int, corner: wp.vec3i):
        """A point's offset in its base cell, and that cell, counted from a member's first node."""
        place = s.x[p]
        offset = vec3()
        cell = wp.vec3i()
        for d in range(3):
            base = wp.floor(place[d] - half_cell)
            offset[d] = real(place[d] - base)
            cell[d] = int(base) - s.lower[d] - corner[d]
        return offset, cell

    @wp.func
    def nodes_within(offset: vec3, cell: wp.vec3i):
        """Of the three nodes along each axis, the first one that is within a block and has a weight, and the end."""
        first = wp.vec3i()
        end = wp.vec3i()
        for d in range(3):
            first[d] = wp.max(0, -cell[d])
            last = int(3)
            if offset[d] <= half:
                last = 2
            end[d] = wp.min(last, 4 - cell[d])
        return first, end

    @wp.func
    def add_slope(s: Tables, to: int, offset: vec3, volume: real, i: int, j: int, k: int):
        """Against the gradient of the volume of a point at a node."""
        w = weights(offset)
        d = slopes(offset)
        g = vec3(d[i, 0] * w[j, 1] * w[k, 2], w[i, 0] * d[j, 1] * w[k, 2], w[i, 0] * w[j, 1] * d[k, 2])
        keep3(s, to, kept3(s, to) + volume * g)

    @wp.func
    def reach_along_three(s: Tables, row: int, to: int, square: mat33, way: vec3):
        """How far a point reaches along the three tried normals (against them where `way` is turned round)."""
        N = row9(s.scratch, row + _TRIED)
        depth = N @ way
        widths = wp.cw_mul(N @ square, N) @ vec3(one, one, one)
        for t in range(3):
            s.scratch[to + t] = wp.max(s.scratch[to + t], depth[t] + wp.sqrt(wp.max(widths[t], zero)))

    @wp.func
    def reach_along_one(s: Tables, row: int, to: int, ahead: int, square: mat33, way: vec3, sign: real):
        """How far a point reaches along the normal that is being turned, and its share in what is foremost."""
        normal = kept3(s, row + _TURNED)
        depth = sign * wp.dot(normal, way)
        s.scratch[to] = wp.max(s.scratch[to], depth + wp.sqrt(wp.max(wp.dot(normal, square @ normal), zero)))
        share = wp.exp(foremost * depth)
        s.scratch[ahead] = s.scratch[ahead] + share
        keep3(s, ahead + 1, kept3(s, ahead + 1) + share * way)

    @wp.func
    def look_at(s: Tables, m: int, rows: int, side: int, look: int):
        """At a member's points: the first time at slopes, then along the tried normals, then along the turned one."""
        corner = corner_of(s, m)
        sign = one - real(2 * side)
        for e in range(s.near_begins[m], s.near_begins[m + 1]):
            p = s.near[e]
            offset, cell = offset_and_cell(s, p, corner)
            first, end = nodes_within(offset, cell)
            if first[0] < end[0] and first[1] < end[1] and first[2] < end[2]:
                square, volume = shape_of(s, p)
                for i in range(first[0], end[0]):
                    for j in range(first[1], end[1]):
                        for k in range(first[2], end[2]):
                            n = (cell[0] + i) * 16 + (cell[1] + j) * 4 + cell[2] + k
                            row = rows + n * SCRATCH_WIDTH
                            state = s.scratch[row + STATE]
                            way = offset - vec3(real(i), real(j), real(k))
                            if look == 0 and state > zero:
                                add_slope(s, row + _TRIED + 3 + 3 * side, offset, volume, i, j, k)
                            elif look == 1 and state > zero:
                                reach_along_three(s, row, row + _REACH + 3 * side, square, sign * way)
                            elif look > 1 and state > one:
                                to = row + _REACH + 3 * side
                                reach_along_one(s, row, to, row + _FOREMOST + 4 * side, square, way, sign)

    @wp.func
    def separate(s: Tables, pair: int):
        """Normals and gaps of a pair at the nodes it shares; returns whether it shares any."""
        first = s.pairs[3 * pair]
        second = s.pairs[3 * pair + 1]
        rows = pair * NODES * SCRATCH_WIDTH
        corner1 = corner_of(s, first)
        corner2 = corner_of(s, second)
        shared = int(0)
        for n in range(NODES):
            row = rows + n * SCRATCH_WIDTH
            for c in range(SCRATCH_WIDTH):
                s.scratch[row + c] = zero
            if s.grid[node_row(s, corner1, n)][3] >= zero and s.grid[node_row(s, corner2, n)][3] >= zero:
                s.scratch[row + STATE] = real(_SHARED)
                shared += 1
        if shared > 0:
            look_at(s, first, rows, 0, 0)
            look_at(s, second, rows, 1, 0)
            for n in range(NODES):
                row = rows + n * SCRATCH_WIDTH
                if s.scratch[row + STATE] > zero:
                    out_of_first = unit(kept3(s, row + _TRIED + 3))
                    into_second = -unit(kept3(s, row + _TRIED + 6))
                    keep3(s, row + _TRIED, unit(out_of_first + into_second))
                    keep3(s, row + _TRIED + 3, out_of_first)
                    keep3(s, row + _TRIED + 6, into_second)
                    for t in range(3):
                        s.scratch[row + _REACH + t] = none
                        s.scratch[row + _REACH + 3 + t] = none
            look_at(s, first, rows, 0, 1)
            look_at(s, second, rows, 1, 1)
            turning = int(0)
            for n in range(NODES):
                row = rows + n * SCRATCH_WIDTH
                if s.scratch[row + STATE] > zero:
                    gap = none
                    normal = vec3()
                    for t in range(3):
                        tried = kept3(s, row + _TRIED + 3 * t)
                        other = none
                        if wp.length(tried) > half:
                            other = -s.scratch[row + _REACH + 3 + t] - s.scratch[row + _REACH + t]
                        if other > gap + better:
                            gap = other
                            normal = tried
                    keep3(s, row + BEST, normal)
                    keep3(s, row + _TURNED, normal)
                    s.scratch[row + GAP] = gap
                    if gap == none:
                        s.scratch[row + STATE] = real(_APART)
                    elif gap < -turn_below:
                        s.scratch[row + STATE] = real(_TURNING)
                        turning += 1
            if turning > 0:
                for turn in range(TURNS + 1):
                    for n in range(NODES):
                        row = rows + n * SCRATCH_WIDTH
                        s.scratch[row + _REACH] = none
                        s.scratch[row + _REACH + 3] = none
                        for c in range(8):
                            s.scratch[row + _FOREMOST + c] = zero
                    look_at(s, first, rows, 0, 2 + turn)
                    look_at(s, second, rows, 1, 2 + turn)
                    for n in range(NODES):
                        row = rows + n * SCRATCH_WIDTH
                        if s.scratch[row + STATE] > one:
                            turn_node(s, row, turn)
        return shared

    @wp.func
    def turn_node(s: Tables, row: int, turn: int):
        """Take a turned normal if its gap is larger, and turn it on, to where what is foremost would not overlap."""
        normal = kept3(s, row + _TURNED)
        gap = -s.scratch[row + _REACH + 3] - s.scratch[row + _REACH]
        if turn > 0 and gap > s.scratch[row + GAP] + better:
            keep3(s, row + BEST, normal)
            s.scratch[row + GAP] = gap
        last = kept3(s, row + _FOREMOST + 1) / s.scratch[row + _FOREMOST]
        front = kept3(s, row + _FOREMOST + 4 + 1) / s.scratch[row + _FOREMOST + 4]
        lever = front - last
        lever = lever - wp.dot(lever, normal) * normal
        angle = real(0.0)
        if gap < -turn_below:
            angle = -gap / wp.max(wp.dot(lever, lever), shortest_lever)
        keep3(s, row + _TURNED, unit(normal + angle * lever))

    return SimpleNamespace(separate=separate, corner_of=corner_of, node_row=node_row, kept3=kept3)
