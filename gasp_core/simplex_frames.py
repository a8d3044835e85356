# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is games.py.
"""Compiled kernels from simplices to frames: the principal axes of their edges, or the paper's Gram-Schmidt."""

from __future__ import annotations

import math

import numba
import numpy as np

from gasp_core.linalg3 import (
    LANES,
    VANISHED,
    cross,
    dot,
    frame,
    inlined,
    orthogonalise_lanes,
    parallel,
    quaternion,
    rotation,
    scaled,
    turned,
)


@inlined
def _edge(simplex, vertex, factor):
    return (
        (simplex[vertex, 0] - simplex[0, 0]) * factor,
        (simplex[vertex, 1] - simplex[0, 1]) * factor,
        (simplex[vertex, 2] - simplex[0, 2]) * factor,
    )


@inlined
def _largest_extent(simplex):
    """Largest coordinate of any edge, nan where one is: dividing by it keeps squares from under- and overflowing."""
    largest = 0.0
    for vertex in range(1, simplex.shape[0]):
        for axis in range(3):
            extent = abs(simplex[vertex, axis] - simplex[0, axis])
            if not math.isfinite(extent):
                return math.nan
            largest = max(largest, extent)
    return largest


@inlined
def flat_order(scales):
    """Axes of a Gaussian as a triangle has them: the thin one, the longer in-plane one, the other."""
    thin = 0
    if scales[1] < scales[thin]:
        thin = 1
    if scales[2] < scales[thin]:
        thin = 2
    second, third = (thin + 1) % 3, (thin + 2) % 3
    if scales[third] > scales[second]:
        return thin, third, second
    return thin, second, third


@inlined
def _store(axis, column, scale, columns, scales):
    columns[axis, 0], columns[axis, 1], columns[axis, 2] = column
    scales[axis] = scale


@inlined
def _finish(row, columns, quaternions):
    quaternions[row, 0], quaternions[row, 1], quaternions[row, 2], quaternions[row, 3] = quaternion(
        (columns[0, 0], columns[0, 1], columns[0, 2]),
        (columns[1, 0], columns[1, 1], columns[1, 2]),
        (columns[2, 0], columns[2, 1], columns[2, 2]),
    )


@inlined
def _flat_frame(simplex, rest_scales, columns, scales):
    extent = _largest_extent(simplex)
    if not (extent > 0.0 and math.isfinite(extent)):
        return False
    factor = 1 / extent
    thin, second, third = flat_order(rest_scales)
    b, c = _edge(simplex, 1, factor), _edge(simplex, 2, factor)
    cosine, sine, _ = rotation(b, c)
    b, c = turned(b, c, cosine, sine)
    b, c, a, lengths, _ = frame(b, c, (0.0, 0.0, 0.0))
    # (thin, second, third) is an odd permutation of the axes where the longer edge is not the next one.
    if (thin + 1) % 3 != second:
        a = scaled(a, -1.0)
    _store(thin, a, rest_scales[thin], columns, scales)
    _store(second, b, lengths[0] * extent, columns, scales)
    _store(third, c, lengths[1] * extent, columns, scales)
    return True


@inlined
def _full_frames(simplices, quaternions, scales, valid, work, columns, extents):
    """Up to `LANES` simplices of four vertices at once."""
    count = simplices.shape[0]
    work[:] = 0.0
    for lane in range(count):
        extents[lane] = _largest_extent(simplices[lane])
        valid[lane] = extents[lane] > 0.0 and math.isfinite(extents[lane])
        if valid[lane]:
            for edge in range(3):
                column = _edge(simplices[lane], edge + 1, 1 / extents[lane])
                work[3 * edge, lane], work[3 * edge + 1, lane], work[3 * edge + 2, lane] = column
    orthogonalise_lanes(work)
    for lane in range(count):
        if valid[lane]:
            a, b, c, lengths, _ = frame(
                (work[0, lane], work[1, lane], work[2, lane]),
                (work[3, lane], work[4, lane], work[5, lane]),
                (work[6, lane], work[7, lane], work[8, lane]),
            )
            _store(0, a, lengths[0] * extents[lane], columns, scales[lane])
            _store(1, b, lengths[1] * extents[lane], columns, scales[lane])
            _store(2, c, lengths[2] * extents[lane], columns, scales[lane])
            _finish(lane, columns, quaternions)


@inlined
def _gram_schmidt_frame(simplex, rest_scales, columns, scales):
    extent = _largest_extent(simplex)
    if not (extent > 0.0 and math.isfinite(extent)):
        return False
    factor = 1 / extent
    last = simplex.shape[0] - 1
    first, other = _edge(simplex, last - 1, factor), _edge(simplex, last, factor)
    length, other_length = math.sqrt(dot(first, first)), math.sqrt(dot(other, other))
    if not (length > 0.0 and other_length > 0.0):
        return False
    r2 = scaled(first, 1 / length)
    normal = cross(r2, scaled(other, 1 / other_length))
    sine = math.sqrt(dot(normal, normal))
    # Relative to the edges: an absolute bound on the area would call every small Gaussian degenerate.
    if not sine > VANISHED:
        return False
    r1 = scaled(normal, 1 / sine)
    r3 = cross(r1, r2)
    if simplex.shape[0] == 3:
        thin, second, third = flat_order(rest_scales)
        _store(thin, scaled(r1, 1.0 if (thin + 1) % 3 == second else -1.0), rest_scales[thin], columns, scales)
    else:
        thin, second, third = 0, 1, 2
        _store(thin, r1, abs(dot(_edge(simplex, 1, factor), r1)) * extent, columns, scales)
    _store(second, r2, length * extent, columns, scales)
    _store(third, r3, dot(other, r3) * extent, columns, scales)
    return True


@parallel
def flat_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """Principal axes of e_2 e_2^T + e_3 e_3^T for every triangle; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns = np.empty((3, 3))
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            valid[row] = _flat_frame(simplices[row], rest_scales[row], columns, scales[row])
            if valid[row]:
                _finish(row, columns, quaternions)


@parallel
def full_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """Principal axes of e_1 e_1^T + e_2 e_2^T + e_3 e_3^T for every tetrahedron; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns, work, extents = np.empty((3, 3)), np.empty((9, LANES)), np.empty(LANES)
        last = (chunk + 1) * count // chunks
        for first in range(chunk * count // chunks, last, LANES):
            rows = slice(first, min(first + LANES, last))
            _full_frames(simplices[rows], quaternions[rows], scales[rows], valid[rows], work, columns, extents)


@parallel
def gram_schmidt_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """The paper's inverse: normal, first edge, Gram-Schmidt of the second; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns = np.empty((3, 3))
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            valid[row] = _gram_schmidt_frame(simplices[row], rest_scales[row], columns, scales[row])
            if valid[row]:
                _finish(row, columns, quaternions)
