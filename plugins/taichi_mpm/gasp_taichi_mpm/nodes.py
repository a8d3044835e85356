"""What happens at the nodes of a block of 4^3: they are emptied, sums become means, momentum becomes velocity."""

from types import SimpleNamespace

from gasp_core.stepping.mpm import FULL_PRESENCE
from gasp_taichi_mpm import words
from gasp_taichi_mpm.contact import constrain, is_touched
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["block_corner", "make_node_work", "settle_carried", "stand_of"]

_node4 = ti.types.vector(4, ti.f64)


@ti.func
def block_corner(control: ti.template(), block):
    """Place of a block's first node, from the grid's own first node."""
    by = control[words.SHAPE + 1] // 4
    bz = control[words.SHAPE + 2] // 4
    return ti.Vector([block // (by * bz), block // bz % by, block % bz]) * 4


@ti.func
def stand_of(met: ti.template(), control: ti.template(), x):
    """How far the body at the node `x` along the first axis is from its place in the scene, in cells."""
    begin = control[words.STANDS_AT] + 3 * (x // 4)
    return ti.Vector([met[begin], met[begin + 1], met[begin + 2]])


@ti.func
def line_of(control: ti.template(), corner, i, j):
    """The first of four nodes along z."""
    return ((corner[0] + i) * control[words.SHAPE + 1] + corner[1] + j) * control[words.SHAPE + 2] + corner[2]


@ti.func
def settle_carried(grid: ti.template(), control: ti.template(), row, least_mass: ti.template()):
    """Momentum to velocity, of what the points brought to a node; the mass stays."""
    carried = control[words.CARRIED_AT] + row
    g = grid[carried]
    v = _node4(0, 0, 0, g[3])
    if g[3] > least_mass:
        share = 1 / g[3]
        v = _node4(share * g[0], share * g[1], share * g[2], g[3])
    grid[carried] = v


def make_node_work(real, least_mass: float, *, averaged: bool, flowing: bool) -> SimpleNamespace:
    """Taichi functions for the block of rank q in the list of active ones.

    Parameters
    ----------
    least_mass
        A node that holds no more than this has no velocity.
    averaged
        There are sums of dilations, too.
    flowing
        What the points brought is kept for matter that flows.
    """
    vec2 = ti.types.vector(2, real)

    @ti.func
    def clear_block(grid: ti.template(), means: ti.template(), active: ti.template(), control: ti.template(), q):
        corner = block_corner(control, active[q])
        for i in range(4):
            for j in range(4):
                line = line_of(control, corner, i, j)
                for k in ti.static(range(4)):
                    grid[line + k] = _node4(0)
                    if ti.static(flowing):
                        grid[control[words.CARRIED_AT] + line + k] = _node4(0)
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
        carrier: ti.template(),
        met: ti.template(),
        batch: ti.template(),
        forcing: ti.template(),
        fields: ti.template(),
        control: ti.template(),
        report: ti.template(),
        drive_set,
        q,
    ):
        """Momentum to velocity, then whatever acts on it, at the nodes of one block where there is one body."""
        corner = block_corner(control, met[control[words.APART_AT] + q])
        body = met[control[words.APART_BODIES_AT] + q]
        low = ti.Vector([control[words.LOWER + d] for d in range(3)])
        origin = ti.cast(low + corner - stand_of(met, control, corner[0]), ti.f64)
        touched = is_touched(origin + 1.5, forcing, fields, control, drive_set)
        traced = control[words.CARRIES] == 1
        kick = ti.Vector([batch[words.GRAVITY], batch[words.GRAVITY + 1], batch[words.GRAVITY + 2]])
        for i in range(4):
            for j in range(4):
                line = line_of(control, corner, i, j) & words.NODE_BITS
                for k in range(4):
                    g = grid[line + k]
                    v = kick * 0
                    if g[3] > least_mass:
                        v = ti.Vector([g[0], g[1], g[2]]) * (1 / g[3]) + kick
                        if touched:
                            node = origin + ti.Vector([i, j, k])
                            v = constrain(v, node, body, batch, forcing, fields, control, report, drive_set)
                    grid[line + k] = _node4(v[0], v[1], v[2], 0)
                    if ti.static(flowing):
                        settle_carried(grid, control, line + k, least_mass)
                    if traced:
                        presence = ti.min(g[3] / ti.f64(FULL_PRESENCE), ti.f64(1.0))
                        carrier[line + k] = _node4(presence * v[0], presence * v[1], presence * v[2], presence)

    return SimpleNamespace(clear_block=clear_block, divide_block=divide_block, update_block=update_block)
