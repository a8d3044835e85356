"""Points to nodes on a GPU: a thread takes a run of points that lie together and adds up what they give in registers.

Points of one cell give the same 27 nodes. Only where the next point is in another cell does the thread add its sums to
the grid, one atomic addition for each node. (Shared memory has no addition of reals that is atomic by itself: sums that
a block of threads kept there took more than twice as long.)

What it computes is what `transfers` computes in readable form; momentum is added up relative to the velocity of the
first point in the cell: what moves as one keeps its velocity to rounding. On the CPU the same code is tested.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp

from gasp_warp_mpm.native_words import constants, worded
from gasp_warp_mpm.tables import tables_of

__all__ = ["RUN", "make_runs"]

RUN = 8
"""Points of a thread: about as many as lie in a cell."""

_NAMES = (
    *("VELOCITY", "AFFINE", "MASS", "STRESS", "DILATION", "MEAN_PRESSURE", "POINT_WIDTH"),
    *("MATERIAL", "LABEL_WIDTH", "MATERIAL_WIDTH", "MEAN_STIFFNESS", "LIGHTNESS"),
)

_BEGIN = (
    constants(*_NAMES)
    + """
    // As wide as one access to memory may be.
    struct alignas(16) quad { REAL v[4]; };
    const double* const places = (const double*)s.x.data;
    const int sy = s.shape[2], sx = s.shape[1] * sy;
    REAL sums[27][WIDTH];
    REAL* const nodes = (REAL*)s.NODES.data;
    REAL frame[3];
    int held = -1;
    for (int p = begin; p <= end; ++p) {
        REAL offset[3];
        int first = -1;
        if (p < end) {
            int cell[3];
#pragma unroll
            for (int d = 0; d < 3; ++d) {
                const double place = places[3 * (long long)p + d], base = floor(place - 0.5);
                offset[d] = (REAL)(place - base);
                cell[d] = (int)base - s.lower[d];
            }
            first = cell[0] * sx + cell[1] * sy + cell[2];
        }
        const REAL* const row = (const REAL*)s.points.data + (long long)p * POINT_WIDTH;
        if (first != held) {
            if (held >= 0) {
#pragma unroll
                for (int n = 0; n < 27; ++n) {
                    REAL* const node = nodes + WIDTH * (long long)(held + n / 9 * sx + n / 3 % 3 * sy + n % 3);
                    GIVE
                }
            }
            if (p == end) break;
            held = first;
#pragma unroll
            for (int d = 0; d < 3; ++d) frame[d] = row[VELOCITY + d];
#pragma unroll
            for (int n = 0; n < 27; ++n)
#pragma unroll
                for (int c = 0; c < WIDTH; ++c) sums[n][c] = 0;
        }
        // Values and slopes of the splines; the three values add up to one.
        REAL w[3][3], g[3][3];
#pragma unroll
        for (int d = 0; d < 3; ++d) {
            const REAL before = (REAL)1.5 - offset[d], after = offset[d] - (REAL)0.5;
            w[0][d] = (REAL)0.5 * before * before;
            w[2][d] = (REAL)0.5 * after * after;
            w[1][d] = 1 - (w[0][d] + w[2][d]);
            g[0][d] = -before;
            g[1][d] = 2 - 2 * offset[d];
            g[2][d] = after;
        }
"""
)
_END = """
    }
"""

# The sums of a node, relative to the frame of their cell.
_GIVE_MOMENTUM = """
    const REAL m = sums[n][3];
    const REAL a = sums[n][0] + m * frame[0], b = sums[n][1] + m * frame[1], c = sums[n][2] + m * frame[2];
#if defined(__CUDA_ARCH__) && SINGLE && __CUDA_ARCH__ >= 900
    asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
        :: "l"(__cvta_generic_to_global(node)), "f"(a), "f"(b), "f"(c), "f"(m) : "memory");
#elif defined(__CUDA_ARCH__)
    atomicAdd(node, a), atomicAdd(node + 1, b), atomicAdd(node + 2, c), atomicAdd(node + 3, m);
#else
    node[0] += a, node[1] += b, node[2] += c, node[3] += m;
#endif
"""

_GIVE_DILATION = """
#if defined(__CUDA_ARCH__)
    if (sums[n][1] != 0) atomicAdd(node, sums[n][0]), atomicAdd(node + 1, sums[n][1]);
#else
    node[0] += sums[n][0], node[1] += sums[n][1];
