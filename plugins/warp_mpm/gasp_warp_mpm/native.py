"""The transfers in native code, for the CPU: a line of three nodes along z is one vector of lanes.

What they compute is what `transfers` computes in readable form; the sums are the same but for their order. Points of a
tile spread their momentum relative to that of one of them: what moves as one then keeps its velocity to the last bit
but one, and where float32 rounds, it rounds differences.

A node has four lanes: three of momentum (or velocity), one of mass. Matrices come as columns, because a column times a
number is what a node gets.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp

from gasp_warp_mpm.native_words import constants, worded
from gasp_warp_mpm.tables import CLAMPED, DRIFTED, Acting, tables_of

__all__ = ["GROUP", "make_native"]

GROUP = 8
"""Points whose stress is computed at once, a lane each."""

_NAMES = (
    *("VELOCITY", "AFFINE", "MASS", "STRESS", "HISTORY", "DISPLACEMENT_GRADIENT", "MEAN_PRESSURE", "POINT_WIDTH"),
    *("HOME", "LABEL_WIDTH", "SHEAR", "LAME", "VISCOSITY", "BULK_VISCOSITY", "MASS_DAMPING", "STIFFNESS_DAMPING"),
)

_PRELUDE = (
    constants(*_NAMES, CLAMPED=CLAMPED, DRIFTED=DRIFTED, GROUP=GROUP)
    + """
    #define FOUR(x, k) __builtin_shufflevector(x, x, 4*k, 4*k+1, 4*k+2, 4*k+3)
    typedef REAL quad __attribute__((ext_vector_type(4), aligned(sizeof(REAL))));
    typedef REAL line __attribute__((ext_vector_type(16), aligned(sizeof(REAL))));
    typedef double place4 __attribute__((ext_vector_type(4)));
    typedef int cell4 __attribute__((ext_vector_type(4)));
    typedef long long index;
    #define THRICE(a) __builtin_shufflevector(a, a, 0,1,2,3, 0,1,2,3, 0,1,2,3, 0,1,2,3)
    // The row of a point that is some way ahead: rows come in their order, but not from the nearest memory.
    #define FETCH(row) \\
        for (int byte = 0; byte < POINT_WIDTH * sizeof(REAL); byte += 64) \\
            __builtin_prefetch((const char*)((row) + 16 * POINT_WIDTH) + byte);
    #define ALONG(a, b, c) (line){a,a,a,a, b,b,b,b, c,c,c,c, 0,0,0,0}
"""
)

# Of point p: its place, its offset in the base cell, the cell, counted from the grid's first node; the splines' values
# at the three nodes along each axis and their slopes. The three values add up to one whatever rounding does.
_STENCIL = """
        const double* const at = (const double*)s.x.data + 3 * (index)p;
        const place4 place = {at[0], at[1], at[2], 0.5};
        const place4 base = __builtin_elementwise_floor(place - 0.5);
        const quad offset = __builtin_convertvector(place - base, quad);
        const cell4 cell = __builtin_convertvector(base, cell4) - grid_low;
        const quad before = (REAL)1.5 - offset, after = offset - (REAL)0.5;
        const quad low = (REAL)0.5 * before * before, high = (REAL)0.5 * after * after, middle = 1 - (low + high);
        const quad slope = 2 - 2 * offset;
"""

_GRID = """
    const cell4 grid_low = {s.lower[0], s.lower[1], s.lower[2], 0};
    const index sy = 4 * (index)s.shape[2], sx = sy * s.shape[1];
    REAL* const nodes = (REAL*)s.NODES.data;
