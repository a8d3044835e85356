# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is games.py and control.py.
"""Compiled kernels over many 3x3 matrices: one-sided Jacobi, the polar rotation, quaternions.

One-sided Jacobi (Hestenes 1958) turns pairs of columns until all are orthogonal. Unlike an eigenproblem of the squared
matrix it keeps small singular values to full relative precision (Demmel and Veselic 1992, 10.1137/0613074), which is
what a needle or a wafer is made of, and for two columns one rotation is the whole answer.

Columns travel as tuples of scalars: small arrays inside the loop would cost more than the arithmetic.
"""

from __future__ import annotations

import math

import numba
import numpy as np

_SWEEPS = 12
_LANES = 8
"""Matrices worked on at once: square roots and divisions then run in vector registers, 3.5 times as fast."""
_ORTHOGONAL_SQUARED = 1e-28
"""Cosine^2 at which two columns count as orthogonal: an error of 1e-14 in a covariance, above what dots round to."""
_VANISHED = 1e-14
"""Below this share of the largest column a column is rounding error and has no direction."""

# "contract" lets a product and a sum become one fused operation, which only rounds less.
_function = numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
# Lanes hold finite numbers only; saying so lets a maximum over them be taken without a branch.
_lanewise = numba.njit(cache=True, error_model="numpy", fastmath={"contract", "nnan"})
_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)


@_function
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_function
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@_function
def _scaled(a, factor):
    return (a[0] * factor, a[1] * factor, a[2] * factor)


@_function
def _combined(p, a, q, b):
    return (p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2])


@_function
def _rotation(a, b):
    """Cosine and sine that make columns a and b orthogonal, and whether they were."""
    aa, bb, ab = _dot(a, a), _dot(b, b), _dot(a, b)
    if ab * ab <= _ORTHOGONAL_SQUARED * aa * bb:
        return 1.0, 0.0, True
    gap = bb - aa
    tangent = 2 * ab / (gap + math.copysign(math.sqrt(gap * gap + 4 * ab * ab), gap))
    cosine = 1 / math.sqrt(1 + tangent * tangent)
    return cosine, cosine * tangent, False


@_function
def _turned(a, b, cosine, sine):
    return _combined(cosine, a, -sine, b), _combined(sine, a, cosine, b)


@_lanewise
def _turn_lanes(work, i, j):
    """One rotation of columns i and j in every lane; the largest tangent, which tells how far from done they were."""
    largest = 0.0
    for lane in range(_LANES):
        a0, a1, a2 = work[3 * i, lane], work[3 * i + 1, lane], work[3 * i + 2, lane]
        b0, b1, b2 = work[3 * j, lane], work[3 * j + 1, lane], work[3 * j + 2, lane]
        aa, bb = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2
        ab = a0 * b0 + a1 * b1 + a2 * b2
        gap = bb - aa
        root = math.sqrt(gap * gap + 4 * ab * ab)
        divisor = gap + (root if gap >= 0 else -root)
        orthogonal = ab * ab <= _ORTHOGONAL_SQUARED * aa * bb
        tangent = 0.0 if orthogonal else 2 * ab / (1.0 if divisor == 0.0 else divisor)
        cosine = 1 / math.sqrt(1 + tangent * tangent)
        sine = cosine * tangent
        work[3 * i, lane], work[3 * j, lane] = cosine * a0 - sine * b0, sine * a0 + cosine * b0
        work[3 * i + 1, lane], work[3 * j + 1, lane] = cosine * a1 - sine * b1, sine * a1 + cosine * b1
        work[3 * i + 2, lane], work[3 * j + 2, lane] = cosine * a2 - sine * b2, sine * a2 + cosine * b2
        largest = max(largest, abs(tangent))
    return largest


@_function
def orthogonalise_lanes(work):
    """Columns of A V, orthogonal, in place of those of A, for the matrices in the lanes of `work` (9, lanes)."""
    for _ in range(_SWEEPS):
        largest = max(_turn_lanes(work, 0, 1), _turn_lanes(work, 0, 2), _turn_lanes(work, 1, 2))
        # Convergence is quadratic: what a sweep found at 1e-7 it left at 1e-14.
        if largest < 1e-7:
            break


