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
from gasp_renderer.projection import (
    ACROSS,
    BLUE,
    BOTTOM,
    DEPTH,
    DOWN,
    GREEN,
    OFFSET_X,
    OFFSET_Y,
    RED,
    SLANT,
    STRENGTH,
    TILE,
    TOP,
)

__all__ = ["OPAQUE", "blend"]

OPAQUE = np.float32(1e-4)
"""Light that still comes through where what lies behind is left out."""

_ONE, _HALF, _ZERO = np.float32(1), np.float32(0.5), np.float32(0)
_FLOOR, _LIMIT = np.float32(math.log2(ALPHA_FLOOR)), np.float32(math.log2(ALPHA_LIMIT))
_PATIENCE = 32
"""Gaussians between two looks at which rows are opaque; a look costs about as much as one Gaussian."""
_STRIPS = 127
"""Sets of tiles that threads share out: each takes every 127th. Prime, so that no set is a column of the picture, where
all the work might be."""

# Sums of one row of a tile, 16 pixels each.
_LIGHT, _RED, _GREEN, _BLUE, _DEPTH, _ROW = 0, TILE, 2 * TILE, 3 * TILE, 4 * TILE, 5 * TILE

# 2^f for f in 0..1, relative error 2.6e-6: the polynomial of degree 4 of least largest relative error.
_EXP2 = tuple(np.float32(c) for c in (1.00000259, 0.69300383, 0.24144276, 0.05201146, 0.01353417))

# Only finite numbers get here, and a sum of sixteen lanes may be taken in any order.
_lanewise = numba.njit(
    cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc", "afn"}
)
_function = numba.njit(cache=True, error_model="numpy")


@_lanewise
def exp2(exponent):
    """2^exponent for exponents in -8..0, float32. The library's keeps loops around it from being vectorised."""
    shifted = exponent + np.float32(8)
    whole = np.int32(shifted)
    f = shifted - np.float32(whole)
    mantissa = _EXP2[0] + f * (_EXP2[1] + f * (_EXP2[2] + f * (_EXP2[3] + f * _EXP2[4])))
    # The exponent of a float32 stands above its 23 bits of mantissa, shifted by 127.
    return mantissa * np.int32((whole + np.int32(127 - 8)) << np.int32(23)).view(np.float32)


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
def _raise_walls(occluders, left, top, walls):
    """The part of `occluders` in one tile, inf outside the picture; the nearest of them."""
    nearest = np.float32(np.inf)
    for y in range(TILE):
        for x in range(TILE):
            inside = top + y < occluders.shape[0] and left + x < occluders.shape[1]
            walls[y, x] = occluders[top + y, left + x] if inside else np.float32(np.inf)
            nearest = min(nearest, walls[y, x])
    return nearest


@_function
def _close(sums, walls, kept, depth):
    """End the pixels whose wall is nearer than `depth`: their light is put aside; the nearest wall that is left."""
    nearest = np.float32(np.inf)
    for y in range(TILE):
        for x in range(TILE):
            if walls[y, x] < depth:
                kept[y, x] = sums[y * _ROW + _LIGHT + x]
                sums[y * _ROW + _LIGHT + x] = _ZERO
                walls[y, x] = np.inf
            nearest = min(nearest, walls[y, x])
    return nearest


@_function
def _blend_tile(ellipses, rows, occluders, left, top, sums, lit, walls, kept):
    """Fill `sums`, and `kept` with the light left where a wall ended a pixel."""
    for y in range(TILE):
        for x in range(TILE):
            kept[y, x] = _ZERO
            sums[y * _ROW + _LIGHT + x] = _ONE
        for x in range(_RED, _ROW):
            sums[y * _ROW + x] = _ZERO
        lit[y] = True
    nearest = np.float32(np.inf)
    if len(occluders) > 0:
        nearest = _raise_walls(occluders, left, top, walls)
    for drawn, i in enumerate(rows):
        depth = ellipses[i, DEPTH]
        closing = depth > nearest
        if closing:
            nearest = _close(sums, walls, kept, depth)
        if (closing or drawn % _PATIENCE == _PATIENCE - 1) and not _look(sums, lit):
            break
        across, slant, down = ellipses[i, ACROSS], ellipses[i, SLANT], ellipses[i, DOWN]
        offset_x, offset_y, strength = ellipses[i, OFFSET_X], ellipses[i, OFFSET_Y], ellipses[i, STRENGTH]
        red, green, blue = ellipses[i, RED], ellipses[i, GREEN], ellipses[i, BLUE]
        for y in range(max(0, np.int64(ellipses[i, TOP]) - top), min(TILE, np.int64(ellipses[i, BOTTOM]) - top)):
            if not lit[y]:
                continue
            height = np.float32(top + y) + _HALF
            whitened = down * height - offset_y
            here = strength - whitened * whitened
            start = slant * height + offset_x - across * np.float32(left)
            miss = max(across * _HALF - start, start - across * (np.float32(TILE) - _HALF), _ZERO)
            if here - miss * miss >= _FLOOR:
                _blend_row(sums[y * _ROW : (y + 1) * _ROW], across, start, here, red, green, blue, depth)


@numba.njit(cache=True, error_model="numpy", parallel=True)
def blend(ellipses, starts, lists, occluders, colour, alpha, depth):
    """Fill `colour`, `alpha` and `depth`.

    Parameters
    ----------
    ellipses : (N, FIELDS) float32
    starts : (tiles + 1,) int64, lists : (pairs,) int32
        Gaussians of each tile, nearest first: those of tile k are ``lists[starts[k] : starts[k + 1]]``.
    occluders : (H, W) float32, or no rows
        Depths beyond which a pixel shows nothing.
    colour : (H, W, 3) float32, alpha : (H, W) float32, depth : (H, W) float32
        As in `gasp_core.rendering.contract.Picture`.
    """
    height, width = alpha.shape
    columns = (width + TILE - 1) // TILE
    for strip in numba.prange(_STRIPS):
        sums, lit = np.empty(TILE * _ROW, np.float32), np.empty(TILE, np.bool_)
        walls, kept = np.empty((TILE, TILE), np.float32), np.empty((TILE, TILE), np.float32)
        for tile in range(strip, len(starts) - 1, _STRIPS):
            top, left = tile // columns * TILE, tile % columns * TILE
            _blend_tile(ellipses, lists[starts[tile] : starts[tile + 1]], occluders, left, top, sums, lit, walls, kept)
            for y in range(min(TILE, height - top)):
                for x in range(min(TILE, width - left)):
                    k = y * _ROW + x
                    weight = _ONE - (sums[k + _LIGHT] + kept[y, x])
                    colour[top + y, left + x, 0] = sums[k + _RED]
                    colour[top + y, left + x, 1] = sums[k + _GREEN]
                    colour[top + y, left + x, 2] = sums[k + _BLUE]
                    alpha[top + y, left + x] = weight
                    depth[top + y, left + x] = sums[k + _DEPTH] / weight if weight > 0 else np.float32(np.inf)