"""

# Points of a tile drift by one cell at most: with the stencil, nodes -1 .. 6 of its block.
_SPREAD = """
    enum { SIDE = 8, ROW = 4 * SIDE, SLAB = ROW * SIDE };
    const REAL* const points = (const REAL*)s.points.data;
    const index first = begin;
    const int* const home = (const int*)s.labels.data + first * LABEL_WIDTH + HOME;
    const cell4 corner = (((cell4){home[0], home[1], home[2], 0} - grid_low) & ~3) - (cell4){1, 1, 1, 0};
    const REAL* const one = points + first * POINT_WIDTH + VELOCITY;
    const quad shared = {one[0], one[1], one[2], 0};
    // One node more than the tile has, because a line has room for four.
    REAL tile[SIDE * SLAB + 4] __attribute__((aligned(64))) = {0};
    cell4 lowest = {SIDE, SIDE, SIDE, 0}, highest = {0, 0, 0, 0};
    const REAL step = STRESS_TIME;
    #define COLUMN(a, b, c) __builtin_shufflevector(given, given, a,b,c,9, a,b,c,9, a,b,c,9, 9,9,9,9)
    for (int p = begin; p < end; ++p) {
        STENCIL
        const cell4 inside = cell - corner;
        lowest = __builtin_elementwise_min(lowest, inside);
        highest = __builtin_elementwise_max(highest, inside);
        const REAL* const point = points + (index)p * POINT_WIDTH;
        FETCH(point)
        // C, the mass and the stress lie side by side; the mass makes room for the nought of a column's fourth lane.
        line given = *(const line*)(point + AFFINE) PRESSURE;
        given[MASS - AFFINE] = 0;
        const REAL m = point[MASS], fold = -step * FOLDED, pull = step * m * SHARED;
        const line tx = COLUMN(10, 13, 14), ty = COLUMN(13, 11, 15), tz = COLUMN(14, 15, 12);
        const line ax = COLUMN(0, 3, 6) + fold * tx, ay = COLUMN(1, 4, 7) + fold * ty, az = COLUMN(2, 5, 8) + fold * tz;
        const quad way = 1 - offset;
        quad own = *(const quad*)(point + VELOCITY) - shared;
        own[3] = 1;
        const line u = THRICE(own) + way[0] * ax + way[1] * ay + way[2] * az;
        const line W = ALONG(low[2], middle[2], high[2]), D = ALONG(-before[2], slope[2], after[2]);
        const line mW = m * W, mK = mW * ALONG(-1, 0, 1);
        const line pW = pull * W, pD = pull * D;
        const line still = mW * u + mK * az + pD * tz;
        const line alongx = mW * ax, alongy = mW * ay, px = pW * tx, py = pW * ty;
        const line q0 = -before[1] * py - low[1] * alongy, q1 = slope[1] * py, q2 = after[1] * py + high[1] * alongy;
        REAL* const node = tile + SLAB * inside[0] + ROW * inside[1] + 4 * inside[2];
        #define GIVE(i, j, q, wx, wy) { \\
            line* const here = (line*)(node + SLAB * i + ROW * j); \\
            *here = (*here + wx * q) + wy * b; }
        #define SHEET(i, w, sheet) { const line b = sheet; \\
            GIVE(i, 0, q0, w, low[1]) GIVE(i, 1, q1, w, middle[1]) GIVE(i, 2, q2, w, high[1]) }
        SHEET(0, low[0], low[0] * (still - alongx) - before[0] * px)
        SHEET(1, middle[0], middle[0] * still + slope[0] * px)
        SHEET(2, high[0], high[0] * (still + alongx) + after[0] * px)
        #undef SHEET
        #undef GIVE
    }
    for (int i = lowest[0]; i < highest[0] + 3; ++i)
        for (int j = lowest[1]; j < highest[1] + 3; ++j) {
            const REAL* const from = tile + SLAB * i + ROW * j;
            REAL* const to = nodes + sx * (corner[0] + i) + sy * (corner[1] + j) + 4 * (index)corner[2];
            for (int k = 4 * lowest[2]; k < 4 * (highest[2] + 3); k += 4) {
                const quad sum = *(const quad*)(from + k);
                *(quad*)(to + k) = *(quad*)(to + k) + (sum + sum[3] * shared);
            }
        }
    #undef COLUMN
