# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is games.py.
"""Compiled kernels from simplices to frames: the principal axes of their edges, or the paper's Gram-Schmidt; and to how
they are deformed."""

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
    perpendicular,
    quaternion,
    rotation,
    scaled,
    turned,
)

_OPPOSITE = 1e-8
"""Of the sum of two directions: a shorter one is as much rounding as sum, and what is at right angles is as near."""


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
def gram_schmidt_order(scales, vertices):
    """Axes of a Gaussian as Gram-Schmidt takes them: that of the normal, of the first edge, of the second.

    Of four vertices 0, 1, 2, but where one of these two edges is missing at rest, which spans nothing.
    """
    if vertices == 3 or not (scales[1] > 0.0 and scales[2] > 0.0):
        return flat_order(scales)
    return 0, 1, 2


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
    thin, second, third = gram_schmidt_order(rest_scales, simplex.shape[0])
    full = simplex.shape[0] == 4
    first = _edge(simplex, second + 1 if full else 1, factor)
    other = _edge(simplex, third + 1 if full else 2, factor)
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
    thickness = abs(dot(_edge(simplex, thin + 1, factor), r1)) * extent if full else rest_scales[thin]
    _store(thin, scaled(r1, 1.0 if (thin + 1) % 3 == second else -1.0), thickness, columns, scales)
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


@inlined
def _axes_at_rest(quaternion):
    """Columns of the rotation matrix of a quaternion; of one that is zero or not finite, of the identity."""
    largest = 0.0
    for entry in range(4):
        size = abs(float(quaternion[entry]))
        if not math.isfinite(size):
            largest = 0.0
            break
        largest = max(largest, size)
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    if largest > 0.0:
        # Squares of 1e-200 would underflow to zero.
        w, x, y, z = quaternion[0] / largest, quaternion[1] / largest, quaternion[2] / largest, quaternion[3] / largest
        length = math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / length, x / length, y / length, z / length
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@inlined
def _unit(vector):
    """A vector of any finite size with a length of 1, or zero."""
    extent = max(abs(vector[0]), abs(vector[1]), abs(vector[2]))
    if not (extent > 0.0 and math.isfinite(extent)):
        return (0.0, 0.0, 0.0)
    vector = (vector[0] / extent, vector[1] / extent, vector[2] / extent)
    length = math.sqrt(dot(vector, vector))
    return (vector[0] / length, vector[1] / length, vector[2] / length)


@inlined
def _unit_normal(first, second, instead):
    """Of two edges, or what stands in where they are collinear."""
    normal = cross(_unit(first), _unit(second))
    length = math.sqrt(dot(normal, normal))
    if not length > 0.0:
        return instead
    return (normal[0] / length, normal[1] / length, normal[2] / length)


@inlined
def _stretched(simplex, vertex, length):
    edge = _edge(simplex, vertex, 1.0)
    return (edge[0] / length, edge[1] / length, edge[2] / length) if length > 0.0 else edge


@inlined
def _add_outer(now, rest, gradient):
    for i in range(3):
        for j in range(3):
            gradient[i, j] += now[i] * rest[j]


@inlined
def _needle_gradient(now, rest, gradient):
    """F of one edge, at rest of length 1: it goes to where it is now, and what is across it with the shortest rotation.

    That is a half-turn about the edge at rest and then one about w, midway between the two: across 1 - 2 w w^T.
    """
    to = _unit(now)
    middle = (rest[0] + to[0], rest[1] + to[1], rest[2] + to[2])
    length = math.sqrt(dot(middle, middle))
    middle = scaled(middle, 1 / length) if length > _OPPOSITE else perpendicular(rest)
    along = dot(middle, rest)
    across = (middle[0] - along * rest[0], middle[1] - along * rest[1], middle[2] - along * rest[2])
    for i in range(3):
        for j in range(3):
            gradient[i, j] = 1.0 if i == j else 0.0
    _add_outer((now[0] - rest[0], now[1] - rest[1], now[2] - rest[2]), rest, gradient)
    _add_outer(scaled(middle, -2.0), across, gradient)


@inlined
def _gradient(simplex, quaternion, scales, gradient):
    axes = _axes_at_rest(quaternion)
    if simplex.shape[0] == 3:
        _, second, third = flat_order(scales)
        # Tuples are indexed by what a compiler knows.
        a = axes[0] if second == 0 else (axes[1] if second == 1 else axes[2])
        b = axes[0] if third == 0 else (axes[1] if third == 1 else axes[2])
        c = cross(a, b)
        x, y, z = scales[second], scales[third], 0.0
        now_a, now_b, now_c = _stretched(simplex, 1, x), _stretched(simplex, 2, y), c
    else:
        a, b, c = axes
        x, y, z = scales[0], scales[1], scales[2]
        now_a, now_b, now_c = _stretched(simplex, 1, x), _stretched(simplex, 2, y), _stretched(simplex, 3, z)
    if (x > 0.0) + (y > 0.0) + (z > 0.0) < 2:
        # Of nothing at all the identity.
        if z > 0.0:
            now_a, a = now_c, c
        elif y > 0.0:
            now_a, a = now_b, b
        elif not x > 0.0:
            now_a = a
        _needle_gradient(now_a, a, gradient)
        return
    # Collinear edges have no normal: the direction at rest keeps F finite.
    if not x > 0.0:
        now_a, a = _unit_normal(now_b, now_c, a), cross(b, c)
    elif not y > 0.0:
        now_b, b = _unit_normal(now_c, now_a, b), cross(c, a)
    elif not z > 0.0:
        now_c, c = _unit_normal(now_a, now_b, c), cross(a, b)
    gradient[:] = 0.0
    _add_outer(now_a, a, gradient)
    _add_outer(now_b, b, gradient)
    _add_outer(now_c, c, gradient)


@parallel
def deformation_gradients(simplices, quaternions, scales, gradients, chunks):
    """F of every simplex from its Gaussian at rest; see `games.deformation_gradients`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            _gradient(simplices[row], quaternions[row], scales[row], gradients[row])
