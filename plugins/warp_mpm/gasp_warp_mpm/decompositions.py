# ruff: noqa: RUF046, SIM300, UP018 - Warp tells a variable int(0) from a constant 0.
"""Polar and singular value decompositions of 3x3 matrices as Warp functions.

Warp's own `wp.svd3` is a fixed number of sweeps of approximate rotations and loses digits in float64; nothing here
does.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

__all__ = ["algebra", "make_decompositions"]


@cache
def algebra(real: Any) -> SimpleNamespace:
    """Vectors and matrices over wp.float32 or wp.float64."""
    return SimpleNamespace(
        vec2=wp.types.vector(2, real),
        vec3=wp.types.vector(3, real),
        vec4=wp.types.vector(4, real),
        mat33=wp.types.matrix((3, 3), real),
    )


@cache
def make_decompositions(real: Any) -> SimpleNamespace:
    """Functions over 3x3 matrices of wp.float32 or wp.float64.

    cofactors(F), determinant_with(F, K), singular_columns(F, tolerance), proper_frames(B), rotation_of(F, K, J,
    tolerance, cosine).
    """
    types = algebra(real)
    vec3, mat33 = types.vec3, types.mat33
    zero, half, one, two, three = (real(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
    tiny = real(1e-30)
    well_shaped = real(1e-6)

    @wp.func
    def cofactors(F: mat33):
        """Cofactor matrix: det(F) F^-T."""
        return mat33(
            F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1],
            F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2],
            F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0],
            F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2],
            F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0],
            F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1],
            F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1],
            F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2],
            F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0],
        )

    @wp.func
    def determinant_with(F: mat33, K: mat33):
        """Determinant of F from its cofactors K."""
        return F[0, 0] * K[0, 0] + F[0, 1] * K[0, 1] + F[0, 2] * K[0, 2]

    @wp.func
    def column(B: mat33, k: int):
        return vec3(B[0, k], B[1, k], B[2, k])

    @wp.func
    def turn(B: mat33, V: mat33, i: int, j: int, tolerance: real):
        """Make columns i and j of B orthogonal, where they are not; and whether they were not."""
        bi, bj = column(B, i), column(B, j)
        alpha = wp.dot(bi, bi)
        beta = wp.dot(bj, bj)
        gamma = wp.dot(bi, bj)
        turned = int(0)
        if wp.abs(gamma) > tolerance * wp.sqrt(alpha * beta):
            turned = int(1)
            zeta = (beta - alpha) / (two * gamma)
            t = one / (wp.abs(zeta) + wp.sqrt(one + zeta * zeta))
            if zeta < zero:
                t = -t
            c = one / wp.sqrt(one + t * t)
            s = c * t
            for k in range(3):
                b = B[k, i]
                B[k, i] = c * b - s * B[k, j]
                B[k, j] = s * b + c * B[k, j]
                w = V[k, i]
                V[k, i] = c * w - s * V[k, j]
                V[k, j] = s * w + c * V[k, j]
        return B, V, turned

    @wp.func
    def singular_columns(F: mat33, tolerance: real):
        """One-sided Jacobi (Hestenes 1958): B = F V with orthogonal columns, and the rotation V.

        The lengths of B's columns are the singular values, unsorted, each to full relative accuracy; `tolerance` is
        the cosine between columns below which they count as orthogonal.
        """
        B = F * one
        V = wp.identity(n=3, dtype=real)
        turning = int(1)
        sweep = int(0)
        while turning > 0 and sweep < 15:
            B, V, first = turn(B, V, 0, 1, tolerance)
            B, V, second = turn(B, V, 0, 2, tolerance)
            B, V, third = turn(B, V, 1, 2, tolerance)
            turning = first + second + third
            sweep += 1
        return B, V

    @wp.func
    def proper_frames(B: mat33):
        """Rotation U (det +1) along the columns of B = F V: the column of the smallest one completes the other two.

        Where det F > 0 this is B with unit columns; where det F < 0 the smallest singular value has become negative.
        Of a matrix of rank 1 or 0 it is the identity.
        """
        b0, b1, b2 = column(B, 0), column(B, 1), column(B, 2)
        n0, n1, n2 = wp.length(b0), wp.length(b1), wp.length(b2)
        u0 = b0 / wp.max(n0, tiny)
        u1 = b1 / wp.max(n1, tiny)
        u2 = b2 / wp.max(n2, tiny)
        if n0 <= n1 and n0 <= n2:
            u0 = wp.cross(u1, u2)
        elif n1 <= n2:
            u1 = wp.cross(u2, u0)
        else:
            u2 = wp.cross(u0, u1)
        U = mat33(u0[0], u1[0], u2[0], u0[1], u1[1], u2[1], u0[2], u1[2], u2[2])
        # Two of three columns without a direction: their cross product has no length, and no rotation is better than
        # any.
        if not (wp.length_sq(u0) > half and wp.length_sq(u1) > half and wp.length_sq(u2) > half):
            U = wp.identity(n=3, dtype=real)
        return U

    @wp.func
    def rotation_of(F: mat33, K: mat33, J: real, tolerance: real, cosine: real):
        """Rotation R (det +1) nearest to F, whose cofactors are K and determinant J.

        Newton's iteration (Higham 1986) where F is well away from singular, one-sided Jacobi elsewhere. Newton's
        error after a step is half the square of the step: it stops where |step|^2 < `tolerance`.
        """
        R = F * one
        size = wp.ddot(F, F) / three
        if J > zero and size * size * size * well_shaped < J * J:
            R = (F + K / J) * half
            D = R - F
            step = wp.ddot(D, D)
            count = int(0)
            while step > tolerance and count < 20:
                L = cofactors(R)
                S = (R + L / determinant_with(R, L)) * half
                D = S - R
                step = wp.ddot(D, D)
                R = S
                count += 1
        else:
            B, V = singular_columns(F, cosine)
            R = proper_frames(B) @ wp.transpose(V)
        return R

    return SimpleNamespace(
        cofactors=cofactors,
        determinant_with=determinant_with,
        singular_columns=singular_columns,
        proper_frames=proper_frames,
        rotation_of=rotation_of,
    )
