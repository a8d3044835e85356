# pyright: basic
# numba's decorators carry no types; the typed, documented face of these kernels is point_frames.py.
"""Compiled kernels that move all simplices of a body by material points around them."""

from __future__ import annotations

import numba
import numpy as np

from gasp_core.reduction.prefetch import bring_to_read, bring_to_write

_parallel = numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, parallel=True)

COLUMNS = 12
"""Of the table of affine maps: b, then G row by row."""
_BATCH = 64
"""Simplices at a time, whose vertices stay in the nearest cache."""
THIN = 1e-4
"""Least determinant of second moments, of those of as wide a ball: thinner neighbourhoods tell no gradient."""


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _fit(points, displacements, p, neighbours, limit, torn, work, row):
    """The affine fit of point p, into `row`, to those of its neighbours that are not `torn` times as far as at rest.

    Returns whether any was left out, and which share of the scatter of the displacements is not explained.
    """
    moments, products, inverse = work
    moments[:], products[:] = 0.0, 0.0
    total, square_sum = 1.0, 0.0
    c0 = c1 = c2 = s0 = s1 = s2 = 0.0
    left_out = False
    # About the point itself; the means are taken off below.
    for q in neighbours[p]:
        if q == p:
            continue
        x = points[q, 0] - points[p, 0]
        y = points[q, 1] - points[p, 1]
        z = points[q, 2] - points[p, 2]
        square = x * x + y * y + z * z
        if square >= limit:
            continue
        u = displacements[q, 0] - displacements[p, 0]
        v = displacements[q, 1] - displacements[p, 1]
        w = displacements[q, 2] - displacements[p, 2]
        now = (x + u) * (x + u) + (y + v) * (y + v) + (z + w) * (z + w)
        if now > torn * torn * square:
            left_out = True
            continue
        share = 1.0 - square / limit
        weight = share * share
        total += weight
        square_sum += weight * (u * u + v * v + w * w)
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
    scatter = square_sum / total - (s0 * s0 + s1 * s1 + s2 * s2)
    row[:] = 0.0
    if not determinant > THIN * mean * mean * mean:
        row[0], row[1], row[2] = displacements[p, 0], displacements[p, 1], displacements[p, 2]
        return left_out, 1.0
    explained = size = 0.0
    for i in range(3):
        si = s0 if i == 0 else (s1 if i == 1 else s2)
        a0 = products[i, 0] / total - si * c0
        a1 = products[i, 1] / total - si * c1
        a2 = products[i, 2] / total - si * c2
        for j in range(3):
            entry = (a0 * inverse[0, j] + a1 * inverse[1, j] + a2 * inverse[2, j]) / determinant
            row[3 + 3 * i + j] = entry
            explained += entry * (a0 if j == 0 else (a1 if j == 1 else a2))
            size += entry * entry
    spread = row[3] + row[7] + row[11]
    excess = 3.0 * (torn * torn - 1.0)
    if size + 2.0 * spread > excess:
        share = (np.sqrt(spread * spread + size * excess) - spread) / size
        for k in range(3, 12):
            row[k] *= share
    # The fit goes through the mean of the neighbourhood.
    c0, c1, c2 = c0 + points[p, 0], c1 + points[p, 1], c2 + points[p, 2]
    for i in range(3):
        si = s0 if i == 0 else (s1 if i == 1 else s2)
        turned = row[3 + 3 * i] * c0 + row[4 + 3 * i] * c1 + row[5 + 3 * i] * c2
        row[i] = displacements[p, i] + si - turned
    return left_out, 1.0 - explained / scatter if scatter > 0.0 else 0.0


