# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is point_frames.py.
"""Compiled kernels that move all simplices of a body by material points around them."""

from __future__ import annotations

import numba
import numpy as np

_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)

COLUMNS = 12
"""Of the table of affine maps: b, then G row by row."""
THIN = 1e-4
"""Least determinant of second moments, of those of as wide a ball: thinner neighbourhoods tell no gradient."""


@_parallel
def affine_maps(points, displacements, neighbours, reach, torn, table, chunks):
    """For each point the affine fit y -> y + b + G y to its own displacement and its neighbours', in `table`.

    A neighbour that is more than `torn` times as far as at rest has been torn off and does not count; one that is the
    point itself stands for none. Weights go as (1 - (r / reach)^2)^2.
    """
    count, most = neighbours.shape
    for chunk in numba.prange(chunks):
        moments, products, inverse = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
        for p in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            total = 1.0
            c0 = c1 = c2 = s0 = s1 = s2 = 0.0
            moments[:], products[:] = 0.0, 0.0
            limit = reach * reach
            # About the point itself; the means are taken off below.
            for k in range(most):
                q = neighbours[p, k]
                if q == p:
                    continue
                x = points[q, 0] - points[p, 0]
                y = points[q, 1] - points[p, 1]
                z = points[q, 2] - points[p, 2]
                u = displacements[q, 0] - displacements[p, 0]
                v = displacements[q, 1] - displacements[p, 1]
                w = displacements[q, 2] - displacements[p, 2]
                square = x * x + y * y + z * z
                now = (x + u) * (x + u) + (y + v) * (y + v) + (z + w) * (z + w)
                if now > torn * torn * square or square >= limit:
                    continue
                share = 1.0 - square / limit
                weight = share * share
                total += weight
                c0 += weight * x
                c1 += weight * y
                c2 += weight * z
                s0 += weight * u
                s1 += weight * v
                s2 += weight * w
                moments[0, 0] += weight * x * x
                moments[0, 1] += weight * x * y
                moments[0, 2] += weight * x * z
                moments[1, 1] += weight * y * y
                moments[1, 2] += weight * y * z
                moments[2, 2] += weight * z * z
                products[0, 0] += weight * u * x
                products[0, 1] += weight * u * y
                products[0, 2] += weight * u * z
                products[1, 0] += weight * v * x
                products[1, 1] += weight * v * y
                products[1, 2] += weight * v * z
                products[2, 0] += weight * w * x
                products[2, 1] += weight * w * y
                products[2, 2] += weight * w * z
            c0, c1, c2 = c0 / total, c1 / total, c2 / total
            s0, s1, s2 = s0 / total, s1 / total, s2 / total
            xx = moments[0, 0] / total - c0 * c0
            xy = moments[0, 1] / total - c0 * c1
            xz = moments[0, 2] / total - c0 * c2
            yy = moments[1, 1] / total - c1 * c1
            yz = moments[1, 2] / total - c1 * c2
            zz = moments[2, 2] / total - c2 * c2
            inverse[0, 0] = yy * zz - yz * yz
            inverse[0, 1] = inverse[1, 0] = xz * yz - xy * zz
            inverse[0, 2] = inverse[2, 0] = xy * yz - xz * yy
            inverse[1, 1] = xx * zz - xz * xz
            inverse[1, 2] = inverse[2, 1] = xy * xz - xx * yz
            inverse[2, 2] = xx * yy - xy * xy
            determinant = xx * inverse[0, 0] + xy * inverse[0, 1] + xz * inverse[0, 2]
            mean = (xx + yy + zz) / 3.0
            row = table[p]
            row[3:] = 0.0
            if determinant > THIN * mean * mean * mean:
                for i in range(3):
                    si = s0 if i == 0 else (s1 if i == 1 else s2)
                    a0 = products[i, 0] / total - si * c0
                    a1 = products[i, 1] / total - si * c1
                    a2 = products[i, 2] / total - si * c2
                    for j in range(3):
                        row[3 + 3 * i + j] = (
                            a0 * inverse[0, j] + a1 * inverse[1, j] + a2 * inverse[2, j]
                        ) / determinant
                # The fit goes through the mean of the neighbourhood.
                c0 += points[p, 0]
                c1 += points[p, 1]
                c2 += points[p, 2]
            else:
                s0 = s1 = s2 = 0.0
            for i in range(3):
                si = s0 if i == 0 else (s1 if i == 1 else s2)
                turned = row[3 + 3 * i] * c0 + row[4 + 3 * i] * c1 + row[5 + 3 * i] * c2
                row[i] = displacements[p, i] + si - turned


@_parallel
def carry_by_points(rest, start, points, table, order, labels, weights, apart, out, chunks):
    """out = start + the mean of the affine maps of the points that each simplex (N, V, 3) follows.

    The first of `labels` (N, K), which are of the simplices in this `order`, is the own one; another counts by its
    weight unless it would take the first vertex of `rest` elsewhere by more than `apart`: it is of another piece then.
    A row without any weight is too far off for a gradient: it moves as its own point does.
    """
    count, most = labels.shape
    vertices = rest.shape[1]
    for chunk in numba.prange(chunks):
        sums = np.empty(COLUMNS)
        for index in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            n = order[index]
            own = table[labels[index, 0]]
            x, y, z = rest[n, 0, 0], rest[n, 0, 1], rest[n, 0, 2]
            m0 = own[0] + own[3] * x + own[4] * y + own[5] * z
            m1 = own[1] + own[6] * x + own[7] * y + own[8] * z
            m2 = own[2] + own[9] * x + own[10] * y + own[11] * z
            total = 0.0
            sums[:] = 0.0
            for k in range(most):
                weight = weights[index, k]
                if weight <= 0.0:
                    continue
                other = table[labels[index, k]]
                if k > 0:
                    d0 = other[0] + other[3] * x + other[4] * y + other[5] * z - m0
                    d1 = other[1] + other[6] * x + other[7] * y + other[8] * z - m1
                    d2 = other[2] + other[9] * x + other[10] * y + other[11] * z - m2
                    if d0 * d0 + d1 * d1 + d2 * d2 > apart * apart:
                        continue
                total += weight
                for j in range(COLUMNS):
                    sums[j] += weight * other[j]
            if total > 0.0:
                share = 1.0 / total
                for j in range(COLUMNS):
                    sums[j] *= share
            else:
                p = labels[index, 0]
                x, y, z = points[p, 0], points[p, 1], points[p, 2]
                for i in range(3):
                    sums[i] = own[i] + own[3 + 3 * i] * x + own[4 + 3 * i] * y + own[5 + 3 * i] * z
            for vertex in range(vertices):
                x, y, z = start[n, vertex, 0], start[n, vertex, 1], start[n, vertex, 2]
                out[n, vertex, 0] = x + (sums[0] + sums[3] * x + sums[4] * y + sums[5] * z)
                out[n, vertex, 1] = y + (sums[1] + sums[6] * x + sums[7] * y + sums[8] * z)
                out[n, vertex, 2] = z + (sums[2] + sums[9] * x + sums[10] * y + sums[11] * z)
