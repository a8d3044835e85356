"""Where the points are: cells, blocks of 4^3 cells, their order and the part of the grid they can reach.

A point's home cell is the base of its B-spline stencil when the points were last sorted. Until the next sort it may
drift by one cell along each axis, so a block of points writes at most 8 nodes along an axis, and blocks of the same
colour (the same parity along the three axes) never touch a common node: each can be written without atomics, in any
order, with the same result.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BLOCK",
    "COLOURS",
    "CellTables",
    "GridTooLargeError",
    "arrange",
    "blocks_in_reach",
    "cell_keys",
    "cell_order",
    "grid_box",
    "stable_order",
    "tabulate",
]

Array = NDArray[Any]

BLOCK = 4
"""Nodes along a side of a block."""
COLOURS = 8


class GridTooLargeError(Exception):
    """The nodes needed exceed the limit; carries the number of them."""

    def __init__(self, nodes: int) -> None:
        super().__init__(f"{nodes} grid nodes needed")
        self.nodes = nodes


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTables:
    """The order of the points and the blocks of the grid they occupy.

    Parameters
    ----------
    lower : (3,) int64
        Absolute index of the grid's first node, multiples of 4.
    shape : (3,) int64
        Nodes along each axis, multiples of 4.
    cells : (C,) int32
        Numbers of the cells that points have for homes (`cell_keys`), ascending: the points are in this order.
    counts : (C,) int32
        How many points each of them has.
    tiles : (K, 2) int32
        First row and end of every occupied block's points, by colour.
    colour_offsets : (9,) int32
        Where each colour begins in `tiles`, and the end.
    active : (B,) int32
        Blocks whose nodes a point can reach, row-major in the grid's blocks.
    """

    lower: Array
    shape: Array
    cells: Array
    counts: Array
    tiles: Array
    colour_offsets: Array
    active: Array


def grid_box(low: Array, high: Array, limit: int, margin: int = 0) -> tuple[Array, Array]:
    """First node and shape of a grid for home cells low..high, both (3,) integers, and `margin` blocks around it.

    Raises
    ------
    GridTooLargeError
        Where it would have more than `limit` nodes.
    """
    lower = (np.asarray(low, dtype=np.int64) - 1) // BLOCK * BLOCK
    # A stencil spans 3 nodes and a point may have drifted by one cell either way: nodes low - 1 .. high + 3.
    shape = ((np.asarray(high, dtype=np.int64) + 3 - lower) // BLOCK + 1) * BLOCK + 2 * margin * BLOCK
    lower -= margin * BLOCK
    nodes = int(shape[0]) * int(shape[1]) * int(shape[2])
    if nodes > limit:
        raise GridTooLargeError(nodes)
    return lower, shape


def stable_order(keys: Array) -> Array:
    """Stable argsort of non-negative int32 keys by two passes over 16 bits, for which NumPy has a radix sort."""
    order = np.argsort((keys & 0xFFFF).astype(np.uint16), kind="stable")
    if keys.size and int(keys.max()) > 0xFFFF:
        order = order[np.argsort((keys >> 16).astype(np.uint16)[order], kind="stable")]
    return order.astype(np.int32)


def cell_keys(home: Array, lower: Array, blocks: Array) -> Array:
    """Numbers (N,) of home cells (N, 3) on a grid of `blocks` (3,) from `lower` (3,): by block, then within it."""
    x, y, z = (home[:, axis] - np.int32(lower[axis]) for axis in range(3))
    block = ((x >> 2) * np.int32(blocks[1]) + (y >> 2)) * np.int32(blocks[2]) + (z >> 2)
    return block * np.int32(64) + ((x & 3) * np.int32(16) + (y & 3) * np.int32(4) + (z & 3))


def blocks_in_reach(keys: Array, blocks: Array) -> Array:
    """Blocks (8, K), some of them the same, that hold the nodes in reach of points whose homes have these keys (K,)."""
    node = np.stack(np.unravel_index(keys >> 6, blocks), axis=1) * BLOCK
    node += np.stack([keys >> 4 & 3, keys >> 2 & 3, keys & 3], axis=1)
    # The five nodes -1 .. 3 of an axis lie in at most two blocks: those of its two ends.
    ends = (node - 1) // BLOCK, (node + 3) // BLOCK
    corners = ([ends[bits >> axis & 1][:, axis] for axis in range(3)] for bits in range(8))
    return np.stack([(bx * blocks[1] + by) * blocks[2] + bz for bx, by, bz in corners])


def cell_order(home: Array, lower: Array, shape: Array) -> tuple[Array, Array, Array]:
    """Rows (N,) int32 of home cells (N, 3) by block, then by cell, then as they were; the cells (C,) and counts (C,).

    `lower` and `shape` are those of a grid that has these cells; cells and counts are as in `CellTables`.
    """
    keys = cell_keys(home, lower, shape // BLOCK)
    order = stable_order(keys)
    keys = keys[order]
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
    return order, keys[first], np.diff(first, append=len(keys)).astype(np.int32)


def _kinds_of(cells: Array, blocks: Array) -> Array:
    """One cell of each of those from which the same blocks are in reach.

    Along an axis the first cell of a block reaches the block before, the others reach the one behind.
    """
    x, y, z = np.unravel_index(np.arange(BLOCK**3), (BLOCK,) * 3)
    kind_of = ((x > 0) * 4 + (y > 0) * 2 + (z > 0)).astype(np.int32)
    present = np.zeros(8 * int(np.prod(blocks)), dtype=np.bool_)
    present[(cells >> 6) * 8 + kind_of[cells & 63]] = True
    found = np.flatnonzero(present)
    kind = found & 7
    return (found >> 3) * 64 + (kind >> 2) * 16 + (kind >> 1 & 1) * 4 + (kind & 1)


def tabulate(lower: Array, shape: Array, cells: Array, counts: Array) -> CellTables:
    """Tables of a grid on which points are in the order of their cells; parameters as of `CellTables`."""
    blocks = shape // BLOCK
    occupied = cells >> 6
    head = np.flatnonzero(np.concatenate([[True], occupied[1:] != occupied[:-1]]))
    end = np.cumsum(counts)
    tiles = np.stack([end[head] - counts[head], end[np.append(head[1:], len(cells)) - 1]], axis=1)
    corner = np.stack(np.unravel_index(occupied[head], blocks), axis=1)
    # Colours by absolute position: the order of summation, hence every bit, does not depend on where the grid begins.
    parity = (corner + lower // BLOCK) & 1
    colour = parity[:, 0] * 4 + parity[:, 1] * 2 + parity[:, 2]
    by_colour = np.argsort(colour, kind="stable")
    reached = np.zeros(int(np.prod(blocks)), dtype=np.bool_)
    reached[blocks_in_reach(_kinds_of(cells, blocks), blocks)] = True
    return CellTables(
        lower=lower,
        shape=shape,
        cells=cells,
        counts=counts,
        tiles=tiles[by_colour].astype(np.int32),
        colour_offsets=np.searchsorted(colour[by_colour], np.arange(COLOURS + 1)).astype(np.int32),
        active=np.flatnonzero(reached).astype(np.int32),
    )


def arrange(home: Array, limit: int, margin: int = 0) -> tuple[CellTables, Array]:
    """Tables for points with home cells (N, 3) int32, on a grid that fits them and `margin` blocks around them.

    And the rows (N,) of the points in the order of these tables.

    Raises
    ------
    GridTooLargeError
        Where the grid would have more than `limit` nodes.
    """
    lower, shape = grid_box(home.min(axis=0), home.max(axis=0), limit, margin)
    order, cells, counts = cell_order(home, lower, shape)
    return tabulate(lower, shape, cells, counts), order
