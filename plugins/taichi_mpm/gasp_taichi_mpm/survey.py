"""Looking at every point: what the next step depends on, and what is no longer credible."""

from collections.abc import Callable
from typing import Any

from gasp_mpm_host import layout as at

from gasp_core.stepping.session import CRUSHED_VOLUME
from gasp_taichi_mpm import words
from gasp_taichi_mpm.nodes import stand_of
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.transfers import columns

__all__ = ["make_survey"]


def make_boundless(real: Any) -> Callable[..., Any]:
    """Taichi function: whether a `real` number is infinite or none at all: whether its exponent has all its bits set.

    Comparisons would be compiled away, because the compiler is told that there are no such numbers.
    """
    bits, below, ones = (ti.i64, 52, 2**11 - 1) if real == ti.f64 else (ti.i32, 23, 2**8 - 1)

    @ti.func
    def boundless(number):
        return ((ti.bit_cast(number, bits) >> below) & ones) == ones

    return boundless


def make_survey(real: Any, Positions: Any, Points: Any, Ints: Any, Doubles: Any) -> Callable[..., None]:
    """The kernel, for points of `real` numbers and arrays of these types."""
    boundless, boundless_place = make_boundless(real), make_boundless(ti.f64)
    gradients = (words.AFFINE, words.DISPLACEMENT_GRADIENT)
    watched = [words.VELOCITY, *(first + c for first in gradients for c in range(3))]

    @ti.kernel
    def survey(
        x: Positions, points: Points, labels: Ints, materials: Doubles, control: Ints, met: Ints, result: Doubles
    ):
        """What the next step depends on, a row per chunk of points: maxima, extents, and what is not finite."""
        ti.loop_config(block_dim=1)
        for chunk in range((control[words.POINTS] + at.SURVEY_CHUNK - 1) // at.SURVEY_CHUNK):
            stiffness, speed, gradient = ti.f64(0.0), ti.f64(0.0), ti.f64(0.0)
            drift = ti.f64(0.0)
            bad, inverted, crushed = 0, 0, 0
            begin = chunk * at.SURVEY_CHUNK
            low = ti.Vector([ti.f64(1e300), ti.f64(1e300), ti.f64(1e300)])
            high = -low
            for p in range(begin, ti.min(begin + at.SURVEY_CHUNK, control[words.POINTS])):
                r = p * words.POINT_ROWS
                speeds = ti.cast(points[r + words.VELOCITY], ti.f64)
                v = ti.Vector([speeds[0], speeds[1], speeds[2]])
                C = ti.cast(columns(points, r + words.AFFINE), ti.f64)
                F = ti.cast(columns(points, r + words.DISPLACEMENT_GRADIENT), ti.f64) + ti.Matrix.identity(ti.f64, 3)
                history = ti.cast(points[r + words.HISTORY][3], ti.f64)
                home = labels[p * at.LABEL_WIDTH + at.HOME]
                place = x[p] - ti.cast(stand_of(met, control, home - control[words.LOWER]), ti.f64)
                lost = boundless(points[r + words.HISTORY][3])
                for d in ti.static(range(3)):
                    lost = lost or boundless_place(place[d])
                    for row in ti.static(watched):
                        lost = lost or boundless(points[r + row][d])
                if lost:
                    bad += 1
                else:
                    row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
                    J = F.determinant()
                    # `stepping.stiffening` of the core, in its words: the largest root of s^3 - |F|^2 s + 2 |J|.
                    scale = ti.sqrt(ti.max(F.norm_sqr() / 3.0, ti.f64(1e-200)))
                    angle = ti.acos(-ti.min(ti.abs(J) / (scale * scale * scale), ti.f64(1.0))) / 3.0
                    longest = 2.0 * scale * ti.cos(angle)
                    stretch = ti.max(longest, ti.abs(J), ti.f64(1.0))
                    factor = 2.0 * stretch * stretch - stretch
                    kind = ti.cast(materials[row + at.KIND], ti.i32)
                    if kind >= ti.static(at.KINDS["metal"]):
                        # `hencky_stiffening`: x coth x.
                        apart = 3.0 * ti.log(longest) - ti.log(ti.max(ti.abs(J), ti.f64(1e-200)))
                        apart = ti.max(apart, ti.f64(1e-9))
                        factor = apart / ti.tanh(apart)
                    if kind == ti.static(at.KINDS["snow"]):
                        # `snow_stiffening`.
                        pressed = 1.0 - ti.exp(ti.min(history, ti.f64(1.0)))
                        grown = ti.max(materials[row + at.HARDENING] * pressed, ti.f64(0.0))
                        factor *= ti.exp(ti.min(grown, ti.f64(200.0)))
                    if kind == ti.static(at.KINDS["fluid"]):
                        # `fluid_stiffening`; F = J^(1/3) I.
                        J = 1.0 + history
                        volume = ti.max(J, ti.f64(1e-30))
                        pressed = ti.max(ti.f64(1.0), 1.0 / (volume * volume * volume * volume))
                        viscous = materials[row + at.VISCOUS_SHARE]
                        factor = ((1.0 - viscous) * pressed + viscous * volume) ** 2
                    stiffness = ti.max(stiffness, factor * materials[row + at.INVERSE_BOUND])
                    speed = ti.max(speed, v.norm_sqr())
                    gradient = ti.max(gradient, C.norm_sqr())
                    if J <= 0:
                        inverted += 1
                    if kind <= ti.static(at.KINDS["neo-hookean"]) and ti.f64(CRUSHED_VOLUME) >= J:
                        crushed += 1
                    for d in ti.static(range(3)):
                        beyond = x[p][d] - 0.5 - labels[p * at.LABEL_WIDTH + at.HOME + d]
                        drift = ti.max(drift, -beyond, beyond - 1.0)
                    low = ti.min(low, place)
                    high = ti.max(high, place)
            o = chunk * at.SURVEY_WIDTH
            result[o + at.SURVEY_STIFFNESS] = stiffness
            result[o + at.SURVEY_SPEED] = speed
            result[o + at.SURVEY_GRADIENT] = gradient
            result[o + at.SURVEY_DRIFT] = drift
            result[o + at.SURVEY_BAD] = bad
            result[o + at.SURVEY_INVERTED] = inverted
            result[o + at.SURVEY_CRUSHED] = crushed
            for d in ti.static(range(3)):
                result[o + at.SURVEY_LOW + d] = low[d]
                result[o + at.SURVEY_HIGH + d] = high[d]

    return survey