"""

# Sums over the 27 nodes: v; the columns of C = 4 sum w v r^T and of L, which has the share of the slopes in it.
# Along an axis the factors of C and of L add up to zero, so that two differences are all they need; and everything is
# relative to the middle node: what moves as one does not change its velocity, in whatever precision.
_COLLECT = """
        const quad clow = -4 * offset * low, chigh = 4 * (2 - offset) * high;
        const quad llow = FOLDED * clow - SHARE * before, lhigh = FOLDED * chigh + SHARE * after;
        const REAL* const node = nodes + sx * cell[0] + sy * cell[1] + 4 * (index)cell[2];
        const quad centre = *(const quad*)(node + sx + sy + 4);
        const line still = THRICE(centre);
        line value[3], ya = 0, yb = 0;
        for (int i = 0; i < 3; ++i) {
            // A line has room for four nodes; the fourth is read and not used.
            const line mid = *(const line*)(node + sx * i + sy);
            const line a = *(const line*)(node + sx * i) - mid, b = *(const line*)(node + sx * i + 2 * sy) - mid;
            const REAL w = (i == 0 ? low : i == 1 ? middle : high)[0];
            value[i] = (mid - still) + low[1] * a + high[1] * b;
            ya += w * a;
            yb += w * b;
        }
        const line xa = value[0] - value[1], xb = value[2] - value[1];
        const line velocity = value[1] + low[0] * xa + high[0] * xb;
        #define OVER(x) (low[2] * FOUR(x, 0) + middle[2] * FOUR(x, 1) + high[2] * FOUR(x, 2))
        const quad sxa = OVER(xa), sxb = OVER(xb), sya = OVER(ya), syb = OVER(yb);
        const quad m = FOUR(velocity, 1), za = FOUR(velocity, 0) - m, zb = FOUR(velocity, 2) - m;
        const quad cx = clow[0] * sxa + chigh[0] * sxb, lx = llow[0] * sxa + lhigh[0] * sxb;
        const quad cy = clow[1] * sya + chigh[1] * syb, ly = llow[1] * sya + lhigh[1] * syb;
        const quad cz = clow[2] * za + chigh[2] * zb, lz = llow[2] * za + lhigh[2] * zb;
        quad v = centre + (m + low[2] * za + high[2] * zb);
        #undef OVER
