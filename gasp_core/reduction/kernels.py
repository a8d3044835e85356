# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is transfer.py.
"""Compiled kernels that move all simplices of a body by those of its cores."""

from __future__ import annotations

import numba
import numpy as np

_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)

COLUMNS = 16
"""Of the table of cores in `carry_affinely`: two cache lines a row, for the loop waits for memory."""


@_parallel
def carry_affinely(rest, cores, neighbours, weights, inverses, out, chunks):
    """out = rest + the affine fit to the neighbouring cores; see `transfer.LeastSquares`.

    A row of `cores`: mean displacement u, centre c, mean of u_v x_v^T over the corners row by row, and 1.
    """
    count, vertices = rest.shape[0], rest.shape[1]
    for chunk in numba.prange(chunks):
        sums = np.empty(COLUMNS)
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            sums[:] = 0.0
            for k in range(neighbours.shape[1]):
                weight = numba.float64(weights[row, k])
                core = cores[neighbours[row, k]]
                for column in range(COLUMNS):
                    sums[column] += weight * core[column]
            # Weights in float32 add up to 1 but for rounding, which the difference of moments below would show.
            share = 1 / sums[15]
            p0, p1, p2 = share * sums[3], share * sums[4], share * sums[5]
            for i in range(3):
                shift = share * sums[i]
                a0 = share * sums[6 + 3 * i] - shift * p0
                a1 = share * sums[7 + 3 * i] - shift * p1
                a2 = share * sums[8 + 3 * i] - shift * p2
                xx, xy, xz = inverses[row, 0], inverses[row, 1], inverses[row, 2]
                yy, yz, zz = inverses[row, 3], inverses[row, 4], inverses[row, 5]
                g0, g1, g2 = a0 * xx + a1 * xy + a2 * xz, a0 * xy + a1 * yy + a2 * yz, a0 * xz + a1 * yz + a2 * zz
                for vertex in range(vertices):
                    x, y, z = rest[row, vertex, 0], rest[row, vertex, 1], rest[row, vertex, 2]
                    moved = shift + g0 * (x - p0) + g1 * (y - p1) + g2 * (z - p2)
                    out[row, vertex, i] = rest[row, vertex, i] + moved


@_parallel
def carry_rigidly(rest, cores, labels, rows, out, chunks):
    """out[rows] = rest + the motion of one core's frame; see `transfer.OneFrame`.

    A row of `cores`: displacement of the core's mean, the mean, and the change of its rotation, row by row.
    """
    count, vertices = rows.shape[0], rest.shape[1]
    for chunk in numba.prange(chunks):
        for index in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            row = rows[index]
            core = cores[labels[row]]
            for vertex in range(vertices):
                x, y, z = rest[row, vertex, 0], rest[row, vertex, 1], rest[row, vertex, 2]
                q0, q1, q2 = x - core[3], y - core[4], z - core[5]
                out[row, vertex, 0] = x + (core[0] + core[6] * q0 + core[7] * q1 + core[8] * q2)
                out[row, vertex, 1] = y + (core[1] + core[9] * q0 + core[10] * q1 + core[11] * q2)
                out[row, vertex, 2] = z + (core[2] + core[12] * q0 + core[13] * q1 + core[14] * q2)
