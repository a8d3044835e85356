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

_SWEEPS = 12
LANES = 8
"""Matrices worked on at once: square roots and divisions then run in vector registers, 3.5 times as fast."""
_ORTHOGONAL_SQUARED = 1e-28
"""Cosine^2 at which two columns count as orthogonal: an error of 1e-14 in a covariance, above what dots round to."""
VANISHED = 1e-14
"""Below this share of the largest column a column is rounding error and has no direction."""

# "contract" lets a product and a sum become one fused operation, which only rounds less.
inlined = numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
# Lanes hold finite numbers only; saying so lets a maximum over them be taken without a branch.
_lanewise = numba.njit(cache=True, error_model="numpy", fastmath={"contract", "nnan"})
parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)


@inlined
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def scaled(a, factor):
    """A vector times a number."""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


@inlined
def _combined(p, a, q, b):
    return (p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2])


@inlined
def rotation(a, b):
    """Cosine and sine that make columns a and b orthogonal, and whether they were."""
    aa, bb, ab = dot(a, a), dot(b, b), dot(a, b)
    if ab * ab <= _ORTHOGONAL_SQUARED * aa * bb:
        return 1.0, 0.0, True
    gap = bb - aa
    tangent = 2 * ab / (gap + math.copysign(math.sqrt(gap * gap + 4 * ab * ab), gap))
    cosine = 1 / math.sqrt(1 + tangent * tangent)
    return cosine, cosine * tangent, False


@inlined
def turned(a, b, cosine, sine):
    """Two columns turned by an angle."""
    return _combined(cosine, a, -sine, b), _combined(sine, a, cosine, b)


@_lanewise
def _turn_lanes(work, i, j):
    """One rotation of columns i and j in every lane; the largest tangent, which tells how far from done they were."""
    largest = 0.0
    for lane in range(LANES):
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


@inlined
def orthogonalise_lanes(work):
    """Columns of A V, orthogonal, in place of those of A, for the matrices in the lanes of `work` (9, lanes)."""
    for _ in range(_SWEEPS):
        largest = max(_turn_lanes(work, 0, 1), _turn_lanes(work, 0, 2), _turn_lanes(work, 1, 2))
        # Convergence is quadratic: what a sweep found at 1e-7 it left at 1e-14.
        if largest < 1e-7:
            break


@inlined
def orthogonalised_with_turn(a, b, c):
    """Columns of A V, orthogonal, and those of V."""
    u, v, w = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for _ in range(_SWEEPS):
        cosine, sine, done_ab = rotation(a, b)
        a, b = turned(a, b, cosine, sine)
        u, v = turned(u, v, cosine, sine)
        cosine, sine, done_ac = rotation(a, c)
        a, c = turned(a, c, cosine, sine)
        u, w = turned(u, w, cosine, sine)
        cosine, sine, done_bc = rotation(b, c)
        b, c = turned(b, c, cosine, sine)
        v, w = turned(v, w, cosine, sine)
        if done_ab and done_ac and done_bc:
            break
    return a, b, c, u, v, w


@inlined
def perpendicular(a):
    """A unit vector at right angles to the unit vector a."""
    if abs(a[0]) <= abs(a[1]) and abs(a[0]) <= abs(a[2]):
        p = cross(a, (1.0, 0.0, 0.0))
    elif abs(a[1]) <= abs(a[2]):
        p = cross(a, (0.0, 1.0, 0.0))
    else:
        p = cross(a, (0.0, 0.0, 1.0))
    return scaled(p, 1 / math.sqrt(dot(p, p)))


@inlined
def frame(a, b, c):
    """Right-handed unit axes and lengths of three orthogonal columns; vanished columns are filled in.

    The fourth result is False where nothing has a direction (all columns zero, or not finite).
    """
    x, y, z = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
    largest = max(x, y, z)
    if not (largest > 0.0 and math.isfinite(largest)):
        return a, b, c, (0.0, 0.0, 0.0), False
    floor = VANISHED * largest
    has_a, has_b, has_c = x > floor, y > floor, z > floor
    if has_a:
        a = scaled(a, 1 / x)
    if has_b:
        b = scaled(b, 1 / y)
    if has_c:
        c = scaled(c, 1 / z)
    if has_a and has_b:
        # Also where c exists: its sign is free, its direction is known better from the two larger ones only if it is
        # tiny, and the cross product is the one that makes det = +1 in either case.
        normal = cross(a, b)
        if has_c and dot(normal, c) < 0:
            c = scaled(c, -1.0)
        elif not has_c:
            c = normal
    elif has_a and has_c:
        b = cross(c, a)
    elif has_b and has_c:
        a = cross(b, c)
    elif has_a:
        b = perpendicular(a)
        c = cross(a, b)
    elif has_b:
        c = perpendicular(b)
        a = cross(b, c)
    else:
        a = perpendicular(c)
        b = cross(c, a)
    return a, b, c, (x if has_a else 0.0, y if has_b else 0.0, z if has_c else 0.0), True


@inlined
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


@inlined
def _columns(matrix):
    return (
        (matrix[0, 0], matrix[1, 0], matrix[2, 0]),
        (matrix[0, 1], matrix[1, 1], matrix[2, 1]),
        (matrix[0, 2], matrix[1, 2], matrix[2, 2]),
    )


@inlined
def _polar_rotation(matrix, rotation):
    a, b, c = _columns(matrix)
    a, b, c, u, v, w = orthogonalised_with_turn(a, b, c)
    # Largest stretch first: where the matrix is inverted the flip has to hit the direction of the smallest one.
    x, y, z = dot(a, a), dot(b, b), dot(c, c)
    if x < y:
        a, b, u, v, x, y = b, a, v, u, y, x
    if x < z:
        a, c, u, w, x, z = c, a, w, u, z, x
    if y < z:
        b, c, v, w = c, b, w, v
    w = cross(u, v)
    a, b, c, _, found = frame(a, b, c)
    for i in range(3):
        for j in range(3):
            rotation[i, j] = a[i] * u[j] + b[i] * v[j] + c[i] * w[j] if found else (1.0 if i == j else 0.0)


@parallel
def polar_rotations(matrices, rotations, chunks):
    """Nearest rotation, det +1, of every matrix; the identity where there is none (zero, not finite)."""
    count = matrices.shape[0]
    for chunk in numba.prange(chunks):
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            _polar_rotation(matrices[row], rotations[row])


@inlined
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
    x, y, z = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
    # A hair of tolerance, or rounding at rest would count as clipping with a bound of 1.
    if not max(x, y, z) > bound * (1 + 1e-9):
        return False
    a = scaled(a, min(1.0, bound / x) if x > 0 else 1.0)
    b = scaled(b, min(1.0, bound / y) if y > 0 else 1.0)
    c = scaled(c, min(1.0, bound / z) if z > 0 else 1.0)
    for i in range(3):
        for j in range(3):
            bounded[i, j] = a[i] * u[j] + b[i] * v[j] + c[i] * w[j]
    return True


@parallel
def bounded_stretches(matrices, bound, bounded, clipped, chunks):
    """U min(S, bound) V^T of every matrix U S V^T, and whether anything was above the bound."""
    count = matrices.shape[0]
    for chunk in numba.prange(chunks):
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            clipped[row] = _bound_stretches(matrices[row], bound, bounded[row])


def chunk_count(rows: int) -> int:
    """How many pieces a loop over `rows` is cut into: a few a thread, none smaller than a thousand rows."""
    return max(1, min(rows // 1000, 4 * numba.get_num_threads()))