"""

_MOVE = """
    typedef REAL lanes __attribute__((ext_vector_type(GROUP), aligned(sizeof(REAL))));
    typedef decltype((lanes)(REAL)0 < (lanes)(REAL)0) flags;
    typedef decltype((place4)0.0 < (place4)0.0) flag4;
    REAL flow[GROUP][12];
    REAL* const points = (REAL*)s.points.data + (index)begin * POINT_WIDTH;
    const int* const labels = (const int*)s.labels.data + (index)begin * LABEL_WIDTH;
    flag4 near = (flag4)-1;
    const double* const material = (const double*)s.materials.data + row;
    const line kept = (REAL)(1 / (1 + material[MASS_DAMPING] * s.step));
    for (int l = 0; l < GROUP; ++l) {
        const int p = begin + l;
        const int* const home = labels + l * LABEL_WIDTH + HOME;
        STENCIL
        COLLECT
        *(quad*)(flow[l]) = lx;
        *(quad*)(flow[l] + 4) = ly;
        *(quad*)(flow[l] + 8) = lz;
        place4 to = place + s.step * __builtin_convertvector(v, place4);
        if (acting.clamp == 1)
            for (int d = 0; d < 3; ++d) {
                const int stand = ((const int*)s.stands.data)[3 * ((home[0] - s.lower[0]) >> 2) + d];
                const double wall_low = acting.wall_low[d] + stand, wall_high = acting.wall_high[d] + stand;
                const bool under = to[d] < wall_low, above = to[d] > wall_high;
                if (under) to[d] = wall_low;
                if (above) to[d] = wall_high;
                if ((under && v[d] < 0) || (above && v[d] > 0)) v[d] = 0;
                if (under || above) ((int*)s.report.data)[CLAMPED] = 1;
            }
        double* const x = (double*)s.x.data + 3 * (index)p;
        x[0] = to[0], x[1] = to[1], x[2] = to[2];
        // Lane 3 is 1/2 and stays so: no velocity is in it. NaN fails either comparison.
        const place4 drift = to - 0.5 - __builtin_convertvector(((cell4){home[0], home[1], home[2], 0}), place4);
        near &= (drift >= -1.0) & (drift < 2.0);
        // v, then the rows of C, without gaps.
        const line all = kept * __builtin_shufflevector(
            __builtin_shufflevector(v, cx, 0,1,2,3,4,5,6,7), __builtin_shufflevector(cy, cz, 0,1,2,3,4,5,6,7),
            0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15);
        REAL* const row = points + l * POINT_WIDTH + VELOCITY;
        FETCH(row)
        *(lanes*)row = __builtin_shufflevector(all, all, 0,1,2, 4,8,12, 5,9);
        *(quad*)(row + 8) = __builtin_shufflevector(all, all, 13, 6,10,14);
    }
    if (!(near[0] & near[1] & near[2] & near[3])) ((int*)s.report.data)[DRIFTED] = 1;

    // From here on a lane is a point.
    #define MIX __builtin_shufflevector
    auto read = [](const REAL* from, index stride, lanes* columns) {
        lanes r[4];
        for (int k = 0; k < 4; ++k)
            r[k] = MIX(*(const quad*)(from + k * stride), *(const quad*)(from + (k + 4) * stride), 0,1,2,3,4,5,6,7);
        const lanes a = MIX(r[0], r[1], 0,8,1,9, 4,12,5,13), b = MIX(r[2], r[3], 0,8,1,9, 4,12,5,13);
        const lanes c = MIX(r[0], r[1], 2,10,3,11, 6,14,7,15), d = MIX(r[2], r[3], 2,10,3,11, 6,14,7,15);
        columns[0] = MIX(a, b, 0,1,8,9, 4,5,12,13), columns[1] = MIX(a, b, 2,3,10,11, 6,7,14,15);
        columns[2] = MIX(c, d, 0,1,8,9, 4,5,12,13), columns[3] = MIX(c, d, 2,3,10,11, 6,7,14,15);
    };
    auto write = [](lanes p, lanes q, lanes r, lanes s, REAL* to) {
        const lanes a = MIX(p, q, 0,8,1,9, 4,12,5,13), b = MIX(r, s, 0,8,1,9, 4,12,5,13);
        const lanes c = MIX(p, q, 2,10,3,11, 6,14,7,15), d = MIX(r, s, 2,10,3,11, 6,14,7,15);
        const lanes rows[4] = {MIX(a, b, 0,1,8,9, 4,5,12,13), MIX(a, b, 2,3,10,11, 6,7,14,15),
                               MIX(c, d, 0,1,8,9, 4,5,12,13), MIX(c, d, 2,3,10,11, 6,7,14,15)};
        for (int k = 0; k < 4; ++k) {
            *(quad*)(to + k * POINT_WIDTH) = MIX(rows[k], rows[k], 0,1,2,3);
            *(quad*)(to + (k + 4) * POINT_WIDTH) = MIX(rows[k], rows[k], 4,5,6,7);
        }
    };
    auto cofactors = [](const lanes* a, lanes* k) {
        k[0] = a[4] * a[8] - a[5] * a[7], k[1] = a[5] * a[6] - a[3] * a[8], k[2] = a[3] * a[7] - a[4] * a[6];
        k[3] = a[2] * a[7] - a[1] * a[8], k[4] = a[0] * a[8] - a[2] * a[6], k[5] = a[1] * a[6] - a[0] * a[7];
        k[6] = a[1] * a[5] - a[2] * a[4], k[7] = a[2] * a[3] - a[0] * a[5], k[8] = a[0] * a[4] - a[1] * a[3];
    };
    lanes F[9], L[12], G[9], K[9], H, tail;
    read(points + DISPLACEMENT_GRADIENT, POINT_WIDTH, F);
    read(points + DISPLACEMENT_GRADIENT + 4, POINT_WIDTH, F + 4);
    for (int l = 0; l < GROUP; ++l) {
        F[8][l] = points[l * POINT_WIDTH + DISPLACEMENT_GRADIENT + 8];
        H[l] = points[l * POINT_WIDTH + HISTORY];
    }
    read(flow[0], 12, L);
    read(flow[0] + 4, 12, L + 4);
    read(flow[0] + 8, 12, L + 8);
    const REAL step = (REAL)s.step;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            G[3*r + c] = F[3*r + c] + step * (L[4*c + r] + (L[r] * F[c] + L[4 + r] * F[3 + c] + L[8 + r] * F[6 + c]));
    write(G[0], G[1], G[2], G[3], points + DISPLACEMENT_GRADIENT);
    write(G[4], G[5], G[6], G[7], points + DISPLACEMENT_GRADIENT + 4);
    for (int l = 0; l < GROUP; ++l) points[l * POINT_WIDTH + DISPLACEMENT_GRADIENT + 8] = G[8][l];
    // So far F and G were without the unit matrix.
    G[0] += 1, G[4] += 1, G[8] += 1;
    const REAL mu = (REAL)material[SHEAR], lame = (REAL)material[LAME];
    cofactors(G, K);
    const lanes J = G[0] * K[0] + G[1] * K[1] + G[2] * K[2];
    lanes part[9], diagonal, dilation, growth;
    flags settled = (flags)-1;
    RESPOND
    // Kelvin's and Voigt's damping, nought where there is none; and what stops shocks.
    const REAL eta = (REAL)material[VISCOSITY];
    const lanes spread = L[0] + L[5] + L[10], pressing = __builtin_elementwise_max(-spread, (lanes)(REAL)0);
    dilation += (REAL)material[STIFFNESS_DAMPING] * growth * spread;
    diagonal += (REAL)material[BULK_VISCOSITY] * spread
        - pressing * __builtin_elementwise_min(SHOCK * pressing, (lanes)(1 / (3 * step)));
    #define ENTRY(r, c) (part[3*r] * G[3*c] + part[3*r+1] * G[3*c+1] + part[3*r+2] * G[3*c+2] \
        + eta * (L[r + 4*c] + L[c + 4*r]))
    write(ENTRY(0, 0) + diagonal, ENTRY(1, 1) + diagonal, ENTRY(2, 2) + diagonal, ENTRY(0, 1), points + STRESS);
    write(ENTRY(0, 2), ENTRY(1, 2), dilation, H, points + STRESS + 4);
    #undef ENTRY
    wp::int32 left = 0;
    for (int l = 0; l < GROUP; ++l) left |= settled[l] ? 0 : 1 << l;
    #undef MIX
