# ruff: noqa: RUF046, SIM300, UP018 - Warp tells a variable int(0) from a constant 0.
"""What the next step depends on, looked up over all points in float64 whatever the precision of the rows."""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.session import CRUSHED_VOLUME
from gasp_warp_mpm.tables import stand_of, tables_of

__all__ = ["make_survey"]


@cache
def make_survey(double: bool, module: Any) -> SimpleNamespace:
    """Kernels survey, a row of the chart a thread, and condense, for charts of many rows; in Warp's module `module`."""
    real = wp.float64 if double else wp.float32
    Reals = wp.array(dtype=real)
    Tables = tables_of(real)
    Chart = wp.array(dtype=wp.float64)
    is_neo_hookean, is_fluid = at.KINDS["neo-hookean"], at.KINDS["fluid"]
    is_snow, first_hencky = at.KINDS["snow"], at.KINDS["metal"]
    crushed_volume = wp.float64(CRUSHED_VOLUME)
    zero, half, one, two, three = (wp.float64(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
    unit = wp.mat33d(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    least_square, least_gap = wp.float64(1e-200), wp.float64(1e-9)
    greatest_exponent, least_volume = wp.float64(200.0), wp.float64(1e-30)

    @wp.func
    def wide3(table: Reals, start: int):
        return wp.vec3d(wp.float64(table[start]), wp.float64(table[start + 1]), wp.float64(table[start + 2]))

    @wp.func
    def wide9(table: Reals, start: int):
        return wp.matrix_from_rows(wide3(table, start), wide3(table, start + 3), wide3(table, start + 6))

    @wp.func
    def finite(v: wp.vec3d, C: wp.mat33d, F: wp.mat33d, history: wp.float64, place: wp.vec3d):
        # x - x is 0 but for infinities and NaN, and a sum of zeros is 0 but for any NaN among them.
        residue = history - history
        for r in range(3):
            residue += (v[r] - v[r]) + (place[r] - place[r])
            for c in range(3):
                residue += (C[r, c] - C[r, c]) + (F[r, c] - F[r, c])
        return residue == zero

    @wp.func
    def stiffening(
        kind: int, F: wp.mat33d, J: wp.float64, history: wp.float64, hardening: wp.float64, viscous: wp.float64
    ):
        """`gasp_core.stepping.stiffening`, in its words.

        The stretch is bounded by the largest root of s^3 - |F|^2 s + 2 |J|.
        """
        size = wp.abs(J)
        scale = wp.sqrt(wp.max(wp.ddot(F, F) / three, least_square))
        angle = wp.acos(-wp.min(size / (scale * scale * scale), one)) / three
        longest = two * scale * wp.cos(angle)
        stretch = wp.max(wp.max(longest, size), one)
        factor = two * stretch * stretch - stretch
        if kind >= first_hencky:
            # `hencky_stiffening`: x coth x.
            apart = wp.max(three * wp.log(longest) - wp.log(wp.max(size, least_square)), least_gap)
            factor = apart / wp.tanh(apart)
        if kind == is_snow:
            # `snow_stiffening`.
            pressed = one - wp.exp(wp.min(history, one))
            factor *= wp.exp(wp.min(wp.max(hardening * pressed, zero), greatest_exponent))
        if kind == is_fluid:
            # `fluid_stiffening`; F = J^(1/3) I.
            volume = wp.max(one + history, least_volume)
            pressed = wp.max(one, one / (volume * volume * volume * volume))
            rate = (one - viscous) * pressed + viscous * volume
            factor = rate * rate
        return factor

    @wp.kernel(module=module, enable_backward=False)
    def survey(s: Tables, chart: Chart, first: int, size: int):
        """A row for every `size` points, from row `first`: maxima, extents, and what is not finite."""
        chunk = first + wp.tid()
        begin = chunk * size
        stiffness = wp.float64(0.0)
        speed = wp.float64(0.0)
        gradient = wp.float64(0.0)
        drift = wp.float64(0.0)
        bad = int(0)
        inverted = int(0)
        crushed = int(0)
        low = wp.vec3d(wp.float64(1e300))
        high = -low
        for p in range(begin, wp.min(begin + size, s.count)):
            o = p * at.POINT_WIDTH
            v = wide3(s.points, o + at.VELOCITY)
            C = wide9(s.points, o + at.AFFINE)
            F = wide9(s.points, o + at.DISPLACEMENT_GRADIENT) + unit
            history = wp.float64(s.points[o + at.HISTORY])
            place = s.x[p] - wp.vec3d(stand_of(s.stands, s.labels[p * at.LABEL_WIDTH + at.HOME] - s.lower[0]))
            if finite(v, C, F, history, place):
                row = s.labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
                kind = int(s.materials[row + at.KIND])
                J = wp.determinant(F)
                factor = stiffening(
                    kind, F, J, history, s.materials[row + at.HARDENING], s.materials[row + at.VISCOUS_SHARE]
                )
                if kind == is_fluid:
                    J = one + history
                stiffness = wp.max(stiffness, factor * s.materials[row + at.INVERSE_BOUND])
                speed = wp.max(speed, wp.dot(v, v))
                gradient = wp.max(gradient, wp.ddot(C, C))
                if J <= zero:
                    inverted += 1
                if kind <= is_neo_hookean and J <= crushed_volume:
                    crushed += 1
                for d in range(3):
                    beyond = s.x[p][d] - half - wp.float64(s.labels[p * at.LABEL_WIDTH + at.HOME + d])
                    drift = wp.max(drift, wp.max(-beyond, beyond - one))
                low = wp.min(low, place)
                high = wp.max(high, place)
            else:
                bad += 1
        o = chunk * at.SURVEY_WIDTH
        chart[o + at.SURVEY_STIFFNESS] = stiffness
        chart[o + at.SURVEY_SPEED] = speed
        chart[o + at.SURVEY_GRADIENT] = gradient
        chart[o + at.SURVEY_DRIFT] = drift
        chart[o + at.SURVEY_BAD] = wp.float64(bad)
        chart[o + at.SURVEY_INVERTED] = wp.float64(inverted)
        chart[o + at.SURVEY_CRUSHED] = wp.float64(crushed)
        for d in range(3):
            chart[o + at.SURVEY_LOW + d] = low[d]
            chart[o + at.SURVEY_HIGH + d] = high[d]

    @wp.kernel(module=module, enable_backward=False)
    def condense(s: Tables, rows: Chart, count: int, size: int, chart: Chart):
        """One row of every `size` of `count` rows."""
        begin = wp.tid() * size
        o = wp.tid() * at.SURVEY_WIDTH
        for c in range(at.SURVEY_WIDTH):
            found = rows[begin * at.SURVEY_WIDTH + c]
            for k in range(begin + 1, wp.min(begin + size, count)):
                other = rows[k * at.SURVEY_WIDTH + c]
                if c == at.SURVEY_BAD or c == at.SURVEY_INVERTED or c == at.SURVEY_CRUSHED:
                    found += other
                elif c >= at.SURVEY_LOW and c < at.SURVEY_HIGH:
                    found = wp.min(found, other)
                else:
                    found = wp.max(found, other)
            chart[o + c] = found

    return SimpleNamespace(survey=survey, condense=condense)
