# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is transfer.py.
"""Compiled kernels that move all simplices of a body by those of its cores."""

from __future__ import annotations

import numba
import numpy as np

from gasp_core.reduction.prefetch import bring_to_read, bring_to_write
from gasp_core.simplex_frames import flat_order

_float = numba.float64
_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)

NEIGHBOURS = 8
"""Of every row, in `carry_affinely`."""
COLUMNS = 16
"""Of the table of cores in `carry_affinely`: two cache lines a row, for the loop waits for memory."""
_TAKEN = 64
"""Rows at a time, which stay in the first cache."""
_AHEAD = 16
"""Rows before it is read that a core is brought."""
_TINY = float(np.finfo(np.float64).tiny)


@_parallel
def affine_table(points, displacements, table, chunks):
    """Rows for `carry_affinely` from the corners (C, V, 3) of cores and how far they are displaced."""
    count, corners = points.shape[0], points.shape[1]
    for chunk in numba.prange(chunks):
        for core in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            row = table[core]
            row[:15] = 0.0
            row[15] = 1.0
            for v in range(corners):
                for i in range(3):
                    row[i] += displacements[core, v, i] / corners
                    row[3 + i] += points[core, v, i] / corners
                    for j in range(3):
                        row[6 + 3 * i + j] += displacements[core, v, i] * points[core, v, j] / corners


