# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""Massless points: they read a copy of the grid in which every node counts by the matter it stands for.

That copy, `carrier`, holds h v and h at each node (`gasp_core.stepping.mpm.presence`); it is written with the grid, and
only where there are tracers.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp

from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import DRIFTED, Acting, stand_of, tables_of
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["make_tracers"]

# What `carry_one` does. A line of nodes along z is one vector; it has room for a fourth node, which is read and not
# used.
_CARRY = """
    typedef REAL quad __attribute__((ext_vector_type(4), aligned(sizeof(REAL))));
    typedef REAL line __attribute__((ext_vector_type(16), aligned(sizeof(REAL))));
    typedef double place4 __attribute__((ext_vector_type(4)));
    typedef int cell4 __attribute__((ext_vector_type(4)));
    const cell4 grid_low = {s.lower[0], s.lower[1], s.lower[2], 0};
    const long long sy = 4 * (long long)s.shape[2], sx = sy * s.shape[1];
    bool away = false;
    for (long long p = begin; p < end; ++p) {
        double* const at = (double*)s.tracers.data + 3 * p;
        const int* const home = (const int*)s.tracer_homes.data + 3 * p;
        place4 place = {at[0], at[1], at[2], 0.5};
        const place4 base = __builtin_elementwise_floor(place - 0.5);
        const quad offset = __builtin_convertvector(place - base, quad);
        const cell4 cell = __builtin_convertvector(base, cell4) - grid_low;
        const quad before = (REAL)1.5 - offset, after = offset - (REAL)0.5;
        const quad low = (REAL)0.5 * before * before, high = (REAL)0.5 * after * after, middle = 1 - (low + high);
        const REAL* node = (const REAL*)s.carrier.data + sx * cell[0] + sy * cell[1] + 4 * (long long)cell[2];
        line sum = 0;
        for (int i = 0; i < 3; ++i, node += sx) {
            const line sheet = low[1] * *(const line*)node + middle[1] * *(const line*)(node + sy)
                + high[1] * *(const line*)(node + 2 * sy);
            sum += (i == 0 ? low : i == 1 ? middle : high)[0] * sheet;
        }
        const quad total = low[2] * __builtin_shufflevector(sum, sum, 0,1,2,3)
            + middle[2] * __builtin_shufflevector(sum, sum, 4,5,6,7)
            + high[2] * __builtin_shufflevector(sum, sum, 8,9,10,11);
        if (!(total[3] > 0) || (total[0] == 0 && total[1] == 0 && total[2] == 0)) continue;
        const quad velocity = total / total[3];
        place += s.step * __builtin_convertvector(velocity, place4);
        if (acting.clamp == 1)
            for (int d = 0; d < 3; ++d) {
                const int stand = ((const int*)s.stands.data)[3 * ((home[0] - s.lower[0]) >> 2) + d];
                if (place[d] < acting.wall_low[d] + stand) place[d] = acting.wall_low[d] + stand;
                if (place[d] > acting.wall_high[d] + stand) place[d] = acting.wall_high[d] + stand;
            }
        at[0] = place[0], at[1] = place[1], at[2] = place[2];
        // NaN fails either comparison.
        for (int d = 0; d < 3; ++d) {
            const double drift = place[d] - 0.5 - home[d];
            away |= !(drift >= -1.0 && drift < 2.0);
        }
    }
    if (away) ((int*)s.report.data)[DRIFTED] = 1;
"""


@cache
def make_tracers(double: bool, averaged: bool, *, native: bool) -> SimpleNamespace:
    """Functions carry_one (tables, acting, tracer) and carry_some (tables, acting, begin, end).

    Of those that something can move. Parameters as `make_kernels`.
    """
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, vec4 = types.vec3, types.vec4
    Tables = tables_of(real)
    weights = make_transfers(double, averaged, native=native).weights
    zero = real(0.0)
    half_cell, one_cell, two_cells = wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)

    @wp.func_native(_CARRY.replace("REAL", "double" if double else "float").replace("DRIFTED", str(DRIFTED)))
    def carry_in_lines(s: Tables, acting: Acting, begin: int, end: int):
        """`carry_one` of the tracers begin .. end."""

    @wp.func
    def carry_one(s: Tables, acting: Acting, p: int):
        """Move a tracer by sum w h v / sum w h over the 27 nodes around it."""
        place = s.tracers[p]
        bx = wp.floor(place[0] - half_cell)
        by = wp.floor(place[1] - half_cell)
        bz = wp.floor(place[2] - half_cell)
        w = weights(vec3(real(place[0] - bx), real(place[1] - by), real(place[2] - bz)))
        sy = s.shape[2]
        sx = s.shape[1] * sy
        first = (int(bx) - s.lower[0]) * sx + (int(by) - s.lower[1]) * sy + (int(bz) - s.lower[2])
        total = vec4()
        for i in range(3):
            for j in range(3):
                line = first + i * sx + j * sy
                part = w[0, 2] * s.carrier[line] + w[1, 2] * s.carrier[line + 1] + w[2, 2] * s.carrier[line + 2]
                total = total + (w[i, 0] * w[j, 1]) * part
        if total[3] > zero:
            v = vec3(total[0], total[1], total[2]) / total[3]
            # One that nothing moves may stay outside the walls.
            if v[0] != zero or v[1] != zero or v[2] != zero:
                place = place + s.step * wp.vec3d(v)
                if acting.clamp == 1:
                    stand = wp.vec3d(stand_of(s.stands, s.tracer_homes[3 * p] - s.lower[0]))
                    place = wp.min(wp.max(place, acting.wall_low + stand), acting.wall_high + stand)
                s.tracers[p] = place
                near = int(0)
                for d in range(3):
                    drift = place[d] - half_cell - wp.float64(s.tracer_homes[3 * p + d])
                    if drift >= -one_cell and drift < two_cells:
                        near += 1
                if near < 3:
                    s.report[DRIFTED] = 1

    @wp.func
    def carry_some(s: Tables, acting: Acting, begin: int, end: int):
        if native:
            carry_in_lines(s, acting, begin, end)
        else:
            for p in range(begin, end):
                carry_one(s, acting, p)

    return SimpleNamespace(carry_one=carry_one, carry_some=carry_some)
