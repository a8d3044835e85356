# pyright: basic
# numba's decorators carry no types.
"""The picture, tile by tile: every Gaussian of a tile's list, front to back, over the rows of pixels it touches.

What makes it fast: a row of 16 pixels is two vector registers, its sums lie next to each other in memory, and the whole
tile stays in the nearest cache; rows that an ellipse misses, or that nothing shines through any more, are skipped.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from gasp_core.rendering.contract import ALPHA_FLOOR, ALPHA_LIMIT
from gasp_renderer.inputs import FARTHEST
from gasp_renderer.projection import (
    ACROSS,
    BLUE,
    BOTTOM,
    DEPTH,
    DOWN,
    GREEN,
    HALF,
    M0,
    M1,
    M2,
    OFFSET_X,
    OFFSET_Y,
    RED,
    SLANT,
    STRENGTH,
    TILE,
    TOP,
    W00,
    W10,
    W11,
    W20,
    W21,
    W22,
)

__all__ = ["OPAQUE", "blend"]

OPAQUE = np.float32(1e-4)
"""Light that still comes through where what lies behind is left out."""

_ONE, _HALF, _ZERO = np.float32(1), np.float32(0.5), np.float32(0)
_FLOOR, _LIMIT = np.float32(math.log2(ALPHA_FLOOR)), np.float32(math.log2(ALPHA_LIMIT))
_PATIENCE = 32
"""Gaussians between two looks at which rows are opaque; a look costs about as much as one Gaussian."""
_NOWHERE = np.float32(FARTHEST)
"""Depth of a wall that is not there: infinite ones are no numbers to what is computed in lanes."""
_STRIPS = 127
"""Sets of tiles that threads share out: each takes every 127th. Prime, so that no set is a column of the picture, where
all the work might be."""

# Sums of one row of a tile, 16 pixels each.
_LIGHT, _RED, _GREEN, _BLUE, _DEPTH, _ROW = 0, TILE, 2 * TILE, 3 * TILE, 4 * TILE, 5 * TILE

# 2^f for f in 0..1, relative error 2.6e-6: the polynomial of degree 4 of least largest relative error.
_EXP2 = tuple(np.float32(c) for c in (1.00000259, 0.69300383, 0.24144276, 0.05201146, 0.01353417))

# log2 m / (m - 1) for m in 1..2, absolute error of log2 m 1.5e-5.
_LOG2 = tuple(np.float32(c) for c in (2.81186956, -2.31917876, 1.28469099, -0.38179977, 0.04638353))
# log2 of Phi(d) / Phi(-d), an odd function, for d in -5..5, error of Phi 7e-6.
_PHI = tuple(np.float32(c) for c in (2.30202379, 0.10544841, -5.5951053e-4, -3.9692175e-5))
_SURE = np.float32(5)
"""Deviations beyond which Phi is 0 or 1 to 3e-7."""

# Only finite numbers get here, and a sum of sixteen lanes may be taken in any order.
_lanewise = numba.njit(
    cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc", "afn"}
)
_function = numba.njit(cache=True, error_model="numpy")


@_lanewise
def exp2(exponent, least=8):
    """2^exponent for exponents in -least..0, float32. The library's keeps loops around it from being vectorised."""
    shifted = exponent + np.float32(least)
    whole = np.int32(shifted)
    f = shifted - np.float32(whole)
    mantissa = _EXP2[0] + f * (_EXP2[1] + f * (_EXP2[2] + f * (_EXP2[3] + f * _EXP2[4])))
    # The exponent of a float32 stands above its 23 bits of mantissa, shifted by 127.
    return mantissa * np.int32((whole + np.int32(127 - least)) << np.int32(23)).view(np.float32)


@_lanewise
def log2(value):
    """log2 of a number above 0, float32, to 1.5e-5."""
    bits = np.float32(value).view(np.int32)
    m = np.int32((bits & np.int32(0x7FFFFF)) | np.int32(0x3F800000)).view(np.float32)
    mantissa = (m - _ONE) * (_LOG2[0] + m * (_LOG2[1] + m * (_LOG2[2] + m * (_LOG2[3] + m * _LOG2[4]))))
    return mantissa + np.float32((bits >> np.int32(23)) - np.int32(127))


