"""Massless points: they read a copy of the grid in which every node counts by the matter it stands for.

That copy, the carrier, holds h v and h at each node (`gasp_core.stepping.mpm.presence`); it is written with the grid,
and only where there are tracers.
"""

from gasp_taichi_mpm import words
from gasp_taichi_mpm.nodes import stand_of
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.transfers import cell_of, has_drifted, stencil, weights

__all__ = ["carry"]

_node4 = ti.types.vector(4, ti.f64)


@ti.func
def carry(
    tracers: ti.template(),
    homes: ti.template(),
    carrier: ti.template(),
    batch: ti.template(),
    control: ti.template(),
    report: ti.template(),
    met: ti.template(),
    p,
):
    """Move a tracer by sum w h v / sum w h over the 27 nodes around it."""
    offset, first, sx, sy = stencil(tracers, control, p)
    w = weights(offset)
    total = _node4(0)
    for i in ti.static(range(3)):
        sheet = _node4(0)
        for j in ti.static(range(3)):
            line = (first + i * sx + j * sy) & words.NODE_BITS
            sheet += w[j, 1] * (w[0, 2] * carrier[line] + w[1, 2] * carrier[line + 1] + w[2, 2] * carrier[line + 2])
        total += w[i, 0] * sheet
    # One that nothing moves may stay outside the walls.
    if total[3] > 0 and (total[0] != 0 or total[1] != 0 or total[2] != 0):
        place = tracers[p] + (batch[words.STEP] / total[3]) * ti.Vector([total[0], total[1], total[2]])
        if control[words.CLAMP] == 1:
            stand = stand_of(met, control, homes[3 * p] - control[words.LOWER])
            for d in ti.static(range(3)):
                low, high = batch[words.WALL_LOW + d] + stand[d], batch[words.WALL_HIGH + d] + stand[d]
                place[d] = ti.min(ti.max(place[d], low), high)
        tracers[p] = place
        drift = cell_of(place)
        for d in ti.static(range(3)):
            drift[d] -= homes[3 * p + d]
        if has_drifted(drift):
            report[words.DRIFTED] = 1