@_parallel
def affine_maps(points, displacements, rows, neighbours, reach, torn, whole, table, chunks):
    """For each point of `rows` the affine fit y -> y + b + G y to its own displacement and its neighbours', in `table`.

    A neighbour that is more than `torn` times as far as at rest has been torn off and does not count, unless all go
    together: one affine map explains all but a share `whole` of how their displacements scatter. One that is the point
    itself stands for none. Weights go as (1 - (r / reach)^2)^2. Of what is left no gradient may stretch by more than
    `torn` either: where matter is stirred, the few neighbours that stayed may lie along a line by chance, and tell
    across it whatever their scatter is. The gradient is then shrunk towards none, |I + G| to that of I times `torn`.
    """
    count, limit = len(rows), reach * reach
    for chunk in numba.prange(chunks):
        work = np.empty((3, 3, 3))
        for p in rows[chunk * count // chunks : (chunk + 1) * count // chunks]:
            left_out, _ = _fit(points, displacements, p, neighbours, limit, torn, work, table[p])
            if left_out:
                _, unexplained = _fit(points, displacements, p, neighbours, limit, np.inf, work, table[p])
                if unexplained > whole:
                    _fit(points, displacements, p, neighbours, limit, torn, work, table[p])


@_parallel
def follow(points, neighbours, places, labels, lengths, chunks):
    """To each own point, `labels[:, 0]`, of places (N, 3) the nearest of that one's neighbours, in `labels` (N, F), and
    how far they are, in `lengths`; infinity where there are fewer."""
    count, most = labels.shape
    for chunk in numba.prange(chunks):
        for n in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            own = labels[n, 0]
            labels[n, 1:] = own
            lengths[n, 1:] = np.inf
            for neighbour in neighbours[own]:
                if neighbour == own:
                    continue
                x = points[neighbour, 0] - places[n, 0]
                y = points[neighbour, 1] - places[n, 1]
                z = points[neighbour, 2] - places[n, 2]
                length = np.sqrt(x * x + y * y + z * z)
                k = most
                while k > 1 and length < lengths[n, k - 1]:
                    k -= 1
                    if k + 1 < most:
                        labels[n, k + 1], lengths[n, k + 1] = labels[n, k], lengths[n, k]
                if k < most:
                    labels[n, k], lengths[n, k] = neighbour, length


@_parallel
def carry_by_points(rest, start, points, table, order, labels, weights, apart, out, chunks):
    """out = start + the mean of the affine maps of the points that each simplex (N, V, 3) follows.

    The first of `labels` (N, K), which are of the simplices in this `order`, is the own one; another counts by its
    weight unless it would take the first vertex of `rest` elsewhere by more than `apart`: it is of another piece then.
    One whose own has no weight is too far off for a gradient: it moves as its own point does.
    """
    count, most = labels.shape
    vertices = rest.shape[1]
    limit = apart * apart
    width = 3 * vertices * rest.itemsize
    moved_on = start.ctypes.data != rest.ctypes.data
    for chunk in numba.prange(chunks):
        begin, end = chunk * count // chunks, (chunk + 1) * count // chunks
        # Rows lie anywhere: while some are worked on, the memory of the next is brought.
        first, moved = np.empty((_BATCH, 3)), np.empty((_BATCH, vertices, 3))
        for batch in range(begin, end, _BATCH):
            size = min(_BATCH, end - batch)
            for i in range(size):
                n = order[batch + i]
                first[i, 0], first[i, 1], first[i, 2] = rest[n, 0, 0], rest[n, 0, 1], rest[n, 0, 2]
                for vertex in range(vertices):
                    for axis in range(3):
                        moved[i, vertex, axis] = start[n, vertex, axis]
            for i in range(size):
                if batch + _BATCH + i < end:
                    ahead = order[batch + _BATCH + i]
                    bring_to_read(start.ctypes.data + ahead * width, width)
                    if moved_on:
                        bring_to_read(rest.ctypes.data + ahead * width, 3 * rest.itemsize)
                bring_to_write(out.ctypes.data + order[batch + i] * width, width)
                p = labels[batch + i, 0]
                x, y, z = first[i, 0], first[i, 1], first[i, 2]
                # Rows of the map: scalars, which stay in registers.
                a, a0, a1, a2 = table[p, 0], table[p, 3], table[p, 4], table[p, 5]
                b, b0, b1, b2 = table[p, 1], table[p, 6], table[p, 7], table[p, 8]
                c, c0, c1, c2 = table[p, 2], table[p, 9], table[p, 10], table[p, 11]
                total = np.float64(weights[batch + i, 0])
                if total > 0.0:
                    u = a + a0 * x + a1 * y + a2 * z
                    v = b + b0 * x + b1 * y + b2 * z
                    w = c + c0 * x + c1 * y + c2 * z
                    a, a0, a1, a2 = total * a, total * a0, total * a1, total * a2
                    b, b0, b1, b2 = total * b, total * b0, total * b1, total * b2
                    c, c0, c1, c2 = total * c, total * c0, total * c1, total * c2
                    for k in range(1, most):
                        weight = np.float64(weights[batch + i, k])
                        q = labels[batch + i, k]
                        du = table[q, 0] + table[q, 3] * x + table[q, 4] * y + table[q, 5] * z - u
                        dv = table[q, 1] + table[q, 6] * x + table[q, 7] * y + table[q, 8] * z - v
                        dw = table[q, 2] + table[q, 9] * x + table[q, 10] * y + table[q, 11] * z - w
                        if du * du + dv * dv + dw * dw > limit:
                            continue
                        total += weight
                        a += weight * table[q, 0]
                        b += weight * table[q, 1]
                        c += weight * table[q, 2]
                        a0 += weight * table[q, 3]
                        a1 += weight * table[q, 4]
                        a2 += weight * table[q, 5]
                        b0 += weight * table[q, 6]
                        b1 += weight * table[q, 7]
                        b2 += weight * table[q, 8]
                        c0 += weight * table[q, 9]
                        c1 += weight * table[q, 10]
                        c2 += weight * table[q, 11]
                    share = 1.0 / total
                    a, a0, a1, a2 = share * a, share * a0, share * a1, share * a2
                    b, b0, b1, b2 = share * b, share * b0, share * b1, share * b2
                    c, c0, c1, c2 = share * c, share * c0, share * c1, share * c2
                else:
                    x, y, z = points[p, 0], points[p, 1], points[p, 2]
                    a += a0 * x + a1 * y + a2 * z
                    b += b0 * x + b1 * y + b2 * z
                    c += c0 * x + c1 * y + c2 * z
                    a0 = a1 = a2 = b0 = b1 = b2 = c0 = c1 = c2 = 0.0
                for vertex in range(vertices):
                    x, y, z = moved[i, vertex, 0], moved[i, vertex, 1], moved[i, vertex, 2]
                    moved[i, vertex, 0] = x + (a + a0 * x + a1 * y + a2 * z)
                    moved[i, vertex, 1] = y + (b + b0 * x + b1 * y + b2 * z)
                    moved[i, vertex, 2] = z + (c + c0 * x + c1 * y + c2 * z)
            for i in range(size):
                n = order[batch + i]
                for vertex in range(vertices):
                    for axis in range(3):
                        out[n, vertex, axis] = moved[i, vertex, axis]
