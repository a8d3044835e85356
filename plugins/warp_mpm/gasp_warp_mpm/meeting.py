"""Nodes that several bodies share: what contact makes of their velocities there.

A place is a block of nodes that is one of several bodies' (`gasp_mpm_host.bodies`); one thread does all of it. What is
computed is what gasp-reference-mpm's `bodies` computes, where the words are explained.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import FULL_PRESENCE, HELD_TOGETHER
from gasp_warp_mpm.blocks import make_blocks
from gasp_warp_mpm.contact import acted, confined
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.separation import BEST, GAP, NODES, SCRATCH_WIDTH, STATE, make_separation
from gasp_warp_mpm.tables import CLAMPED, FIRST_STEP, Acting, stand_of, tables_of

__all__ = ["make_meeting"]


@cache
def make_meeting(double: bool, averaged: bool, flowing: bool, *, native: bool) -> SimpleNamespace:
    """The function meet; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, vec4 = types.vec3, types.vec4
    Tables = tables_of(real)
    found = make_separation(double, averaged, native=native)
    separate, corner_of, node_row, kept3 = found.separate, found.corner_of, found.node_row, found.kept3
    settle_carried = make_blocks(double, averaged, flowing).settle_carried
    zero, one = real(0.0), real(1.0)
    wide_zero, wide_one = wp.float64(0.0), wp.float64(1.0)
    held_together, least_presence = real(HELD_TOGETHER), real(FULL_PRESENCE)
    least_mass = real(0.0 if double else at.LEAST_MASS)

    @wp.func
    def true_place(s: Tables, corner: wp.vec3i, n: int):
        """Where a node is in the scene, in cells: its body's stand is taken away."""
        node = wp.vec3i(n // 16, n // 4 % 4, n % 4)
        return wp.vec3d(s.lower + corner + node - stand_of(s.stands, corner[0]))

    @wp.func
    def exchange(s: Tables, pair: int):
        """Opposite impulses on the two bodies of a pair, at every node it shares."""
        first = corner_of(s, s.pairs[3 * pair])
        second = corner_of(s, s.pairs[3 * pair + 1])
        condition = s.pairs[3 * pair + 2]
        friction = s.friction[pair]
        for n in range(NODES):
            row = (pair * NODES + n) * SCRATCH_WIDTH
            if s.scratch[row + STATE] > zero:
                row1 = node_row(s, first, n)
                row2 = node_row(s, second, n)
                g1 = s.grid[row1]
                g2 = s.grid[row2]
                share1 = wp.float64(g1[3])
                share2 = wp.float64(g2[3])
                gap = wp.float64(s.scratch[row + GAP])
                if share1 >= wide_zero and share2 >= wide_zero and share1 + share2 > wide_zero:
                    v1 = wp.vec3d(wp.float64(g1[0]), wp.float64(g1[1]), wp.float64(g1[2]))
                    v2 = wp.vec3d(wp.float64(g2[0]), wp.float64(g2[1]), wp.float64(g2[2]))
                    best = kept3(s, row + BEST)
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
                    elif s.scratch[row + GAP] <= held_together:
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
        for n in range(NODES):
            row = (pair * NODES + n) * SCRATCH_WIDTH
            g1 = s.grid[node_row(s, first, n)]
            g2 = s.grid[node_row(s, second, n)]
            if s.scratch[row + STATE] > zero and g1[3] >= zero and g2[3] >= zero:
                closing = vec3(g1[0] - g2[0], g1[1] - g2[1], g1[2] - g2[2])
                approach = wp.dot(closing, kept3(s, row + BEST))
                s.scratch[row + GAP] = s.scratch[row + GAP] - real(s.step) * approach

    @wp.func
    def begin_member(s: Tables, acting: Acting, drive_set: int, m: int):
        """Momentum to velocity, and what acts on bodies before they meet; in place of the mass its inverse, or -1."""
        corner = corner_of(s, m)
        for n in range(NODES):
            row = node_row(s, corner, n)
            g = s.grid[row]
            v = vec4(zero, zero, zero, -one)
            if g[3] > least_mass:
                velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2])) / wp.float64(g[3])
                u, held = acted(acting, velocity, true_place(s, corner, n), s.member_bodies[m], drive_set)
                share = one / g[3]
                if held == 1:
                    share = zero
                v = vec4(real(u[0]), real(u[1]), real(u[2]), share)
            s.grid[row] = v
            if flowing:
                settle_carried(s, row)
            if s.carries == 1:
                s.carrier[row] = vec4(zero, zero, zero, wp.min(g[3] / least_presence, one))

    @wp.func
    def end_member(s: Tables, acting: Acting, wall_set: int, m: int):
        """What the walls leave of the velocities."""
        corner = corner_of(s, m)
        for n in range(NODES):
            row = node_row(s, corner, n)
            g = s.grid[row]
            v = vec4()
            if g[3] >= zero:
                velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2]))
                u, held = confined(acting, velocity, true_place(s, corner, n), wall_set)
                v = vec4(real(u[0]), real(u[1]), real(u[2]), zero)
                if held == 1:
                    s.report[CLAMPED] = 1
            s.grid[row] = v
            if s.carries == 1:
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
            end_member(s, acting, drive_set, m)

    return SimpleNamespace(meet=meet)
