# pyright: basic
# numba's decorators carry no types; the typed, documented faces of these kernels are splatting.py and light.py.
"""Compiled kernels: Gaussians summed up on a grid, and what stands in the way of light through it."""

from __future__ import annotations

import math

import numba

_function = numba.njit(cache=True, nogil=True, error_model="numpy")

CUT = 3.0
"""Standard deviations to which a Gaussian reaches."""
DARK = 1e3
"""Optical depth of the ground."""


@_function
def add_gaussians(out, places, inverses, reach, peaks):
    """Add peaks (N,) of Gaussians at places (N, 3) with inverse covariances (N, 6) to the nodes, all in spacings."""
    nx, ny, nz = out.shape
    for n in range(len(places)):
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        xx, xy, xz = inverses[n, 0], 2 * inverses[n, 1], 2 * inverses[n, 2]
        yy, yz, zz = inverses[n, 3], 2 * inverses[n, 4], inverses[n, 5]
        for i in range(max(0, math.ceil(x - reach[n, 0])), min(nx, int(x + reach[n, 0]) + 1)):
            u = i - x
            for j in range(max(0, math.ceil(y - reach[n, 1])), min(ny, int(y + reach[n, 1]) + 1)):
                v = j - y
                for k in range(max(0, math.ceil(z - reach[n, 2])), min(nz, int(z + reach[n, 2]) + 1)):
                    w = k - z
                    square = u * (xx * u + xy * v + xz * w) + v * (yy * v + yz * w) + zz * w * w
                    if square < CUT * CUT:
                        out[i, j, k] += peaks[n] * math.exp(-0.5 * square)


@_function
def depth_towards(depth, step, between, ground, out):
    """Optical depth between each node and the sky along `step` (3,), in nodes; a node's own depth does not count.

    `between` (B, 3) are the nodes that a step of two passes, which count by their mean. `ground`: below the lowest
    layer there is no sky.
    """
    nx, ny, nz = depth.shape
    a, b, c = step[0], step[1], step[2]
    for p in range(nx):
        i = nx - 1 - p if a > 0 else p
        for q in range(ny):
            j = ny - 1 - q if b > 0 else q
            for r in range(nz):
                k = nz - 1 - r if c > 0 else r
                total = 0.0
                for s in range(len(between)):
                    u, v, w = i + between[s, 0], j + between[s, 1], k + between[s, 2]
                    if 0 <= u < nx and 0 <= v < ny and 0 <= w < nz:
                        total += depth[u, v, w] / len(between)
                u, v, w = i + a, j + b, k + c
                if 0 <= u < nx and 0 <= v < ny and 0 <= w < nz:
                    total += out[u, v, w] + depth[u, v, w]
                elif ground and w < 0:
                    total = DARK
                out[i, j, k] = total