@_parallel
def carry_affinely(rest, cores, order, neighbours, weights, inverses, out, chunks):
    """out = rest + the affine fit to the neighbouring cores; see `transfer.LeastSquares`.

    A row of `cores`: mean displacement u, centre c, mean of u_v x_v^T over the corners row by row, and 1. `rest` and
    `out` lie in memory row after row.
    """
    count, vertices = rest.shape[0], rest.shape[1]
    size = 3 * vertices * rest.itemsize
    for chunk in numba.prange(chunks):
        sums = np.empty(COLUMNS)
        taken = np.empty((_TAKEN, vertices, 3))
        last = (chunk + 1) * count // chunks
        for first in range(chunk * count // chunks, last, _TAKEN):
            rows = order[first : min(first + _TAKEN, last)]
            ahead = order[first + len(rows) : min(first + 2 * len(rows), last)]
            # Rows lie anywhere: while some are worked on, the memory of the next is brought.
            for place in range(len(rows)):
                for vertex in range(vertices):
                    for i in range(3):
                        taken[place, vertex, i] = rest[rows[place], vertex, i]
            for place in range(len(rows)):
                index = first + place
                if place < len(ahead):
                    bring_to_read(rest.ctypes.data + ahead[place] * size, size)
                bring_to_write(out.ctypes.data + rows[place] * size, size)
                sums[:] = 0.0
                # Eight at a time, written out: what is summed then stays in registers, half the time of a loop.
                own, near = weights[index], neighbours[index]
                w0, w1, w2, w3 = _float(own[0]), _float(own[1]), _float(own[2]), _float(own[3])
                w4, w5, w6, w7 = _float(own[4]), _float(own[5]), _float(own[6]), _float(own[7])
                c0, c1, c2, c3 = cores[near[0]], cores[near[1]], cores[near[2]], cores[near[3]]
                c4, c5, c6, c7 = cores[near[4]], cores[near[5]], cores[near[6]], cores[near[7]]
                for j in range(COLUMNS):
                    first_four = w0 * c0[j] + w1 * c1[j] + w2 * c2[j] + w3 * c3[j]
                    sums[j] += first_four + w4 * c4[j] + w5 * c5[j] + w6 * c6[j] + w7 * c7[j]
                # Weights in float32 add up to 1 but for rounding, which the difference of moments below would show.
                share = 1 / sums[15]
                p0, p1, p2 = share * sums[3], share * sums[4], share * sums[5]
                xx, xy, xz = inverses[index, 0], inverses[index, 1], inverses[index, 2]
                yy, yz, zz = inverses[index, 3], inverses[index, 4], inverses[index, 5]
                s0, s1, s2 = share * sums[0], share * sums[1], share * sums[2]
                a0 = share * sums[6] - s0 * p0
                a1 = share * sums[7] - s0 * p1
                a2 = share * sums[8] - s0 * p2
                g00 = a0 * xx + a1 * xy + a2 * xz
                g01 = a0 * xy + a1 * yy + a2 * yz
                g02 = a0 * xz + a1 * yz + a2 * zz
                a0 = share * sums[9] - s1 * p0
                a1 = share * sums[10] - s1 * p1
                a2 = share * sums[11] - s1 * p2
                g10 = a0 * xx + a1 * xy + a2 * xz
                g11 = a0 * xy + a1 * yy + a2 * yz
                g12 = a0 * xz + a1 * yz + a2 * zz
                a0 = share * sums[12] - s2 * p0
                a1 = share * sums[13] - s2 * p1
                a2 = share * sums[14] - s2 * p2
                g20 = a0 * xx + a1 * xy + a2 * xz
                g21 = a0 * xy + a1 * yy + a2 * yz
                g22 = a0 * xz + a1 * yz + a2 * zz
                for vertex in range(vertices):
                    x, y, z = taken[place, vertex, 0], taken[place, vertex, 1], taken[place, vertex, 2]
                    q0, q1, q2 = x - p0, y - p1, z - p2
                    taken[place, vertex, 0] = x + (s0 + g00 * q0 + g01 * q1 + g02 * q2)
                    taken[place, vertex, 1] = y + (s1 + g10 * q0 + g11 * q1 + g12 * q2)
                    taken[place, vertex, 2] = z + (s2 + g20 * q0 + g21 * q1 + g22 * q2)
            for place in range(len(rows)):
                for vertex in range(vertices):
                    for i in range(3):
                        out[rows[place], vertex, i] = taken[place, vertex, i]


@_parallel
def carry_rigidly(rest, cores, labels, rows, out, chunks):
    """out[rows] = rest + the motion of one core's frame; see `transfer.OneFrame`.

    A row of `cores`: displacement of the core's mean, the mean, and the change of its rotation, row by row.
    """
    count, vertices = rows.shape[0], rest.shape[1]
    size = cores.shape[1] * cores.itemsize
    for chunk in numba.prange(chunks):
        last = (chunk + 1) * count // chunks
        for index in range(chunk * count // chunks, last):
            row = rows[index]
            if index + _AHEAD < last:
                bring_to_read(cores.ctypes.data + labels[rows[index + _AHEAD]] * size, size)
            core = cores[labels[row]]
            for vertex in range(vertices):
                x, y, z = rest[row, vertex, 0], rest[row, vertex, 1], rest[row, vertex, 2]
                q0, q1, q2 = x - core[3], y - core[4], z - core[5]
                out[row, vertex, 0] = x + (core[0] + core[6] * q0 + core[7] * q1 + core[8] * q2)
                out[row, vertex, 1] = y + (core[1] + core[9] * q0 + core[10] * q1 + core[11] * q2)
                out[row, vertex, 2] = z + (core[2] + core[12] * q0 + core[13] * q1 + core[14] * q2)


@_parallel
def rows_in_question(simplices, scales, bound, found, chunks):
    """Whether each simplex (N, V, 3) may be clipped or give no frame; see `shape_flags`, whose words these are."""
    count, vertices = simplices.shape[0], simplices.shape[1]
    for chunk in numba.prange(chunks):
        axes = np.arange(3)
        for row in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            if vertices == 3:
                _, axes[0], axes[1] = flat_order(scales[row])
            total, longest = 4.0 - vertices, 0.0
            for edge in range(vertices - 1):
                square = 0.0
                for axis in range(3):
                    square += (simplices[row, edge + 1, axis] - simplices[row, 0, axis]) ** 2
                rest = scales[row, axes[edge]]
                total += square / (rest * rest) if rest > 0.0 else 1.0
                longest = max(longest, square)
            # Squares that under- or overflow say nothing of the edges.
            found[row] = not (longest > _TINY and total < bound)