@_function
def orthogonalised_with_turn(a, b, c):
    """Columns of A V, orthogonal, and those of V."""
    u, v, w = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for _ in range(_SWEEPS):
        cosine, sine, done_ab = _rotation(a, b)
        a, b = _turned(a, b, cosine, sine)
        u, v = _turned(u, v, cosine, sine)
        cosine, sine, done_ac = _rotation(a, c)
        a, c = _turned(a, c, cosine, sine)
        u, w = _turned(u, w, cosine, sine)
        cosine, sine, done_bc = _rotation(b, c)
        b, c = _turned(b, c, cosine, sine)
        v, w = _turned(v, w, cosine, sine)
        if done_ab and done_ac and done_bc:
            break
    return a, b, c, u, v, w


@_function
def _perpendicular(a):
    """A unit vector at right angles to the unit vector a."""
    if abs(a[0]) <= abs(a[1]) and abs(a[0]) <= abs(a[2]):
        p = _cross(a, (1.0, 0.0, 0.0))
    elif abs(a[1]) <= abs(a[2]):
        p = _cross(a, (0.0, 1.0, 0.0))
    else:
        p = _cross(a, (0.0, 0.0, 1.0))
    return _scaled(p, 1 / math.sqrt(_dot(p, p)))


@_function
def frame(a, b, c):
    """Right-handed unit axes and lengths of three orthogonal columns; vanished columns are filled in.

    The fourth result is False where nothing has a direction (all columns zero, or not finite).
    """
    x, y, z = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b)), math.sqrt(_dot(c, c))
    largest = max(x, y, z)
    if not (largest > 0.0 and math.isfinite(largest)):
        return a, b, c, (0.0, 0.0, 0.0), False
    floor = _VANISHED * largest
    has_a, has_b, has_c = x > floor, y > floor, z > floor
    if has_a:
        a = _scaled(a, 1 / x)
    if has_b:
        b = _scaled(b, 1 / y)
    if has_c:
        c = _scaled(c, 1 / z)
    if has_a and has_b:
        # Also where c exists: its sign is free, its direction is known better from the two larger ones only if it is
        # tiny, and the cross product is the one that makes det = +1 in either case.
        normal = _cross(a, b)
        if has_c and _dot(normal, c) < 0:
            c = _scaled(c, -1.0)
        elif not has_c:
            c = normal
    elif has_a and has_c:
        b = _cross(c, a)
    elif has_b and has_c:
        a = _cross(b, c)
    elif has_a:
        b = _perpendicular(a)
        c = _cross(a, b)
    elif has_b:
        c = _perpendicular(b)
        a = _cross(b, c)
    else:
        a = _perpendicular(c)
        b = _cross(c, a)
    return a, b, c, (x if has_a else 0.0, y if has_b else 0.0, z if has_c else 0.0), True


@_function
def quaternion(a, b, c):
    """Unit quaternion w x y z, w >= 0, of the rotation with columns a, b, c (Shepperd 1978)."""
    trace = a[0] + b[1] + c[2]
    if trace >= a[0] and trace >= b[1] and trace >= c[2]:
        w, x, y, z = 1 + trace, b[2] - c[1], c[0] - a[2], a[1] - b[0]
    elif a[0] >= b[1] and a[0] >= c[2]:
        w, x, y, z = b[2] - c[1], 1 + 2 * a[0] - trace, a[1] + b[0], a[2] + c[0]
    elif b[1] >= c[2]:
        w, x, y, z = c[0] - a[2], a[1] + b[0], 1 + 2 * b[1] - trace, b[2] + c[1]
    else:
        w, x, y, z = a[1] - b[0], a[2] + c[0], b[2] + c[1], 1 + 2 * c[2] - trace
    factor = math.copysign(1.0, w) / math.sqrt(w * w + x * x + y * y + z * z)
    return w * factor, x * factor, y * factor, z * factor


