"""The loops over the 27 nodes around a point in native code: a line of three nodes along z is one vector of lanes.

What they compute is what the loops of `kernels` compute that stand beside them, which are the readable form and what
a GPU runs; the sums are the same but for their order. The weights along z, w (value), k (times the node's number) and
d (slope), are the same for all nine lines, so they are applied once, before a point spreads or after it collects.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp

from gasp_warp_mpm.decompositions import algebra

__all__ = ["make_native"]

_COMMON = """
    typedef REAL quad __attribute__((ext_vector_type(4), aligned(sizeof(REAL))));
    typedef REAL pair __attribute__((ext_vector_type(8), aligned(sizeof(REAL))));
    typedef REAL line __attribute__((ext_vector_type(16)));
    #define THRICE(a) __builtin_shufflevector(a, a, 0,1,2,3,0,1,2,3,0,1,2,3,0,1,2,3)
    #define ALONG(a, b, c) (line){a,a,a,a, b,b,b,b, c,c,c,c, 0,0,0,0}
    const REAL w0 = w.data[0][2], w1 = w.data[1][2], w2 = w.data[2][2];
    const line W = ALONG(w0, w1, w2);
    const line K = ALONG(0, w1, 2 * w2);
    const line D = ALONG(d.data[0][2], d.data[1][2], d.data[2][2]);
    REAL* const nodes = (REAL*)grid.data;
"""

# Eight lanes and four: a sixteenth part more would be the next tile's node, which another thread may be writing.
_SPREAD = """
    #define ROW(n) THRICE(*(const quad*)given.data[n])
    const line still = W * ROW(0) + K * ROW(3), ax = W * ROW(1), ay = W * ROW(2);
    const line px = W * ROW(4), py = W * ROW(5), pz = D * ROW(6);
    for (int i = 0; i < 3; ++i) {
        const REAL wi = w.data[i][0], mi = m * wi;
        const line a = mi * (still + (REAL)i * ax) + d.data[i][0] * px + wi * pz, b = mi * ay, c = wi * py;
        for (int j = 0; j < 3; ++j) {
            REAL* const at = nodes + 4 * ((long long)first + i * sx + j * sy);
            const line sum = w.data[j][1] * (a + (REAL)j * b) + d.data[j][1] * c;
            *(pair*)at = *(pair*)at + __builtin_shufflevector(sum, sum, 0,1,2,3,4,5,6,7);
            *(quad*)(at + 8) = *(quad*)(at + 8) + __builtin_shufflevector(sum, sum, 8,9,10,11);
        }
    }
    #undef ROW
"""

_COLLECT = """
    line v = 0, cx = 0, cy = 0, gx = 0, gy = 0;
    for (int i = 0; i < 3; ++i) {
        line s = 0, sy_ = 0, ds = 0;
        for (int j = 0; j < 3; ++j) {
            const REAL* const at = nodes + 4 * ((long long)first + i * sx + j * sy);
            const pair low = *(const pair*)at;
            const quad high = *(const quad*)(at + 8);
            const pair wide = __builtin_shufflevector(high, high, 0,1,2,3,0,1,2,3);
            const line g = __builtin_shufflevector(low, wide, 0,1,2,3,4,5,6,7,8,9,10,11,8,9,10,11);
            const line wg = w.data[j][1] * g;
            s = s + wg;
            sy_ = sy_ + (REAL)j * wg;
            ds = ds + d.data[j][1] * g;
        }
        const REAL wi = w.data[i][0];
        v = v + wi * s;
        cx = cx + ((REAL)i * wi) * s;
        cy = cy + wi * sy_;
        gx = gx + d.data[i][0] * s;
        gy = gy + wi * ds;
    }
    wp::mat_t<7, 4, REAL> found;
    #define SUM(n, x) { const line q = x; *(quad*)found.data[n] = __builtin_shufflevector(q, q, 0,1,2,3) \\
        + __builtin_shufflevector(q, q, 4,5,6,7) + __builtin_shufflevector(q, q, 8,9,10,11); }
    SUM(0, W * v) SUM(1, W * cx) SUM(2, W * cy) SUM(3, K * v) SUM(4, W * gx) SUM(5, W * gy) SUM(6, D * v)
    #undef SUM
    return found;
"""

_END = """
    #undef THRICE
    #undef ALONG
"""


@cache
def make_native(double: bool) -> SimpleNamespace:
    """Functions spread(grid, first, sx, sy, w, d, m, given) and collect(grid, first, sx, sy, w, d)."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec4, mat33 = types.vec4, types.mat33
    mat74 = wp.types.matrix((7, 4), real)

    def code(body: str) -> str:
        return (_COMMON + body).replace("REAL", "double" if double else "float")

    @wp.func_native(code(_SPREAD) + _END)
    def spread(grid: wp.array(dtype=vec4), first: int, sx: int, sy: int, w: mat33, d: mat33, m: real, given: mat74):
        """Add m w (u + A r) + the share of the slopes to 27 nodes; rows of `given`: u, A's columns, the slopes'."""

    @wp.func_native(code(_COLLECT).replace("    return found;\n", _END + "    return found;\n"))
    def collect(grid: wp.array(dtype=vec4), first: int, sx: int, sy: int, w: mat33, d: mat33) -> mat74:
        """Sums over 27 nodes, rows: v; v times the node's number along x, y, z; v by the slopes along x, y, z."""

    return SimpleNamespace(spread=spread, collect=collect)
