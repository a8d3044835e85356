# pyright: basic
# numba's decorators carry no types; the typed, documented faces of these are splatting.py, light.py and sight.py.
"""Compiled kernels: Gaussians summed up on a grid, what stands in the way of light through it, and what one sees."""

from __future__ import annotations

import math

import numba
import numpy as np

_function = numba.njit(cache=True, nogil=True, error_model="numpy")

CUT = 3.0
"""Standard deviations to which a Gaussian reaches."""
DARK = 1e3
"""Optical depth of the ground."""
PAD = 2
"""Nodes around a grid that light comes through, as far as a step goes."""


@_function
def add_gaussians(out, first, end, places, inverses, reach, peaks):
    """Add peaks (F, N) of Gaussians at places (N, 3), in spacings, to fields (F, X, Y, Z), from row `first` to `end`.

    Their inverse covariances are (N, 6), xx, xy, xz, yy, yz, zz.
    """
    fields, _, ny, nz = out.shape
    for n in range(len(places)):
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        xx, xy, xz = inverses[n, 0], 2 * inverses[n, 1], 2 * inverses[n, 2]
        yy, yz, zz = inverses[n, 3], 2 * inverses[n, 4], inverses[n, 5]
        for i in range(max(first, math.ceil(x - reach[n, 0])), min(end, int(x + reach[n, 0]) + 1)):
            u = i - x
            for j in range(max(0, math.ceil(y - reach[n, 1])), min(ny, int(y + reach[n, 1]) + 1)):
                v = j - y
                for k in range(max(0, math.ceil(z - reach[n, 2])), min(nz, int(z + reach[n, 2]) + 1)):
                    w = k - z
                    square = u * (xx * u + xy * v + xz * w) + v * (yy * v + yz * w) + zz * w * w
                    if square < CUT * CUT:
                        value = math.exp(-0.5 * square)
                        for f in range(fields):
                            out[f, i, j, k] += peaks[f, n] * value


@_function
def inverses_of(covariances, width, scale, out):
    """Inverses (N, 6), times `scale`, of covariances (N, 3, 3) widened by width^2; determinants are > 0."""
    for n in range(len(covariances)):
        xx, yy, zz = (covariances[n, 0, 0] + width**2, covariances[n, 1, 1] + width**2, covariances[n, 2, 2] + width**2)
        xy, xz, yz = covariances[n, 0, 1], covariances[n, 0, 2], covariances[n, 1, 2]
        first, second, third = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        over = scale / (xx * first + xy * second + xz * third)
        out[n, 0], out[n, 1], out[n, 2] = over * first, over * second, over * third
        out[n, 3], out[n, 4], out[n, 5] = (
            over * (xx * zz - xz * xz),
            over * (xy * xz - xx * yz),
            over * (xx * yy - xy * xy),
        )


@_function
def depth_towards(depth, step, between, out):
    """Optical depth between each node and the sky along `step` (3,), in nodes; a node's own depth does not count.

    Both are padded by `PAD` nodes on every side, `depth` with zeros, `out` with what light has passed that comes from
    there. `between` are the nodes (B, 3) that a step of two passes, none, two or four, which count by their mean.
    """
    nx, ny, nz = depth.shape[0] - 2 * PAD, depth.shape[1] - 2 * PAD, depth.shape[2] - 2 * PAD
    a, b, c = step[0], step[1], step[2]
    for p in range(nx):
        i = PAD + (nx - 1 - p if a > 0 else p)
        for q in range(ny):
            j = PAD + (ny - 1 - q if b > 0 else q)
            if a == 0 and b == 0:
                for r in range(nz):
                    k = PAD + (nz - 1 - r if c > 0 else r)
                    out[i, j, k] = out[i, j, k + c] + depth[i, j, k + c]
                continue
            # Rows beside each other, of which none waits for another of the same row: many nodes at once.
            row, first = out[i, j, PAD : PAD + nz], PAD + c
            above, passed = out[i + a, j + b, first : first + nz], depth[i + a, j + b, first : first + nz]
            if len(between) == 0:
                for k in range(nz):
                    row[k] = above[k] + passed[k]
            elif len(between) == 2:
                one, two = _beside(depth, i, j, between[0], nz), _beside(depth, i, j, between[1], nz)
                for k in range(nz):
                    row[k] = 0.5 * one[k] + 0.5 * two[k] + (above[k] + passed[k])
            else:
                one, two = _beside(depth, i, j, between[0], nz), _beside(depth, i, j, between[1], nz)
                three, four = _beside(depth, i, j, between[2], nz), _beside(depth, i, j, between[3], nz)
                for k in range(nz):
                    mean = 0.25 * one[k] + 0.25 * two[k] + 0.25 * three[k] + 0.25 * four[k]
                    row[k] = mean + (above[k] + passed[k])


@numba.njit(inline="always")
def _beside(field, i, j, off, count):
    first = PAD + off[2]
    return field[i + off[0], j + off[1], first : first + count]


@_function
def add_light(there, back, direction, share, lines, flow):
    """Add what comes along `direction` (3,), and what comes the other way, to the sums of `light.Light`.

    `there` and `back` are padded by `PAD` nodes on every side; the sums are not.
    """
    nx, ny, nz = share.shape
    x, y, z = direction[0], direction[1], direction[2]
    for i in range(nx):
        for j in range(ny):
            ahead, behind = there[PAD + i, PAD + j, PAD : PAD + nz], back[PAD + i, PAD + j, PAD : PAD + nz]
            shares, free = share[i, j], lines[i, j]
            along_x, along_y, along_z = flow[0, i, j], flow[1, i, j], flow[2, i, j]
            for k in range(nz):
                one, other = ahead[k], behind[k]
                shares[k] += one + other
                free[k] += one * other
                more = one - other
                along_x[k] += x * more
                along_y[k] += y * more
                along_z[k] += z * more


@_function
def shares_seen(places, conics, reach, opacities, order, through):
    """Share (N,) of each Gaussian's picture that is not hidden by those before it in `order` (N,), front to back.

    Pictures have places (N, 2), inverse covariances (N, 3) and a reach (N, 2) in pixels; `through` (X, Y) is the light
    that passes, one at the start.
    """
    nx, ny = through.shape
    shares = np.zeros(len(places))
    for n in order:
        x, y = places[n, 0], places[n, 1]
        shown, whole = 0.0, 0.0
        for i in range(max(0, math.ceil(x - reach[n, 0])), min(nx, int(x + reach[n, 0]) + 1)):
            u = i - x
            for j in range(max(0, math.ceil(y - reach[n, 1])), min(ny, int(y + reach[n, 1]) + 1)):
                v = j - y
                square = u * (conics[n, 0] * u + 2 * conics[n, 1] * v) + conics[n, 2] * v * v
                if square < CUT * CUT:
                    alpha = opacities[n] * math.exp(-0.5 * square)
                    shown += alpha * through[i, j]
                    whole += alpha
                    through[i, j] *= 1 - alpha
        if whole > 0:
            shares[n] = shown / whole
        else:
            shares[n] = through[min(nx - 1, int(x + 0.5)), min(ny - 1, int(y + 0.5))]
    return shares