"""

# 2 mu (F - R) F^T + lambda J (J - 1) I. R by Newton's iteration, as `decompositions.rotation_of`, until it has
# converged in every lane where F is well away from singular; the other lanes are left to that function.
_ELASTIC = """
    lanes R[9];
    lanes size = 0;
    for (int c = 0; c < 9; ++c) {
        size += G[c] * G[c];
        R[c] = (REAL)0.5 * (G[c] + K[c] / J);
    }
    size = size / 3;
    const flags shaped = (J > 0) & (size * size * size * (REAL)WELL_SHAPED < J * J);
    for (int count = 0; count < 20; ++count) {
        cofactors(R, K);
        const lanes half = (REAL)0.5 / (R[0] * K[0] + R[1] * K[1] + R[2] * K[2]);
        lanes moved = 0;
        for (int c = 0; c < 9; ++c) {
            const lanes next = (REAL)0.5 * R[c] + half * K[c], change = next - R[c];
            moved += change * change;
            R[c] = next;
        }
        settled = moved <= (REAL)CONVERGED;
        if (__builtin_reduce_and(settled | ~shaped)) break;
    }
    settled &= shaped;
    for (int c = 0; c < 9; ++c) part[c] = (2 * mu) * (G[c] - R[c]);
    dilation = J - 1, growth = J;
    diagonal = lame * J * dilation;