#endif
"""

# As `transfers.spread`.
_MOMENTUM = """
        const quad* const quads = (const quad*)row;
        REAL r[20];
#pragma unroll
        for (int k = 0; k < 5; ++k) {
            const quad q = quads[k];
#pragma unroll
            for (int c = 0; c < 4; ++c) r[4 * k + c] = q.v[c];
        }
        const REAL m = r[MASS], step = STRESS_TIME, fold = -step * FOLDED, pull = step * m * SHARED, extra = PRESSURE;
        const REAL xx = r[STRESS] + extra, yy = r[STRESS + 1] + extra, zz = r[STRESS + 2] + extra;
        const REAL xy = r[STRESS + 3], xz = r[STRESS + 4], yz = r[STRESS + 5];
        const REAL T[3][3] = {{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}};
        REAL A[3][3], u[3];
#pragma unroll
        for (int c = 0; c < 3; ++c) {
#pragma unroll
            for (int d = 0; d < 3; ++d) A[c][d] = r[AFFINE + 3 * c + d] + fold * T[c][d];
            u[c] = (r[VELOCITY + c] - frame[c]) - (A[c][0] * offset[0] + A[c][1] * offset[1] + A[c][2] * offset[2]);
        }
#pragma unroll
        for (int i = 0; i < 3; ++i)
#pragma unroll
            for (int j = 0; j < 3; ++j) {
                const REAL wij = w[i][0] * w[j][1], m_ij = m * wij;
                REAL still[3], along[3], pushed[3];
#pragma unroll
                for (int c = 0; c < 3; ++c) {
                    still[c] = m_ij * (u[c] + i * A[c][0] + j * A[c][1])
                        + pull * (g[i][0] * w[j][1] * T[c][0] + w[i][0] * g[j][1] * T[c][1]);
                    along[c] = m_ij * A[c][2];
                    pushed[c] = pull * wij * T[c][2];
                }
#pragma unroll
                for (int k = 0; k < 3; ++k) {
                    REAL* const sum = sums[9 * i + 3 * j + k];
#pragma unroll
                    for (int c = 0; c < 3; ++c)
                        sum[c] += w[k][2] * (still[c] + k * along[c]) + g[k][2] * pushed[c];
                    sum[3] += w[k][2] * m_ij;
                }
            }
"""

# As `transfers.scatter_dilation`.
_DILATION = """
        const double* const material =
            (const double*)s.materials.data + ((const int*)s.labels.data)[p * LABEL_WIDTH + MATERIAL] * MATERIAL_WIDTH;
        const REAL stiffness = (REAL)material[MEAN_STIFFNESS];
        const REAL volume = stiffness > 0 ? row[MASS] * (REAL)material[LIGHTNESS] : 0;
        const REAL dilation = stiffness * row[DILATION];
#pragma unroll
        for (int n = 0; n < 27; ++n) {
            const REAL part = (w[n / 9][0] * w[n / 3 % 3][1]) * (w[n % 3][2] * volume);
            sums[n][0] += part * dilation;
            sums[n][1] += part;
        }
"""


@cache
def make_runs(double: bool, averaged: bool) -> SimpleNamespace:
    """Functions give, give_carried and give_dilation (tables, begin, end): what points begin .. end give the nodes.

    With `averaged`, what a point gives has its mean pressure in it.
    """
    Tables = tables_of(wp.float64 if double else wp.float32)

    def code(body: str, given: str, **words: str) -> str:
        return worded(double, _BEGIN + body + _END, GIVE=given, SINGLE=str(int(not double)), **words)

    pressure = "row[MEAN_PRESSURE]" if averaged else "0"

    @wp.func_native(
        code(_MOMENTUM, _GIVE_MOMENTUM, WIDTH="4", NODES="grid", STRESS_TIME="(REAL)s.step", PRESSURE=pressure)
    )
    def give(s: Tables, begin: int, end: int):
        """Mass and momentum, with the step's stress."""

    @wp.func_native(code(_MOMENTUM, _GIVE_MOMENTUM, WIDTH="4", NODES="carried", STRESS_TIME="(REAL)0", PRESSURE="0"))
    def give_carried(s: Tables, begin: int, end: int):
        """What the points bring alone."""

    @wp.func_native(code(_DILATION, _GIVE_DILATION, WIDTH="2", NODES="means"))
    def give_dilation(s: Tables, begin: int, end: int):
        """Dilations times the root of the stiffness, weighed by volume, and volumes."""

    return SimpleNamespace(give=give, give_carried=give_carried, give_dilation=give_dilation)
