"""Polar and singular value decompositions of 3x3 matrices as Taichi functions, in the precision of their argument.

Taichi's own `ti.svd` is compiled for a fixed number of sweeps and loses digits in float64; nothing here does.
"""

from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["cofactors", "determinant_with", "proper_frames", "rotation_of", "singular_columns"]


@ti.func
def cofactors(F):
    """Cofactor matrix: det(F) F^-T."""
    return ti.Matrix(
        [
            [
                F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1],
                F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2],
                F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0],
            ],
            [
                F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2],
                F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0],
                F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1],
            ],
            [
                F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1],
                F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2],
                F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0],
            ],
        ]
    )


@ti.func
def determinant_with(F, K):
    """Determinant of F from its cofactors K."""
    return F[0, 0] * K[0, 0] + F[0, 1] * K[0, 1] + F[0, 2] * K[0, 2]


@ti.func
def singular_columns(F, tolerance):
    """One-sided Jacobi (Hestenes 1958): B = F V with orthogonal columns, and the rotation V.

    The lengths of B's columns are the singular values, unsorted, each to full relative accuracy; `tolerance` is the
    cosine between columns below which they count as orthogonal.
    """
    B = F
    V = ti.Matrix.identity(ti.i32, 3) + F * 0
    turning = 1
    sweep = 0
    while turning == 1 and sweep < 15:
        turning = 0
        for pair in ti.static(((0, 1), (0, 2), (1, 2))):
            i, j = ti.static(pair[0], pair[1])
            alpha = B[0, i] * B[0, i] + B[1, i] * B[1, i] + B[2, i] * B[2, i]
            beta = B[0, j] * B[0, j] + B[1, j] * B[1, j] + B[2, j] * B[2, j]
            gamma = B[0, i] * B[0, j] + B[1, i] * B[1, j] + B[2, i] * B[2, j]
            if ti.abs(gamma) > tolerance * ti.sqrt(alpha * beta):
                turning = 1
                zeta = (beta - alpha) / (2 * gamma)
                t = 1 / (ti.abs(zeta) + ti.sqrt(1 + zeta * zeta))
                if zeta < 0:
                    t = -t
                c = 1 / ti.sqrt(1 + t * t)
                s = c * t
                for k in ti.static(range(3)):
                    b = B[k, i]
                    B[k, i] = c * b - s * B[k, j]
                    B[k, j] = s * b + c * B[k, j]
                    w = V[k, i]
                    V[k, i] = c * w - s * V[k, j]
                    V[k, j] = s * w + c * V[k, j]
        sweep += 1
    return B, V


@ti.func
def _column(B, k: ti.template()):
    return ti.Vector([B[0, k], B[1, k], B[2, k]])


@ti.func
def proper_frames(B):
    """Rotation U (det +1) along the columns of B = F V: the column of the smallest one completes the other two.

    Where det F > 0 this is B with unit columns; where det F < 0 the smallest singular value has become negative.
    Of a matrix of rank 1 or 0 it is the identity.
    """
    one = B[0, 0] * 0 + 1
    b0, b1, b2 = _column(B, 0), _column(B, 1), _column(B, 2)
    n0, n1, n2 = b0.norm(), b1.norm(), b2.norm()
    u0 = b0 / ti.max(n0, one * 1e-30)
    u1 = b1 / ti.max(n1, one * 1e-30)
    u2 = b2 / ti.max(n2, one * 1e-30)
    if n0 <= n1 and n0 <= n2:
        u0 = u1.cross(u2)
    elif n1 <= n2:
        u1 = u2.cross(u0)
    else:
        u2 = u0.cross(u1)
    U = ti.Matrix.cols([u0, u1, u2])
    # Two of three columns without a direction: their cross product has no length, and no rotation is better than any.
    if not (u0.norm_sqr() > 0.5 and u1.norm_sqr() > 0.5 and u2.norm_sqr() > 0.5):
        U = ti.Matrix.identity(ti.i32, 3) + B * 0
    return U


@ti.func
def _square(A):
    """|A|^2, added up in a tree: a chain of nine additions is a long wait."""
    a = A[0, 0] * A[0, 0] + A[0, 1] * A[0, 1]
    b = A[0, 2] * A[0, 2] + A[1, 0] * A[1, 0]
    c = A[1, 1] * A[1, 1] + A[1, 2] * A[1, 2]
    d = A[2, 0] * A[2, 0] + A[2, 1] * A[2, 1]
    return ((a + b) + (c + d)) + A[2, 2] * A[2, 2]


@ti.func
def _closer(R):
    """A step of Newton's iteration."""
    L = cofactors(R)
    return (R + L * (1 / determinant_with(R, L))) * 0.5


@ti.func
def rotation_of(F, K, J, tolerance, cosine):
    """Rotation R (det +1) nearest to F, whose cofactors are K and determinant J.

    Newton's iteration (Higham 1986) where F is well away from singular, one-sided Jacobi elsewhere. Newton's error
    after a step is half the square of the step: it stops where |step|^2 < `tolerance`.
    """
    R = F
    size = F.norm_sqr() / 3
    if J > 0 and size * size * size * 1e-6 < J * J:
        R = (F + K / J) * 0.5
        step = _square(R - F)
        count = 0
        while step > tolerance and count < 20:
            R = _closer(R)
            # Half the square of the last step, which is known before this one is done.
            step = step * step / 4
            count += 1
    else:
        B, V = singular_columns(F, cosine)
        R = proper_frames(B) @ V.transpose()
    return R
