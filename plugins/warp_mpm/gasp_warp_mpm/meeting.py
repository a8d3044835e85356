# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""Nodes that several bodies share: how far apart they are there, and what contact makes of their velocities.

A place is a block of nodes that is one of several bodies' (`gasp_mpm_host.bodies`); one thread does all of it. What is
computed is what gasp-reference-mpm's `separation` and `bodies` compute, where the words are explained. For each pair of
bodies at a place and each of its nodes there is a row of numbers in `s.scratch`.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import BETTER_GAP, FOREMOST, FULL_PRESENCE, HELD_TOGETHER, TURN_BELOW, TURNS
from gasp_warp_mpm.contact import acted, confined
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import CLAMPED, FIRST_STEP, Acting, tables_of
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["SCRATCH_WIDTH", "make_meeting"]

_NODES = 64
_PRESENCE = FULL_PRESENCE
# A row of the scratch.
_TRIED = 0
"""Three unit normals; before that, the outward normals of the first body and of the second in places 1 and 2."""
_REACH_OF_FIRST = 9
_REACH_OF_SECOND = 12
"""How far either body reaches along each of the three; later along the one that is being turned."""
_BEST = 15
_GAP = 18
_TURNED = 19
_FOREMOST_OF_FIRST = 22
_FOREMOST_OF_SECOND = 26
"""Sum of the shares, and of the shares times the places."""
_STATE = 30
SCRATCH_WIDTH = 32

# The state of a node for a pair.
_APART = 0
"""Not a node of both."""
_SHARED = 1
_TURNING = 2


