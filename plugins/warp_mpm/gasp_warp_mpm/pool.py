# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""Memory that a GPU's block of threads shares: what its points give the same nodes is added up there first.

A tile's points reach 8^3 nodes at most (`gasp_mpm_host.cells`), and each of them is then written once on the grid, not
once a point. On the CPU, where Warp has one thread a block, the same functions work on memory of their own.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import tables_of

__all__ = ["LANES", "make_pool"]

LANES = 64
"""Threads that share a tile on a GPU: as many as it has cells, so that those that add at the same time mostly add to
different nodes."""

_SIDE = 8
_NODES = _SIDE**3

_MEMORY = f"""
#if defined(__CUDA_ARCH__)
    __shared__ REAL sums[{4 * _NODES}];
#else
    static REAL sums[{4 * _NODES}];
#endif
    return (wp::uint64)sums;
"""

_JOIN = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
"""

_ADD = """
    REAL* const node = (REAL*)pool + 4 * index;
    for (int c = 0; c < COUNT; ++c)
#if defined(__CUDA_ARCH__)
        atomicAdd(node + c, part[c]);
#else
        node[c] += part[c];
#endif
"""

_READ = """
    const REAL* const node = (const REAL*)pool + 4 * index;
    return wp::vec_t<4, REAL>(node[0], node[1], node[2], node[3]);
"""

_CLEAR = """
    REAL* const node = (REAL*)pool + 4 * index;
    node[0] = node[1] = node[2] = node[3] = 0;
"""


@cache
def make_pool(double: bool) -> SimpleNamespace:
    """Functions open_pool, add_to_pool, add_pair_to_pool, corner_of, place_in_pool, share_of and give_(mean_)sums."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec2, vec4 = types.vec2, types.vec4
    Grid = wp.array(dtype=vec4)
    Tables = tables_of(real)
    zero = real(0.0)
    half_cell = wp.float64(0.5)

    def typed(snippet: str) -> str:
        return snippet.replace("REAL", "double" if double else "float")

    @wp.func_native(typed(_MEMORY))
    def memory() -> wp.uint64:
        """Where it is."""

    @wp.func_native(typed(_JOIN))
    def join():
        """Go on when all threads of the block have come here."""

    @wp.func_native(typed(_ADD.replace("COUNT", "4")))
    def add_to_pool(pool: wp.uint64, index: int, part: vec4):
        """Add to one of the pool's nodes, whoever else does."""

    @wp.func_native(typed(_ADD.replace("COUNT", "2")))
    def add_pair_to_pool(pool: wp.uint64, index: int, part: vec2):
        """As `add_to_pool`, of two numbers alone."""

    @wp.func_native(typed(_READ))
    def read(pool: wp.uint64, index: int) -> vec4:
        """What a node was given."""

    @wp.func_native(typed(_CLEAR))
    def clear(pool: wp.uint64, index: int):
        """Empty a node."""

    @wp.func
    def open_pool(lane: int, lanes: int):
        """The pool of this block of threads, empty; all of them come here."""
        pool = memory()
        for n in range(lane, _NODES, lanes):
            clear(pool, n)
        join()
        return pool

    @wp.func
    def share_of(begin: int, end: int, lane: int, lanes: int):
        """First and end of a lane's share of begin .. end, neighbours together."""
        count = end - begin
        return begin + count * lane // lanes, begin + count * (lane + 1) // lanes

    @wp.func
    def corner_of(s: Tables, begin: int):
        """The pool's first node on the grid, for the tile that begins with this point."""
        home = wp.vec3i()
        for d in range(3):
            home[d] = (s.labels[begin * at.LABEL_WIDTH + at.HOME + d] - s.lower[d]) // 4 * 4 - 1
        return home

    @wp.func
    def place_in_pool(s: Tables, p: int, corner: wp.vec3i):
        """Index of the first node of a point's stencil; along x and y they are 64 and 8 apart."""
        place = s.x[p]
        first = int(0)
        for d in range(3):
            first = _SIDE * first + (int(wp.floor(place[d] - half_cell)) - s.lower[d] - corner[d])
        return first

    @wp.func
    def row_of(s: Tables, corner: wp.vec3i, n: int):
        return ((corner[0] + n // 64) * s.shape[1] + corner[1] + n // 8 % 8) * s.shape[2] + corner[2] + n % 8

    @wp.func
    def give_sums(s: Tables, grid: Grid, pool: wp.uint64, corner: wp.vec3i, lane: int, lanes: int):
        """To a grid, beyond whose edge lie only nodes that nobody gave anything.

        All threads of the block come here, and none goes on to another tile before all have read.
        """
        join()
        for n in range(lane, _NODES, lanes):
            total = read(pool, n)
            if total[0] != zero or total[1] != zero or total[2] != zero or total[3] != zero:
                wp.atomic_add(grid, row_of(s, corner, n), total)
        join()

    @wp.func
    def give_mean_sums(s: Tables, pool: wp.uint64, corner: wp.vec3i, lane: int, lanes: int):
        """As `give_sums`, of dilations and volumes."""
        join()
        for n in range(lane, _NODES, lanes):
            total = read(pool, n)
            if total[0] != zero or total[1] != zero:
                wp.atomic_add(s.means, row_of(s, corner, n), vec2(total[0], total[1]))
        join()

    return SimpleNamespace(
        open_pool=open_pool,
        add_to_pool=add_to_pool,
        add_pair_to_pool=add_pair_to_pool,
        corner_of=corner_of,
        place_in_pool=place_in_pool,
        share_of=share_of,
        give_sums=give_sums,
        give_mean_sums=give_mean_sums,
    )