@_lanewise
def normal_share(deviations):
    """Phi, the share of a normal variable below so many deviations, float32, to 1e-5."""
    d = min(max(deviations, -_SURE), _SURE)
    squared = d * d
    odds = d * (_PHI[0] + squared * (_PHI[1] + squared * (_PHI[2] + squared * _PHI[3])))
    rarer = exp2(-abs(odds), 24)
    return (_ONE if d >= _ZERO else rarer) / (_ONE + rarer)


@_lanewise
def _blend_row(row, across, start, strength, red, green, blue, depth):
    """Lay one Gaussian over one row: alpha = 2^(strength - (across x - start)^2) at x = 0.5, 1.5, ..."""
    for x in range(TILE):
        whitened = across * (np.float32(x) + _HALF) - start
        exponent = strength - whitened * whitened
        alpha = exp2(min(max(exponent, _FLOOR), _LIMIT))
        weight = row[_LIGHT + x] * (alpha if exponent >= _FLOOR else _ZERO)
        row[_LIGHT + x] -= weight
        row[_RED + x] += weight * red
        row[_GREEN + x] += weight * green
        row[_BLUE + x] += weight * blue
        row[_DEPTH + x] += weight * depth


@_lanewise
def _blend_row_through(row, across, start, strength, red, green, blue, depth, walls, span, slope, step, down):
    """Lay one Gaussian over one row, of each pixel only what is nearer than its wall.

    The ray through a pixel is z (x, y, 1), x = `slope` + `step` k, y = `down`. A Gaussian that W whitens is normal
    along it, with variance 1 / |W r|^2 and mean (W r) . (W mu) / |W r|^2; of its optical depth -log(1 - alpha) the
    part Phi((wall - mean) / deviation) is before the wall.
    """
    second, third = span[W11] * down, span[W21] * down + span[W22]
    for k in range(TILE):
        whitened = across * (np.float32(k) + _HALF) - start
        exponent = strength - whitened * whitened
        alpha = exp2(min(max(exponent, _FLOOR), _LIMIT))
        x = slope + step * np.float32(k)
        a, b, c = span[W00] * x, span[W10] * x + second, span[W20] * x + third
        squared = a * a + b * b + c * c
        mean = (a * span[M0] + b * span[M1] + c * span[M2]) / squared
        before = normal_share((walls[k] - mean) * math.sqrt(squared))
        alpha = _ONE - exp2(before * log2(_ONE - alpha), 24)
        weight = row[_LIGHT + k] * (alpha if exponent >= _FLOOR else _ZERO)
        row[_LIGHT + k] -= weight
        row[_RED + k] += weight * red
        row[_GREEN + k] += weight * green
        row[_BLUE + k] += weight * blue
        row[_DEPTH + k] += weight * depth


@_lanewise
def _brightest(row):
    """Most light that comes through any pixel of a row."""
    most = _ZERO
    for x in range(TILE):
        most = max(most, row[_LIGHT + x])
    return most


@_function
def _look(sums, lit):
    """Mark the rows that light still comes through; whether there are any."""
    any_lit = False
    for y in range(TILE):
        lit[y] = _brightest(sums[y * _ROW : (y + 1) * _ROW]) >= OPAQUE
        any_lit = any_lit or lit[y]
    return any_lit


@_function
def _raise_walls(occluders, left, top, walls, nearest, farthest):
    """The part of `occluders` in one tile, `_NOWHERE` where there is none; of each row the nearest and farthest."""
    for y in range(TILE):
        nearest[y], farthest[y] = _NOWHERE, _ZERO
        for x in range(TILE):
            inside = top + y < occluders.shape[0] and left + x < occluders.shape[1]
            walls[y, x] = min(occluders[top + y, left + x], _NOWHERE) if inside else _NOWHERE
            nearest[y], farthest[y] = min(nearest[y], walls[y, x]), max(farthest[y], walls[y, x])