@_function
def _edge(simplex, vertex, factor):
    return (
        (simplex[vertex, 0] - simplex[0, 0]) * factor,
        (simplex[vertex, 1] - simplex[0, 1]) * factor,
        (simplex[vertex, 2] - simplex[0, 2]) * factor,
    )


@_function
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


@_function
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


@_function
def _store(axis, column, scale, columns, scales):
    columns[axis, 0], columns[axis, 1], columns[axis, 2] = column
    scales[axis] = scale


@_function
def _finish(row, columns, quaternions):
    quaternions[row, 0], quaternions[row, 1], quaternions[row, 2], quaternions[row, 3] = quaternion(
        (columns[0, 0], columns[0, 1], columns[0, 2]),
        (columns[1, 0], columns[1, 1], columns[1, 2]),
        (columns[2, 0], columns[2, 1], columns[2, 2]),
    )


@_function
def _flat_frame(simplex, rest_scales, columns, scales):
    extent = _largest_extent(simplex)
    if not (extent > 0.0 and math.isfinite(extent)):
        return False
    factor = 1 / extent
    thin, second, third = flat_order(rest_scales)
    b, c = _edge(simplex, 1, factor), _edge(simplex, 2, factor)
    cosine, sine, _ = _rotation(b, c)
    b, c = _turned(b, c, cosine, sine)
    b, c, a, lengths, _ = frame(b, c, (0.0, 0.0, 0.0))
    # (thin, second, third) is an odd permutation of the axes where the longer edge is not the next one.
    if (thin + 1) % 3 != second:
        a = _scaled(a, -1.0)
    _store(thin, a, rest_scales[thin], columns, scales)
    _store(second, b, lengths[0] * extent, columns, scales)
    _store(third, c, lengths[1] * extent, columns, scales)
    return True


@_function
def _full_frames(simplices, quaternions, scales, valid, work, columns, extents):
    """Up to `_LANES` simplices of four vertices at once."""
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


@_function
def _gram_schmidt_frame(simplex, rest_scales, columns, scales):
    extent = _largest_extent(simplex)
    if not (extent > 0.0 and math.isfinite(extent)):
        return False
    factor = 1 / extent
    last = simplex.shape[0] - 1
    first, other = _edge(simplex, last - 1, factor), _edge(simplex, last, factor)
    length, other_length = math.sqrt(_dot(first, first)), math.sqrt(_dot(other, other))
    if not (length > 0.0 and other_length > 0.0):
        return False
    r2 = _scaled(first, 1 / length)
    normal = _cross(r2, _scaled(other, 1 / other_length))
    sine = math.sqrt(_dot(normal, normal))
    # Relative to the edges: an absolute bound on the area would call every small Gaussian degenerate.
    if not sine > _VANISHED:
        return False
    r1 = _scaled(normal, 1 / sine)
    r3 = _cross(r1, r2)
    if simplex.shape[0] == 3:
        thin, second, third = flat_order(rest_scales)
        _store(thin, _scaled(r1, 1.0 if (thin + 1) % 3 == second else -1.0), rest_scales[thin], columns, scales)
    else:
        thin, second, third = 0, 1, 2
        _store(thin, r1, abs(_dot(_edge(simplex, 1, factor), r1)) * extent, columns, scales)
    _store(second, r2, length * extent, columns, scales)
    _store(third, r3, _dot(other, r3) * extent, columns, scales)
    return True


