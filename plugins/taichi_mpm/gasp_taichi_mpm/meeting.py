"""Nodes that several bodies share: what contact makes of their velocities there.

A place is a block of nodes that is one of several bodies' (`gasp_mpm_host.bodies`); one thread does all of it. What is
computed is what gasp-reference-mpm's `bodies` computes, where the words are explained.
"""

from collections.abc import Callable
from typing import Any

from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import FULL_PRESENCE, HELD_TOGETHER
from gasp_taichi_mpm import words
from gasp_taichi_mpm.contact import acted, confined
from gasp_taichi_mpm.nodes import settle_carried, stand_of
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.separation import BEST, GAP, NODES, SCRATCH_WIDTH, STATE, corner_of, kept, row_of, separate

__all__ = ["make_meet"]

_node4 = ti.types.vector(4, ti.f64)


@ti.func
def _true_place(met: ti.template(), control: ti.template(), corner, n):
    """Where a node is in the scene, in cells: its body's stand is taken away."""
    low = ti.Vector([control[words.LOWER + d] for d in range(3)])
    node = ti.Vector([n // 16, n // 4 % 4, n % 4])
    return ti.cast(low + corner + node - stand_of(met, control, corner[0]), ti.f64)


@ti.func
def _exchange(
    grid: ti.template(), batch: ti.template(), control: ti.template(), met: ti.template(), scratch: ti.template(), pair
):
    """Opposite impulses on the two bodies of a pair, at every node it shares."""
    entry = control[words.PAIRS_AT] + 3 * pair
    corner1, corner2 = corner_of(met, control, met[entry]), corner_of(met, control, met[entry + 1])
    condition = met[entry + 2]
    friction = scratch[pair]
    for n in range(NODES):
        row = control[words.SCRATCH_AT] + (pair * NODES + n) * SCRATCH_WIDTH
        row1, row2 = row_of(control, corner1, n), row_of(control, corner2, n)
        g1, g2 = grid[row1], grid[row2]
        total = g1[3] + g2[3]
        if scratch[row + STATE] > 0 and g1[3] >= 0 and g2[3] >= 0 and total > 0:
            gap = scratch[row + GAP]
            normal = kept(scratch, row + BEST)
            closing = ti.Vector([g1[0] - g2[0], g1[1] - g2[1], g1[2] - g2[2]])
            approach = closing.dot(normal)
            across = closing - approach * normal
            taken = closing * 0.0
            if condition == at.SEPARATE:
                stopped = approach - ti.max(gap, 0.0) / batch[words.STEP]
                if stopped > 0:
                    speed = across.norm()
                    braked = ti.f64(1.0)
                    if friction * stopped < speed:
                        braked = friction * stopped / speed
                    taken = stopped * normal + braked * across
            elif gap <= HELD_TOGETHER:
                taken = closing
                if condition == at.SLIP:
                    taken = approach * normal
            impulse = taken / total
            for d in ti.static(range(3)):
                g1[d] -= g1[3] * impulse[d]
                g2[d] += g2[3] * impulse[d]
            grid[row1] = g1
            grid[row2] = g2


@ti.func
def _close_gaps(
    grid: ti.template(), batch: ti.template(), control: ti.template(), met: ti.template(), scratch: ti.template(), pair
):
    """By as much as the bodies of a pair go towards each other."""
    entry = control[words.PAIRS_AT] + 3 * pair
    corner1, corner2 = corner_of(met, control, met[entry]), corner_of(met, control, met[entry + 1])
    for n in range(NODES):
        row = control[words.SCRATCH_AT] + (pair * NODES + n) * SCRATCH_WIDTH
        g1, g2 = grid[row_of(control, corner1, n)], grid[row_of(control, corner2, n)]
        if scratch[row + STATE] > 0 and g1[3] >= 0 and g2[3] >= 0:
            closing = ti.Vector([g1[0] - g2[0], g1[1] - g2[1], g1[2] - g2[2]])
            scratch[row + GAP] -= batch[words.STEP] * closing.dot(kept(scratch, row + BEST))


def make_meet(least_mass: float, *, flowing: bool) -> Callable[..., Any]:
    """Taichi function: from momenta to velocities, at the nodes of one place of several bodies.

    Parameters
    ----------
    least_mass
        A node that holds no more than this has no velocity.
    flowing
        What the points brought is kept for matter that flows.
    """

    @ti.func
    def meet(
        x: ti.template(),
        points: ti.template(),
        labels: ti.template(),
        grid: ti.template(),
        carrier: ti.template(),
        materials: ti.template(),
        batch: ti.template(),
        forcing: ti.template(),
        fields: ti.template(),
        control: ti.template(),
        report: ti.template(),
        met: ti.template(),
        scratch: ti.template(),
        drive_set,
        place,
    ):
        first_member = met[control[words.MEMBER_BEGINS_AT] + place]
        end_member = met[control[words.MEMBER_BEGINS_AT] + place + 1]
        kick = ti.Vector([batch[words.GRAVITY], batch[words.GRAVITY + 1], batch[words.GRAVITY + 2]])
        traced = control[words.CARRIES] == 1
        # Momentum to velocity, and what acts on bodies before they meet; in place of the mass its inverse, or -1.
        for m in range(first_member, end_member):
            corner = corner_of(met, control, m)
            body = met[control[words.MEMBER_BODIES_AT] + m]
            for n in range(NODES):
                row = row_of(control, corner, n)
                g = grid[row]
                v = _node4(0, 0, 0, -1)
                if g[3] > least_mass:
                    u = ti.Vector([g[0], g[1], g[2]]) * (1 / g[3]) + kick
                    u, held = acted(u, _true_place(met, control, corner, n), body, forcing, fields, control, drive_set)
                    share = 1 / g[3]
                    if held:
                        share = 0.0
                    v = _node4(u[0], u[1], u[2], share)
                grid[row] = v
                if ti.static(flowing):
                    settle_carried(grid, control, row, least_mass)
                if traced:
                    carrier[row] = _node4(0, 0, 0, ti.min(g[3] / ti.f64(FULL_PRESENCE), ti.f64(1.0)))

        first_pair = met[control[words.PAIR_BEGINS_AT] + place]
        end_pair = met[control[words.PAIR_BEGINS_AT] + place + 1]
        if control[words.SEEDING] == 1:
            end_pair = first_pair
        if drive_set == control[words.FIRST_STEP] or drive_set % control[words.LOOKS] == 0:
            for pair in range(first_pair, end_pair):
                separate(x, points, labels, grid, materials, control, met, scratch, pair)
        for turn in range(2 * (end_pair - first_pair) - 1):
            # There and back again, the last one once.
            pair = ti.min(first_pair + turn, 2 * end_pair - 2 - first_pair - turn)
            _exchange(grid, batch, control, met, scratch, pair)
        # Until the next look a gap changes as the bodies move.
        for pair in range(first_pair, end_pair):
            _close_gaps(grid, batch, control, met, scratch, pair)

        for m in range(first_member, end_member):
            corner = corner_of(met, control, m)
            for n in range(NODES):
                row = row_of(control, corner, n)
                g = grid[row]
                v = _node4(0)
                if g[3] >= 0:
                    u = ti.Vector([g[0], g[1], g[2]])
                    u = confined(
                        u, _true_place(met, control, corner, n), batch, forcing, fields, control, report, drive_set
                    )
                    v = _node4(u[0], u[1], u[2], 0)
                grid[row] = v
                if traced:
                    presence = carrier[row][3]
                    carrier[row] = _node4(presence * v[0], presence * v[1], presence * v[2], presence)

    return meet