@_function
def _blend_tile(ellipses, spans, rows, rays, occluders, left, top, sums, lit, walls, nearest, farthest):
    """Fill `sums`."""
    for y in range(TILE):
        for x in range(TILE):
            sums[y * _ROW + _LIGHT + x] = _ONE
        for x in range(_RED, _ROW):
            sums[y * _ROW + x] = _ZERO
        lit[y] = True
    walled = len(occluders) > 0
    if walled:
        _raise_walls(occluders, left, top, walls, nearest, farthest)
    for drawn, i in enumerate(rows):
        if drawn % _PATIENCE == _PATIENCE - 1 and not _look(sums, lit):
            break
        depth = ellipses[i, DEPTH]
        half = spans[i, HALF] if walled else _ZERO
        across, slant, down = ellipses[i, ACROSS], ellipses[i, SLANT], ellipses[i, DOWN]
        offset_x, offset_y, strength = ellipses[i, OFFSET_X], ellipses[i, OFFSET_Y], ellipses[i, STRENGTH]
        red, green, blue = ellipses[i, RED], ellipses[i, GREEN], ellipses[i, BLUE]
        for y in range(max(0, np.int64(ellipses[i, TOP]) - top), min(TILE, np.int64(ellipses[i, BOTTOM]) - top)):
            if not lit[y] or (walled and depth - half >= farthest[y]):
                continue
            height = np.float32(top + y) + _HALF
            whitened = down * height - offset_y
            here = strength - whitened * whitened
            start = slant * height + offset_x - across * np.float32(left)
            miss = max(across * _HALF - start, start - across * (np.float32(TILE) - _HALF), _ZERO)
            if here - miss * miss < _FLOOR:
                continue
            row = sums[y * _ROW : (y + 1) * _ROW]
            if not walled or depth + half <= nearest[y]:
                _blend_row(row, across, start, here, red, green, blue, depth)
            else:
                slope = np.float32(rays[0] + rays[1] * left)
                step, steep = np.float32(rays[1]), np.float32(rays[2] + rays[3] * (top + y))
                _blend_row_through(
                    row, across, start, here, red, green, blue, depth, walls[y], spans[i], slope, step, steep
                )


@numba.njit(cache=True, error_model="numpy", parallel=True)
def blend(ellipses, spans, starts, lists, rays, occluders, colour, alpha, depth):
    """Fill `colour`, `alpha` and `depth`.

    Parameters
    ----------
    ellipses : (N, FIELDS) float32
    spans : (N, SPANS) float32, no rows where there are no occluders
    starts : (tiles + 1,) int64, lists : (pairs,) int32
        Gaussians of each tile, nearest first: those of tile k are ``lists[starts[k] : starts[k + 1]]``.
    rays : (4,)
        x / z of the first column of pixels' centres, how much more it is of the next, and y / z in the same way.
    occluders : (H, W) float32, or no rows
        Depths beyond which a pixel shows nothing.
    colour : (H, W, 3) float32, alpha : (H, W) float32, depth : (H, W) float32
        As in `gasp_core.rendering.contract.Picture`.
    """
    height, width = alpha.shape
    columns = (width + TILE - 1) // TILE
    for strip in numba.prange(_STRIPS):
        sums, lit = np.empty(TILE * _ROW, np.float32), np.empty(TILE, np.bool_)
        walls, near, far = np.empty((TILE, TILE), np.float32), np.empty(TILE, np.float32), np.empty(TILE, np.float32)
        for tile in range(strip, len(starts) - 1, _STRIPS):
            top, left = tile // columns * TILE, tile % columns * TILE
            rows = lists[starts[tile] : starts[tile + 1]]
            _blend_tile(ellipses, spans, rows, rays, occluders, left, top, sums, lit, walls, near, far)
            for y in range(min(TILE, height - top)):
                for x in range(min(TILE, width - left)):
                    k = y * _ROW + x
                    weight = _ONE - sums[k + _LIGHT]
                    colour[top + y, left + x, 0] = sums[k + _RED]
                    colour[top + y, left + x, 1] = sums[k + _GREEN]
                    colour[top + y, left + x, 2] = sums[k + _BLUE]
                    alpha[top + y, left + x] = weight
                    depth[top + y, left + x] = sums[k + _DEPTH] / weight if weight > 0 else np.float32(np.inf)
