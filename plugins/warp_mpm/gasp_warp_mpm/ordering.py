# ruff: noqa: RUF046, SIM102, UP018 - Warp tells a variable int(0) from a constant 0, and evaluates both sides of "and".
"""Points in the order of their cells: on a GPU they are sorted where they are, and only the cells come to the host."""

# No `from __future__ import annotations`: Warp reads the types themselves.
from types import SimpleNamespace
from typing import Any

import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.bodies import NOWHERE
from gasp_mpm_host.cloud import CELL_LIMIT

from gasp_warp_mpm.tables import tables_of

__all__ = ["BOX_WIDTH", "POINTS_A_BOX", "make_ordering"]

BOX_WIDTH = 7
"""Of a body: the lowest and the highest home, and how many points are too far away for one."""
POINTS_A_BOX = 64
"""Of a thread that looks for the lowest and the highest."""


def make_ordering(module: Any, double: bool, transfers: SimpleNamespace, *, alone: bool) -> SimpleNamespace:
    """Kernels settle and permute, in Warp's module `module`.

    For points that are sorted `alone`, where they are, also begin_boxes, box_homes, number_cells and permute_ids; a
    thread of box_homes takes `POINTS_A_BOX` points.
    """
    real = wp.float64 if double else wp.float32
    Tables = tables_of(real)
    Reals, Integers = wp.array(dtype=real), wp.array(dtype=wp.int32)
    load, store = transfers.load, transfers.store
    half_cell, cell_limit = wp.float64(0.5), wp.float64(CELL_LIMIT)

    @wp.func
    def home_of(place: wp.vec3d, d: int):
        return int(wp.floor(place[d] - half_cell))

    @wp.kernel(module=module, enable_backward=False)
    def settle(s: Tables):
        """Give a point the cell it is in as its home."""
        p = wp.tid()
        place = s.x[p]
        for d in range(3):
            s.labels[p * at.LABEL_WIDTH + at.HOME + d] = home_of(place, d)

    @wp.kernel(module=module, enable_backward=False)
    def permute(s: Tables, order: Integers, x: wp.array(dtype=wp.vec3d), points: Reals, labels: Integers):
        """A row in its new place."""
        q = wp.tid()
        p = order[q]
        x[q] = s.x[p]
        for c in range(at.POINT_WIDTH // 4):
            store(points, q * at.POINT_WIDTH + 4 * c, load(s.points, p * at.POINT_WIDTH + 4 * c))
        for c in range(at.LABEL_WIDTH):
            labels[q * at.LABEL_WIDTH + c] = s.labels[p * at.LABEL_WIDTH + c]

    kernels = SimpleNamespace(settle=settle, permute=permute)
    if not alone:
        return kernels

    @wp.kernel(module=module, enable_backward=False)
    def begin_boxes(s: Tables, boxes: Integers):
        """The box of a body that has no points."""
        b = wp.tid() * BOX_WIDTH
        for d in range(3):
            boxes[b + d] = NOWHERE
            boxes[b + 3 + d] = -NOWHERE
        boxes[b + 6] = 0

    @wp.kernel(module=module, enable_backward=False)
    def box_homes(s: Tables, ids: Integers, bodies: Integers, boxes: Integers):
        """Widen the boxes of the bodies to the homes of some points; which body a point is of is said by its id."""
        begin = wp.tid() * POINTS_A_BOX
        end = wp.min(begin + POINTS_A_BOX, s.count)
        p = int(begin)
        while p < end:
            body = bodies[ids[p]]
            low, high, far = wp.vec3i(NOWHERE), wp.vec3i(-NOWHERE), int(0)
            more = int(1)
            while more == 1:
                place = s.x[p]
                # Written so that NaN fails it.
                if wp.max(wp.abs(place)) < cell_limit and place == place:
                    home = wp.vec3i(home_of(place, 0), home_of(place, 1), home_of(place, 2))
                    low, high = wp.min(low, home), wp.max(high, home)
                else:
                    far += 1
                p += 1
                more = int(0)
                if p < end:
                    if bodies[ids[p]] == body:
                        more = int(1)
            for d in range(3):
                wp.atomic_min(boxes, body * BOX_WIDTH + d, low[d])
                wp.atomic_max(boxes, body * BOX_WIDTH + 3 + d, high[d])
            if far > 0:
                wp.atomic_add(boxes, body * BOX_WIDTH + 6, far)

    @wp.kernel(module=module, enable_backward=False)
    def number_cells(s: Tables, lower: wp.vec3i, blocks: wp.vec3i, keys: Integers, order: Integers):
        """A point's cell as `gasp_mpm_host.cells.cell_keys` numbers it, and its row."""
        p = wp.tid()
        c = wp.vec3i()
        for d in range(3):
            c[d] = s.labels[p * at.LABEL_WIDTH + at.HOME + d] - lower[d]
        block = (c[0] // 4 * blocks[1] + c[1] // 4) * blocks[2] + c[2] // 4
        keys[p] = block * 64 + (c[0] % 4 * 16 + c[1] % 4 * 4 + c[2] % 4)
        order[p] = p

    @wp.kernel(module=module, enable_backward=False)
    def permute_ids(s: Tables, order: Integers, before: Integers, after: Integers):
        """Whose row is where now."""
        q = wp.tid()
        after[q] = before[order[q]]

    vars(kernels).update(
        begin_boxes=begin_boxes, box_homes=box_homes, number_cells=number_cells, permute_ids=permute_ids
    )
    return kernels
