"""Several bodies on one grid: each stands beside the others on it, so that none shares a node with another.

A body has a velocity field of its own. Kernels need not know: for them every body is moved by whole cells, by its
`stand`, to where nobody else is, so that the grid's blocks that hold one body hold no other. What has to do with places
in the scene (colliders, drives, bounds, what is read) takes the stand away again, and `meetings` says which blocks are
one place of several bodies.

Bodies stand in a row along x, each in blocks 0, 1, 2, ... of its own; stands are multiples of two blocks, so that
colours stay, and with them the order of summation and every bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import ContactCondition, PointProblem
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import BLOCK, CellTables, blocks_in_reach, grid_box

__all__ = ["NOWHERE", "Meetings", "alone", "bodies_of_columns", "home_boxes", "meetings", "stands_for"]

Array = NDArray[Any]

NOWHERE = 2**31 - 1
"""Farther than any cell, which int32 holds."""
_STEP = 2 * BLOCK
_ROOM = 4
"""Steps left free between bodies, so that they may move a while before they have to be moved apart again."""
_WASTE = 2.0
"""How many times the nodes that are needed a grid may have before its bodies are put closer together."""
_NO_LIMIT = 2**62
_CONDITIONS = {
    ContactCondition.STICK: at.STICK,
    ContactCondition.SLIP: at.SLIP,
    ContactCondition.SEPARATE: at.SEPARATE,
}


def home_boxes(home: Array, bodies: Array, count: int) -> Array:
    """Lowest and highest of the home cells (N, 3) of each of `count` bodies, (count, 2, 3) int64.

    `bodies` (N,) say whose the points are. Of a body without points the lowest is above the highest.
    """
    found = np.empty((count, 2, 3), dtype=np.int64)
    found[:, 0], found[:, 1] = NOWHERE, -NOWHERE
    if count == 1:
        found[0] = home.min(axis=0), home.max(axis=0)
        return found
    for body in np.unique(bodies):
        own = home[bodies == body]
        found[body] = own.min(axis=0), own.max(axis=0)
    return found


def stands_for(boxes: Array, stands: Array, margin: int = 0) -> Array:
    """Stands (B, 3) int64 [cells] with which no body is in another's way: those they have, if these will do.

    Parameters
    ----------
    boxes : (B, 2, 3) int64
        Lowest and highest of the cells that the points of each body are in, without their stands (`home_boxes`).
    stands : (B, 3) int64
        Those they have.
    margin
        Blocks to keep free around each body.
    """
    if len(stands) == 1:
        return stands
    filled = np.flatnonzero(boxes[:, 0, 0] <= boxes[:, 1, 0])
    lowest, shapes = np.empty((2, len(filled), 3), dtype=np.int64)
    for row, body in enumerate(filled):
        lowest[row], shapes[row] = grid_box(boxes[body, 0], boxes[body, 1], _NO_LIMIT, margin)
    packed = stands.copy()
    begin = lowest[0].copy()
    for row, body in enumerate(filled):
        packed[body] = -((lowest[row] - begin) // _STEP) * _STEP
        begin[0] = lowest[row, 0] + packed[body, 0] + shapes[row, 0] + _ROOM * _STEP
    starts = lowest + stands[filled]
    apart = bool(np.all((starts + shapes)[:-1, 0] <= starts[1:, 0]))
    wasteful = _nodes(starts, shapes) > _WASTE * _nodes(lowest + packed[filled], shapes)
    # Where nobody is near another one all may stay where they are: a place far from the origin has fewer digits.
    apart = apart or (margin == 0 and not stands.any() and _disjoint(lowest, shapes))
    return stands if apart and not wasteful else packed


def _disjoint(lowest: Array, shapes: Array) -> bool:
    """Whether no two of the boxes (B, 3) have a node in common."""
    highest = lowest + shapes
    apart = (highest[:, None] <= lowest) | (lowest[:, None] >= highest)
    return bool((apart.any(axis=2) | np.eye(len(lowest), dtype=np.bool_)).all())


def _nodes(lowest: Array, shapes: Array) -> float:
    """Nodes of the box around boxes (B, 3)."""
    return float(np.prod((lowest + shapes).max(axis=0) - lowest.min(axis=0), dtype=np.float64))


def bodies_of_columns(boxes: Array, tables: CellTables, margin: int = 0) -> Array:
    """Which body is in each of the X columns of blocks along x, (X,).

    `boxes` (B, 2, 3) are those of the homes with the stands (`home_boxes`), `margin` the blocks kept free around them.
    """
    columns = np.zeros(int(tables.shape[0]) // BLOCK, dtype=np.int32)
    if len(boxes) > 1:
        firsts = boxes[:, 0, 0]
        for body in np.argsort(firsts, kind="stable"):
            # A point may have drifted by a cell.
            begin = max(0, int((firsts[body] - 1 - tables.lower[0]) // BLOCK) - margin)
            columns[begin:] = body
    return columns


@dataclass(frozen=True, slots=True, kw_only=True)
class Meetings:
    """Where several bodies may share nodes: blocks of the grid that are one place, if stands are taken away.

    Parameters
    ----------
    apart : (A,) int32
        Active blocks where there is one body only.
    members : (M,) int32
        Active blocks of the others, by place and then by body.
    places : (G + 1,) int32
        Where the members of each place begin, and the end.
    pairs : (P, 3) int32
        Rows of `members`, the body of the lower number first, and the condition of their contact.
    friction : (P,) float64
    pair_begins : (G + 1,) int32
        Where the pairs of each place begin, and the end.
    near : (K,) int32
        Rows of the points that may reach a member's nodes, until the next sort.
    near_begins : (M + 1,) int32
        Where those of each member begin, and the end.
    apart_bodies : (A,) int32
        Whose the blocks `apart` are.
    member_bodies : (M,) int32
    """

    apart: Array
    members: Array
    places: Array
    pairs: Array
    friction: Array
    pair_begins: Array
    near: Array
    near_begins: Array
    apart_bodies: Array
    member_bodies: Array


def meetings(problem: PointProblem, bodies: Array, stands: Array, active: Array, tables: CellTables) -> Meetings:
    """Of points in the order of `tables`; `bodies` (N,) say whose they are, `active` (A,) which blocks are active."""
    cells, lengths, blocks = tables.cells, tables.counts.astype(np.int64), tables.shape // BLOCK
    begins = np.cumsum(lengths) - lengths
    whose = bodies[begins]
    count = int(np.prod(blocks))
    reach = blocks_in_reach(cells, blocks)
    owner = np.full(count, -1, dtype=np.int32)
    owner[reach] = np.broadcast_to(whose, reach.shape)
    reached = np.flatnonzero(owner >= 0)
    place = np.stack(np.unravel_index(reached, blocks), axis=1) - stands[owner[reached]] // BLOCK
    _, which, crowd = np.unique(place, axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(-1)
    shared = crowd[which] > 1
    # What nothing but tracers reads is nobody's.
    owner = np.maximum(owner, 0)
    if not shared.any():
        return alone(active, owner[active])
    members, which = reached[shared], which[shared]
    order = np.lexsort((owner[members], which))
    members, which = members[order], which[order]
    starts = np.flatnonzero(np.diff(which, prepend=-1))
    ends = np.append(starts[1:], len(members))
    pairs = [
        (low, high) for begin, end in zip(starts, ends) for low in range(begin, end) for high in range(low + 1, end)
    ]
    sizes = ends - starts
    contacts = [problem.contact_between(int(owner[members[low]]), int(owner[members[high]])) for low, high in pairs]

    # Of each member the points in cells from which it can be reached.
    row_of = np.full(count, -1, dtype=np.int64)
    row_of[members] = np.arange(len(members))
    hit = row_of[reach]
    corner, cell = np.nonzero(hit >= 0)
    reaching = np.unique(np.stack([hit[corner, cell], cell], axis=1), axis=0)
    own = lengths[reaching[:, 1]]
    into = np.arange(own.sum()) - np.repeat(np.cumsum(own) - own, own)
    near = np.repeat(begins[reaching[:, 1]], own) + into
    totals = np.zeros(len(members) + 1, dtype=np.int64)
    np.add.at(totals, reaching[:, 0] + 1, own)
    apart = active[~np.isin(active, members)]
    return Meetings(
        apart=apart,
        apart_bodies=owner[apart],
        members=members.astype(np.int32),
        member_bodies=owner[members],
        places=np.append(starts, len(members)).astype(np.int32),
        pairs=np.array(
            [(*pair, _CONDITIONS[contact.contact]) for pair, contact in zip(pairs, contacts)], dtype=np.int32
        ),
        friction=np.array([contact.friction for contact in contacts]),
        pair_begins=np.concatenate([[0], np.cumsum(sizes * (sizes - 1) // 2)]).astype(np.int32),
        near=near.astype(np.int32),
        near_begins=np.cumsum(totals).astype(np.int32),
    )


def alone(active: Array, bodies: Array) -> Meetings:
    """Where nobody meets anybody in the blocks `active` (A,), which are of `bodies` (A,)."""
    none = np.zeros(0, dtype=np.int32)
    begin = np.zeros(1, dtype=np.int32)
    return Meetings(
        apart=active,
        apart_bodies=bodies.astype(np.int32),
        members=none,
        member_bodies=none,
        places=begin,
        pairs=none.reshape(0, 3),
        friction=np.zeros(0),
        pair_begins=begin,
        near=none,
        near_begins=begin,
    )