@cache
def make_meeting(double: bool, averaged: bool, *, atomic: bool, native: bool) -> SimpleNamespace:
    """The function meet; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, vec4 = types.vec3, types.vec4
    Tables = tables_of(real)
    transfers = make_transfers(double, averaged, atomic=atomic, native=native)
    row9, material_row, weights, slopes = transfers.row9, transfers.material_row, transfers.weights, transfers.slopes
    zero, one, half = real(0.0), real(1.0), real(0.5)
    none, wide_zero, wide_one = real(-1e30), wp.float64(0.0), wp.float64(1.0)
    half_cell = wp.float64(0.5)
    foremost, better, turn_below = real(FOREMOST), real(BETTER_GAP), real(TURN_BELOW)
    held_together = real(HELD_TOGETHER)
    shortest_lever = real(0.25)
    least_mass = real(0.0 if double else at.LEAST_MASS)
    tiny = real(1e-300 if double else 1e-30)
    least_presence = real(_PRESENCE)
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
    def true_place(s: Tables, corner: wp.vec3i, n: int):
        """Where a node is in the scene, in cells: its body's stand is taken away."""
        column = 3 * (corner[0] // 4)
        return wp.vec3d(
            s.lower
            + corner
            + wp.vec3i(n // 16, n // 4 % 4, n % 4)
            - wp.vec3i(s.stands[column], s.stands[column + 1], s.stands[column + 2])
        )

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
        F = row9(s.points, o + at.DEFORMATION)
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
    def give_slopes(s: Tables, m: int, rows: int, slot: int):
        """Against the gradient of the volume of a member's body, at the nodes of a pair."""
        corner = corner_of(s, m)
        for e in range(s.near_begins[m], s.near_begins[m + 1]):
            p = s.near[e]
            offset, cell = offset_and_cell(s, p, corner)
            first, end = nodes_within(offset, cell)
            if first[0] < end[0] and first[1] < end[1] and first[2] < end[2]:
                w = weights(offset)
                d = slopes(offset)
                _square, volume = shape_of(s, p)
                for i in range(first[0], end[0]):
                    for j in range(first[1], end[1]):
                        for k in range(first[2], end[2]):
                            n = (cell[0] + i) * 16 + (cell[1] + j) * 4 + cell[2] + k
                            row = rows + n * SCRATCH_WIDTH
                            if s.scratch[row + _STATE] > zero:
                                g = vec3(
                                    d[i, 0] * w[j, 1] * w[k, 2],
                                    w[i, 0] * d[j, 1] * w[k, 2],
                                    w[i, 0] * w[j, 1] * d[k, 2],
                                )
                                keep3(s, row + slot, kept3(s, row + slot) + volume * g)

    @wp.func
    def reach_along_three(s: Tables, m: int, rows: int, slot: int, sign: real):
        """How far a member's body reaches along the three tried normals (against them where `sign` is -1)."""
        corner = corner_of(s, m)
        for e in range(s.near_begins[m], s.near_begins[m + 1]):
            p = s.near[e]
            offset, cell = offset_and_cell(s, p, corner)
            first, end = nodes_within(offset, cell)
            if first[0] < end[0] and first[1] < end[1] and first[2] < end[2]:
                square, _volume = shape_of(s, p)
                for i in range(first[0], end[0]):
                    for j in range(first[1], end[1]):
                        for k in range(first[2], end[2]):
                            n = (cell[0] + i) * 16 + (cell[1] + j) * 4 + cell[2] + k
                            row = rows + n * SCRATCH_WIDTH
                            if s.scratch[row + _STATE] > zero:
                                place = sign * (offset - vec3(real(i), real(j), real(k)))
                                N = row9(s.scratch, row + _TRIED)
                                depth = N @ place
                                widths = wp.cw_mul(N @ square, N) @ vec3(one, one, one)
                                for t in range(3):
                                    reach = depth[t] + wp.sqrt(wp.max(widths[t], zero))
                                    s.scratch[row + slot + t] = wp.max(s.scratch[row + slot + t], reach)

    @wp.func
    def reach_along_one(s: Tables, m: int, rows: int, slot: int, ahead: int, sign: real):
        """How far a member's body reaches along the normal that is being turned, and where it is foremost."""
        corner = corner_of(s, m)
        for e in range(s.near_begins[m], s.near_begins[m + 1]):
            p = s.near[e]
            offset, cell = offset_and_cell(s, p, corner)
            first, end = nodes_within(offset, cell)
            if first[0] < end[0] and first[1] < end[1] and first[2] < end[2]:
                square, _volume = shape_of(s, p)
                for i in range(first[0], end[0]):
                    for j in range(first[1], end[1]):
                        for k in range(first[2], end[2]):
                            n = (cell[0] + i) * 16 + (cell[1] + j) * 4 + cell[2] + k
                            row = rows + n * SCRATCH_WIDTH
                            if s.scratch[row + _STATE] > one:
                                place = offset - vec3(real(i), real(j), real(k))
                                normal = kept3(s, row + _TURNED)
                                depth = sign * wp.dot(normal, place)
                                reach = depth + wp.sqrt(wp.max(wp.dot(normal, square @ normal), zero))
                                s.scratch[row + slot] = wp.max(s.scratch[row + slot], reach)
                                share = wp.exp(foremost * depth)
                                s.scratch[row + ahead] = s.scratch[row + ahead] + share
                                keep3(s, row + ahead + 1, kept3(s, row + ahead + 1) + share * place)

    @wp.func
    def separate(s: Tables, pair: int):
        """Normals and gaps of a pair at the nodes it shares; returns whether it shares any."""
        first = s.pairs[3 * pair]
        second = s.pairs[3 * pair + 1]
        rows = pair * _NODES * SCRATCH_WIDTH
        corner1 = corner_of(s, first)
        corner2 = corner_of(s, second)
        shared = int(0)
        for n in range(_NODES):
            row = rows + n * SCRATCH_WIDTH
            for c in range(SCRATCH_WIDTH):
                s.scratch[row + c] = zero
            if s.grid[node_row(s, corner1, n)][3] >= zero and s.grid[node_row(s, corner2, n)][3] >= zero:
                s.scratch[row + _STATE] = real(_SHARED)
                shared += 1
        if shared > 0:
            give_slopes(s, first, rows, _TRIED + 3)
            give_slopes(s, second, rows, _TRIED + 6)
            for n in range(_NODES):
                row = rows + n * SCRATCH_WIDTH
                if s.scratch[row + _STATE] > zero:
                    out_of_first = unit(kept3(s, row + _TRIED + 3))
                    into_second = -unit(kept3(s, row + _TRIED + 6))
                    keep3(s, row + _TRIED, unit(out_of_first + into_second))
                    keep3(s, row + _TRIED + 3, out_of_first)
                    keep3(s, row + _TRIED + 6, into_second)
                    for t in range(3):
                        s.scratch[row + _REACH_OF_FIRST + t] = none
                        s.scratch[row + _REACH_OF_SECOND + t] = none
            reach_along_three(s, first, rows, _REACH_OF_FIRST, one)
            reach_along_three(s, second, rows, _REACH_OF_SECOND, -one)
            turning = int(0)
            for n in range(_NODES):
                row = rows + n * SCRATCH_WIDTH
                if s.scratch[row + _STATE] > zero:
                    gap = none
                    normal = vec3()
                    for t in range(3):
                        tried = kept3(s, row + _TRIED + 3 * t)
                        other = none
                        if wp.length(tried) > half:
                            other = -s.scratch[row + _REACH_OF_SECOND + t] - s.scratch[row + _REACH_OF_FIRST + t]
                        if other > gap + better:
                            gap = other
                            normal = tried
                    keep3(s, row + _BEST, normal)
                    keep3(s, row + _TURNED, normal)
                    s.scratch[row + _GAP] = gap
                    if gap == none:
                        s.scratch[row + _STATE] = real(_APART)
                    elif gap < -turn_below:
                        s.scratch[row + _STATE] = real(_TURNING)
                        turning += 1
            if turning > 0:
                for turn in range(TURNS + 1):
                    for n in range(_NODES):
                        row = rows + n * SCRATCH_WIDTH
                        s.scratch[row + _REACH_OF_FIRST] = none
                        s.scratch[row + _REACH_OF_SECOND] = none
                        for c in range(8):
                            s.scratch[row + _FOREMOST_OF_FIRST + c] = zero
                    reach_along_one(s, first, rows, _REACH_OF_FIRST, _FOREMOST_OF_FIRST, one)
                    reach_along_one(s, second, rows, _REACH_OF_SECOND, _FOREMOST_OF_SECOND, -one)
                    for n in range(_NODES):
                        row = rows + n * SCRATCH_WIDTH
                        if s.scratch[row + _STATE] > one:
                            turn_node(s, row, turn)
        return shared

    @wp.func
    def turn_node(s: Tables, row: int, turn: int):
        """Take a turned normal if its gap is larger, and turn it on, to where what is foremost would not overlap."""
        normal = kept3(s, row + _TURNED)
        gap = -s.scratch[row + _REACH_OF_SECOND] - s.scratch[row + _REACH_OF_FIRST]
        if turn > 0 and gap > s.scratch[row + _GAP] + better:
            keep3(s, row + _BEST, normal)
            s.scratch[row + _GAP] = gap
        last = kept3(s, row + _FOREMOST_OF_FIRST + 1) / s.scratch[row + _FOREMOST_OF_FIRST]
        front = kept3(s, row + _FOREMOST_OF_SECOND + 1) / s.scratch[row + _FOREMOST_OF_SECOND]
        lever = front - last
        lever = lever - wp.dot(lever, normal) * normal
        angle = real(0.0)
        if gap < -turn_below:
            angle = -gap / wp.max(wp.dot(lever, lever), shortest_lever)
        keep3(s, row + _TURNED, unit(normal + angle * lever))

    @wp.func
    def exchange(s: Tables, pair: int):
        """Opposite impulses on the two bodies of a pair, at every node it shares."""
        first = corner_of(s, s.pairs[3 * pair])
        second = corner_of(s, s.pairs[3 * pair + 1])
        condition = s.pairs[3 * pair + 2]
        friction = s.friction[pair]
        for n in range(_NODES):
            row = (pair * _NODES + n) * SCRATCH_WIDTH
            if s.scratch[row + _STATE] > zero:
                row1 = node_row(s, first, n)
                row2 = node_row(s, second, n)
                g1 = s.grid[row1]
                g2 = s.grid[row2]
                share1 = wp.float64(g1[3])
                share2 = wp.float64(g2[3])
                gap = wp.float64(s.scratch[row + _GAP])
                if share1 >= wide_zero and share2 >= wide_zero and share1 + share2 > wide_zero:
                    v1 = wp.vec3d(wp.float64(g1[0]), wp.float64(g1[1]), wp.float64(g1[2]))
                    v2 = wp.vec3d(wp.float64(g2[0]), wp.float64(g2[1]), wp.float64(g2[2]))
                    best = kept3(s, row + _BEST)
                    normal = wp.vec3d(wp.float64(best[0]), wp.float64(best[1]), wp.float64(best[2]))
                    closing = v1 - v2
                    approach = wp.dot(closing, normal)
                    across = closing - approach * normal
                    taken = wp.vec3d()
                    if condition == at.SEPARATE:
                        stopped = wp.max(approach - wp.max(gap, wide_zero) / s.step, wide_zero)
                        speed = wp.length(across)
                        braked = wide_one
                        if friction * stopped < speed:
                            braked = friction * stopped / speed
                        taken = stopped * normal + braked * across
                        if stopped == wide_zero:
                            taken = wp.vec3d()
                    elif s.scratch[row + _GAP] <= held_together:
                        taken = closing * wide_one
                        if condition == at.SLIP:
                            taken = approach * normal
                    impulse = taken / (share1 + share2)
                    v1 = v1 - share1 * impulse
                    v2 = v2 + share2 * impulse
                    s.grid[row1] = vec4(real(v1[0]), real(v1[1]), real(v1[2]), g1[3])
                    s.grid[row2] = vec4(real(v2[0]), real(v2[1]), real(v2[2]), g2[3])

    @wp.func
    def close_gaps(s: Tables, pair: int):
        """By as much as the bodies of a pair go towards each other."""
        first = corner_of(s, s.pairs[3 * pair])
        second = corner_of(s, s.pairs[3 * pair + 1])
        for n in range(_NODES):
            row = (pair * _NODES + n) * SCRATCH_WIDTH
            g1 = s.grid[node_row(s, first, n)]
            g2 = s.grid[node_row(s, second, n)]
            if s.scratch[row + _STATE] > zero and g1[3] >= zero and g2[3] >= zero:
                closing = vec3(g1[0] - g2[0], g1[1] - g2[1], g1[2] - g2[2])
                approach = wp.dot(closing, kept3(s, row + _BEST))
                s.scratch[row + _GAP] = s.scratch[row + _GAP] - real(s.step) * approach

    @wp.func
    def begin_member(s: Tables, acting: Acting, drive_set: int, m: int):
        """Momentum to velocity, and what acts on bodies before they meet; in place of the mass its inverse, or -1."""
        corner = corner_of(s, m)
        for n in range(_NODES):
            row = node_row(s, corner, n)
            g = s.grid[row]
            v = vec4(zero, zero, zero, -one)
            if g[3] > least_mass:
                velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2])) / wp.float64(g[3])
                u, held = acted(acting, velocity, true_place(s, corner, n), drive_set)
                share = one / g[3]
                if held == 1:
                    share = zero
                v = vec4(real(u[0]), real(u[1]), real(u[2]), share)
            s.grid[row] = v
            if s.tracer_count > 0:
                s.carrier[row] = vec4(zero, zero, zero, wp.min(g[3] / least_presence, one))

    @wp.func
    def end_member(s: Tables, acting: Acting, m: int):
        """What the walls leave of the velocities."""
        corner = corner_of(s, m)
        for n in range(_NODES):
            row = node_row(s, corner, n)
            g = s.grid[row]
            v = vec4()
            if g[3] >= zero:
                velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2]))
                u, held = confined(acting, velocity, true_place(s, corner, n))
                v = vec4(real(u[0]), real(u[1]), real(u[2]), zero)
                if held == 1:
                    s.report[CLAMPED] = 1
            s.grid[row] = v
            if s.tracer_count > 0:
                presence = s.carrier[row][3]
                s.carrier[row] = vec4(presence * v[0], presence * v[1], presence * v[2], presence)

    @wp.func
    def meet(s: Tables, acting: Acting, drive_set: int, place: int):
        """From momenta to velocities, at the nodes of one place of several bodies."""
        for m in range(s.places[place], s.places[place + 1]):
            begin_member(s, acting, drive_set, m)
        begin = s.pair_begins[place]
        end = s.pair_begins[place + 1]
        # Between two looks a gap changes as the bodies move.
        look = drive_set == s.report[FIRST_STEP] or drive_set % acting.looks == 0
        for pair in range(begin, end):
            if look:
                separate(s, pair)
        for pair in range(begin, end):
            exchange(s, pair)
        for back in range(end - begin - 1):
            exchange(s, end - 2 - back)
        for pair in range(begin, end):
            close_gaps(s, pair)
        for m in range(s.places[place], s.places[place + 1]):
            end_member(s, acting, m)

    return SimpleNamespace(meet=meet)