@_parallel
def flat_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """Principal axes of e_2 e_2^T + e_3 e_3^T for every triangle; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns = np.empty((3, 3))
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            valid[row] = _flat_frame(simplices[row], rest_scales[row], columns, scales[row])
            if valid[row]:
                _finish(row, columns, quaternions)


@_parallel
def full_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """Principal axes of e_1 e_1^T + e_2 e_2^T + e_3 e_3^T for every tetrahedron; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns, work, extents = np.empty((3, 3)), np.empty((9, _LANES)), np.empty(_LANES)
        last = (chunk + 1) * count // chunks
        for first in range(chunk * count // chunks, last, _LANES):
            rows = slice(first, min(first + _LANES, last))
            _full_frames(simplices[rows], quaternions[rows], scales[rows], valid[rows], work, columns, extents)


@_parallel
def gram_schmidt_frames(simplices, rest_scales, quaternions, scales, valid, chunks):
    """The paper's inverse: normal, first edge, Gram-Schmidt of the second; see `games.invert_simplices`."""
    count = simplices.shape[0]
    for chunk in numba.prange(chunks):
        columns = np.empty((3, 3))
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            valid[row] = _gram_schmidt_frame(simplices[row], rest_scales[row], columns, scales[row])
            if valid[row]:
                _finish(row, columns, quaternions)


@_function
def _columns(matrix):
    return (
        (matrix[0, 0], matrix[1, 0], matrix[2, 0]),
        (matrix[0, 1], matrix[1, 1], matrix[2, 1]),
        (matrix[0, 2], matrix[1, 2], matrix[2, 2]),
    )


@_function
def _polar_rotation(matrix, rotation):
    a, b, c = _columns(matrix)
    a, b, c, u, v, w = orthogonalised_with_turn(a, b, c)
    # Largest stretch first: where the matrix is inverted the flip has to hit the direction of the smallest one.
    x, y, z = _dot(a, a), _dot(b, b), _dot(c, c)
    if x < y:
        a, b, u, v, x, y = b, a, v, u, y, x
    if x < z:
        a, c, u, w, x, z = c, a, w, u, z, x
    if y < z:
        b, c, v, w = c, b, w, v
    w = _cross(u, v)
    a, b, c, _, found = frame(a, b, c)
    for i in range(3):
        for j in range(3):
            rotation[i, j] = a[i] * u[j] + b[i] * v[j] + c[i] * w[j] if found else (1.0 if i == j else 0.0)


@_parallel
def polar_rotations(matrices, rotations, chunks):
    """Nearest rotation, det +1, of every matrix; the identity where there is none (zero, not finite)."""
    count = matrices.shape[0]
    for chunk in numba.prange(chunks):
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            _polar_rotation(matrices[row], rotations[row])


@_function
def _bound_stretches(matrix, bound, bounded):
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += matrix[i, j] * matrix[i, j]
            bounded[i, j] = matrix[i, j]
    # No singular value exceeds the Frobenius norm: most rows need no decomposition.
    if not (square > bound * bound and math.isfinite(square)):
        return False
    a, b, c = _columns(matrix)
    a, b, c, u, v, w = orthogonalised_with_turn(a, b, c)
    x, y, z = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b)), math.sqrt(_dot(c, c))
    # A hair of tolerance, or rounding at rest would count as clipping with a bound of 1.
    if not max(x, y, z) > bound * (1 + 1e-9):
        return False
    a = _scaled(a, min(1.0, bound / x) if x > 0 else 1.0)
    b = _scaled(b, min(1.0, bound / y) if y > 0 else 1.0)
    c = _scaled(c, min(1.0, bound / z) if z > 0 else 1.0)
    for i in range(3):
        for j in range(3):
            bounded[i, j] = a[i] * u[j] + b[i] * v[j] + c[i] * w[j]
    return True


@_parallel
def bounded_stretches(matrices, bound, bounded, clipped, chunks):
    """U min(S, bound) V^T of every matrix U S V^T, and whether anything was above the bound."""
    count = matrices.shape[0]
    for chunk in numba.prange(chunks):
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            clipped[row] = _bound_stretches(matrices[row], bound, bounded[row])


def chunk_count(rows: int) -> int:
    """How many pieces a loop over `rows` is cut into: a few a thread, none smaller than a thousand rows."""
    return max(1, min(rows // 1000, 4 * numba.get_num_threads()))
