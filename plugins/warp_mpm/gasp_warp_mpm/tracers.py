# ruff: noqa: RUF046, UP018 - Warp tells a variable int(0) from a constant 0.
"""Massless points: they read a copy of the grid in which every node counts by the matter it stands for.

That copy, `carrier`, holds h v and h at each node (`gasp_core.engine.mpm.presence`); it is written with the grid, and
only where there are tracers.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp

from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import DRIFTED, Acting, tables_of
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["make_tracers"]

# A line of nodes along z is one vector; it has room for a fourth node, which is read and not used.
_SUM = """
    typedef REAL quad __attribute__((ext_vector_type(4), aligned(sizeof(REAL))));
    typedef REAL line __attribute__((ext_vector_type(16), aligned(sizeof(REAL))));
    const REAL* const nodes = (const REAL*)s.carrier.data + 4 * (long long)first;
    line sum = 0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            sum += (w.data[i][0] * w.data[j][1]) * *(const line*)(nodes + 4 * ((long long)i * sx + (long long)j * sy));
    const quad all = w.data[0][2] * __builtin_shufflevector(sum, sum, 0,1,2,3)
        + w.data[1][2] * __builtin_shufflevector(sum, sum, 4,5,6,7)
        + w.data[2][2] * __builtin_shufflevector(sum, sum, 8,9,10,11);
    wp::vec_t<4, REAL> found;
    *(quad*)&found = all;
    return found;
"""


@cache
def make_tracers(double: bool, averaged: bool, *, atomic: bool, native: bool) -> SimpleNamespace:
    """Function move_tracer; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, vec4, mat33 = types.vec3, types.vec4, types.mat33
    Tables = tables_of(real)
    weights = make_transfers(double, averaged, atomic=atomic, native=native).weights
    zero = real(0.0)
    half_cell, one_cell, two_cells = wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)

    @wp.func_native(_SUM.replace("REAL", "double" if double else "float"))
    def lines_around(s: Tables, first: int, sx: int, sy: int, w: mat33) -> vec4:
        """`sum_around`, a line of nodes at once."""

    @wp.func
    def sum_around(s: Tables, first: int, sx: int, sy: int, w: mat33):
        """sum w h v over the 27 nodes, and sum w h."""
        total = vec4()
        for i in range(3):
            for j in range(3):
                line = first + i * sx + j * sy
                part = w[0, 2] * s.carrier[line] + w[1, 2] * s.carrier[line + 1] + w[2, 2] * s.carrier[line + 2]
                total = total + (w[i, 0] * w[j, 1]) * part
        return total

    @wp.func
    def move_tracer(s: Tables, acting: Acting, p: int):
        """Carry one of the tracers that something can move."""
        place = s.tracers[p]
        bx = wp.floor(place[0] - half_cell)
        by = wp.floor(place[1] - half_cell)
        bz = wp.floor(place[2] - half_cell)
        w = weights(vec3(real(place[0] - bx), real(place[1] - by), real(place[2] - bz)))
        sy = s.shape[2]
        sx = s.shape[1] * sy
        first = (int(bx) - s.lower[0]) * sx + (int(by) - s.lower[1]) * sy + (int(bz) - s.lower[2])
        if native:
            total = lines_around(s, first, sx, sy, w)
        else:
            total = sum_around(s, first, sx, sy, w)
        if total[3] > zero:
            v = vec3(total[0], total[1], total[2]) / total[3]
            # One that nothing moves may stay outside the walls.
            if wp.dot(v, v) > zero:
                place = place + s.step * wp.vec3d(v)
                if acting.clamp == 1:
                    place = wp.min(wp.max(place, acting.wall_low), acting.wall_high)
                s.tracers[p] = place
                near = int(0)
                for d in range(3):
                    drift = place[d] - half_cell - wp.float64(s.tracer_homes[3 * p + d])
                    if drift >= -one_cell and drift < two_cells:
                        near += 1
                if near < 3:
                    s.report[DRIFTED] = 1

    return SimpleNamespace(move_tracer=move_tracer)