"""

# mu (F F^T - I) + lambda ln(max(J, 0.05)) I. The logarithm is that of the mantissa, brought to 1/sqrt(2) .. sqrt(2), as
# 2 artanh((m - 1) / (m + 1)), whose series has terms until they are below rounding, plus exponent times ln 2 in two
# parts, of which the first has zeros to spare.
_NEO_HOOKEAN = """
    const lanes volume = __builtin_elementwise_max(J, (lanes)(REAL)SMALLEST_VOLUME);
    const flags bits = (flags)volume;
    flags exponent = (bits >> DIGITS) - BIAS;
    lanes mantissa = (lanes)((bits & (((flags)1 << DIGITS) - 1)) | ((flags)BIAS << DIGITS));
    const flags large = mantissa > (REAL)1.4142135623730951;
    mantissa = large ? (REAL)0.5 * mantissa : mantissa;
    exponent -= large;
    const lanes t = (mantissa - 1) / (mantissa + 1), tt = t * t;
    lanes series = (REAL)1 / (2 * TERMS - 1);
    for (int n = TERMS - 2; n >= 0; --n) series = (REAL)1 / (2 * n + 1) + tt * series;
    const lanes powers = __builtin_convertvector(exponent, lanes);
    dilation = powers * (REAL)LN2_HIGH + (2 * t * series + powers * (REAL)LN2_LOW), growth = (lanes)(REAL)1;
    for (int c = 0; c < 9; ++c) part[c] = mu * G[c];
    diagonal = lame * dilation - mu;
"""

_END = """
    #undef THRICE
    #undef ALONG
    #undef FOUR
    #undef FETCH
"""

_FOUND = """
    wp::mat_t<7, 4, REAL> found;
    const quad all[7] = {v, cx, cy, cz, lx, ly, lz};
    for (int r = 0; r < 7; ++r) *(quad*)found.data[r] = all[r];
    return found;
"""

_LEFT = """
    return left;
"""


def _code(double: bool, *parts: str, **words: str) -> str:
    """A function's body."""
    return worded(double, _PRELUDE + "".join(parts), STENCIL=_STENCIL, COLLECT=_COLLECT, **words)


@cache
def make_native(double: bool, averaged: bool) -> SimpleNamespace:
    """The functions spread, collect, move_elastic and move_neo_hookean for one precision; spread_carried and
    collect_carried, which do the same with the grid before anything acts on it.

    With `averaged`, what a point spreads has its mean pressure in it.
    """
    real = wp.float64 if double else wp.float32
    Tables = tables_of(real)
    mat74 = wp.types.matrix((7, 4), real)
    pressure = "point[MEAN_PRESSURE]"
    added = f"+ (line){{0,0,0,0, 0,0,0,0, 0,0, {pressure}, {pressure}, {pressure}, 0,0,0}}" if averaged else ""

    acted = {"NODES": "grid", "STRESS_TIME": "(REAL)s.step"}
    carried = {"NODES": "carried", "STRESS_TIME": "0"}

    @wp.func_native(_code(double, _GRID, _SPREAD, _END, PRESSURE=added, **acted))
    def spread(s: Tables, begin: int, end: int):
        """Mass and momentum of a tile's points to the nodes around them."""

    @wp.func_native(_code(double, _GRID, _SPREAD, _END, PRESSURE="", **carried))
    def spread_carried(s: Tables, begin: int, end: int):
        """As `spread`, without what stress gives."""

    @wp.func_native(_code(double, _GRID, _STENCIL, _COLLECT, _END, _FOUND, **acted))
    def collect(s: Tables, p: int) -> mat74:
        """At a point, rows: v, the columns of C, those of the velocity gradient."""

    @wp.func_native(_code(double, _GRID, _STENCIL, _COLLECT, _END, _FOUND, **carried))
    def collect_carried(s: Tables, p: int) -> mat74:
        """As `collect`, of what the points brought."""

    @wp.func_native(_code(double, _GRID, _MOVE, _END, _LEFT, RESPOND=_ELASTIC, **acted))
    def move_elastic(s: Tables, acting: Acting, begin: int, row: int) -> int:
        """Move a group of points of the fixed-corotated material at `row`; bits of those whose stress is left to do."""

    @wp.func_native(_code(double, _GRID, _MOVE, _END, _LEFT, RESPOND=_NEO_HOOKEAN, **acted))
    def move_neo_hookean(s: Tables, acting: Acting, begin: int, row: int) -> int:
        """Move a group of points of the neo-Hookean material at `row`; bits of those whose stress is left to do."""

    return SimpleNamespace(
        spread=spread,
        spread_carried=spread_carried,
        collect=collect,
        collect_carried=collect_carried,
        move_elastic=move_elastic,
        move_neo_hookean=move_neo_hookean,
    )
