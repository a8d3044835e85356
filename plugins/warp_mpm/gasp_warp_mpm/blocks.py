"""What happens at the nodes: emptied, divided by mass, acted upon. A thread of the CPU takes a block of 4^3 of them."""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import FULL_PRESENCE
from gasp_warp_mpm.contact import constrain
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import CLAMPED, Acting, stand_of, tables_of

__all__ = ["BLOCK_NODES", "make_blocks"]

BLOCK_NODES = 64


@cache
def make_blocks(double: bool, averaged: bool, flowing: bool) -> SimpleNamespace:
    """Functions clear_node, divide_node, update_node, and the like for blocks; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec2, vec4 = types.vec2, types.vec4
    Tables = tables_of(real)
    zero, one, full_presence = real(0.0), real(1.0), real(FULL_PRESENCE)
    least_mass = real(0.0 if double else at.LEAST_MASS)

    @wp.func
    def corner_of(s: Tables, block: int):
        """Place of a block's first node, from the grid's own first node."""
        by = s.shape[1] // 4
        bz = s.shape[2] // 4
        return wp.vec3i(block // (by * bz) * 4, block // bz % by * 4, block % bz * 4)

    @wp.func
    def block_corner(s: Tables, q: int):
        """Of an active block."""
        return corner_of(s, s.active[q])

    @wp.func
    def lone_corner(s: Tables, q: int):
        """Of one of the active blocks in which there is one body."""
        return corner_of(s, s.apart[q])

    @wp.func
    def node_of(corner: wp.vec3i, n: int):
        return wp.vec3i(corner[0] + n // 16, corner[1] + n // 4 % 4, corner[2] + n % 4)

    @wp.func
    def row_of(s: Tables, node: wp.vec3i):
        return (node[0] * s.shape[1] + node[1]) * s.shape[2] + node[2]

    @wp.func
    def clear_node(s: Tables, corner: wp.vec3i, n: int):
        row = row_of(s, node_of(corner, n))
        s.grid[row] = vec4()
        if flowing:
            s.carried[row] = vec4()
        if averaged:
            s.means[row] = vec2()

    @wp.func
    def settle_carried(s: Tables, row: int):
        """Momentum to velocity, of what the points brought; the mass stays."""
        g = s.carried[row]
        v = vec4(zero, zero, zero, g[3])
        if g[3] > least_mass:
            v = vec4(g[0] / g[3], g[1] / g[3], g[2] / g[3], g[3])
        s.carried[row] = v

    @wp.func
    def clear_block(s: Tables, q: int):
        corner = block_corner(s, q)
        for n in range(BLOCK_NODES):
            clear_node(s, corner, n)

    @wp.func
    def divide_node(s: Tables, corner: wp.vec3i, n: int):
        """Sums over volumes to means."""
        row = row_of(s, node_of(corner, n))
        total = s.means[row]
        mean = real(0.0)
        if total[1] > least_mass:
            mean = total[0] / total[1]
        s.means[row] = vec2(mean, total[1])

    @wp.func
    def divide_block(s: Tables, q: int):
        corner = block_corner(s, q)
        for n in range(BLOCK_NODES):
            divide_node(s, corner, n)

    @wp.func
    def settle_block(s: Tables, q: int):
        """Momentum to velocity and nothing else, at the nodes of one block."""
        corner = block_corner(s, q)
        for n in range(BLOCK_NODES):
            row = row_of(s, node_of(corner, n))
            g = s.grid[row]
            v = vec4()
            if g[3] > least_mass:
                v = vec4(g[0], g[1], g[2], zero) / g[3]
            s.grid[row] = v

    @wp.func
    def update_node(s: Tables, acting: Acting, drive_set: int, corner: wp.vec3i, body: int, n: int):
        """Momentum to velocity, then whatever acts on it; where several bodies meet `meeting` does this."""
        node = node_of(corner, n)
        row = row_of(s, node)
        g = s.grid[row]
        v = vec4()
        if g[3] > least_mass:
            velocity = wp.vec3d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(g[2])) / wp.float64(g[3])
            place = wp.vec3d(s.lower + node - stand_of(s.stands, corner[0]))
            u, held = constrain(acting, velocity, place, body, drive_set)
            v = vec4(real(u[0]), real(u[1]), real(u[2]), zero)
            if held == 1:
                s.report[CLAMPED] = 1
        s.grid[row] = v
        if flowing:
            settle_carried(s, row)
        if s.carries == 1:
            presence = wp.min(g[3] / full_presence, one)
            s.carrier[row] = vec4(presence * v[0], presence * v[1], presence * v[2], presence)

    @wp.func
    def update_block(s: Tables, acting: Acting, drive_set: int, q: int):
        corner = lone_corner(s, q)
        for n in range(BLOCK_NODES):
            update_node(s, acting, drive_set, corner, s.apart_bodies[q], n)

    return SimpleNamespace(
        block_corner=block_corner,
        lone_corner=lone_corner,
        clear_node=clear_node,
        settle_carried=settle_carried,
        divide_node=divide_node,
        update_node=update_node,
        clear_block=clear_block,
        divide_block=divide_block,
        settle_block=settle_block,
        update_block=update_block,
    )
