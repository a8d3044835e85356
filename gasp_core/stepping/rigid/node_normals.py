"""How near matter around a node is to a rigid body, and along which normal the two part."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["nearest", "parting"]

Array = NDArray[Any]

_LENGTHS = (1.0, 0.5, 0.0)
"""Shares of the rigid body's own normal in the directions that are tried; the rest is the matter's."""


@numba.njit(inline="always", error_model="numpy")
def _splines(cell: float) -> tuple[int, tuple[float, float, float], tuple[float, float, float]]:
    """The first of three nodes that hear of a place, their weights, and the slopes of these with the node's place."""
    first = int(cell - 0.5)
    x = cell - first
    return first, (0.5 * (1.5 - x) ** 2, 0.75 - (x - 1) ** 2, 0.5 * (x - 0.5) ** 2), (1.5 - x, 2 * (x - 1), 0.5 - x)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def nearest(
    cells: Array, rooms: Array, slopes: Array, bodies: Array, gaps: Array, normals: Array, width: float
) -> None:
    """Of points around nodes the smallest room, and the sum of the slopes of those that are about as near.

    Parameters
    ----------
    cells : (P, 3)
        Places of points in cells, from the node (0, 0, 0).
    rooms : (P,) [m]
        From the rigid surface to that of what a point stands for.
    slopes : (P, 3)
        Gradients of the distance from the rigid surface.
    bodies : (P,)
        Whose the points are.
    gaps : (B, I, J, K) [m]
        Lowered to the smallest room.
    normals : (B, I, J, K, 3)
        The sums are added, of no particular length.
    width : [m]
        Over how much more room a slope fades.
    """
    for turn in range(2):
        for p in range(len(cells)):
            i, wx, _ = _splines(cells[p, 0])
            j, wy, _ = _splines(cells[p, 1])
            k, wz, _ = _splines(cells[p, 2])
            b, room = bodies[p], rooms[p]
            for a in range(3):
                for c in range(3):
                    for e in range(3):
                        weight = wx[a] * wy[c] * wz[e]
                        if weight <= 0.0:
                            continue
                        least = gaps[b, i + a, j + c, k + e]
                        if turn == 0:
                            if room < least:
                                gaps[b, i + a, j + c, k + e] = room
                        elif room < least + 10 * width:
                            weight *= math.exp((least - room) / width)
                            for d in range(3):
                                normals[b, i + a, j + c, k + e, d] += weight * slopes[p, d]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def parting(
    cells: Array,
    depths: Array,
    half_widths: Array,
    slopes: Array,
    bodies: Array,
    wanted: Array,
    normals: Array,
    better: float,
) -> None:
    """Turn normals towards those of the matter where these part it better from the rigid body.

    An edge has every normal between those of its faces, and so has a corner of what is soft; a distance knows those of
    a rounded edge, which brake what slides on a plain. Of the two surfaces the smooth one tells: along its normal the
    gap is widest, from where the rigid surface nearest to points around the node ends to where these points begin. It
    is the separating axis of `gasp_reference_mpm.separation`.

    Parameters
    ----------
    cells, slopes, bodies, normals
        As of `nearest`; normals are changed, zero stays zero.
    depths, half_widths : (P,)
        Of points from the rigid surface, and of what they stand for, in cells.
    wanted : (B, I, J, K) of bool
        Nodes whose normals are asked for.
    better
        In cells: a gap is wider if it is so much wider.
    """
    # Out of the rigid body is into the matter: where there is more of it.
    inward = np.zeros_like(normals)
    for p in range(len(cells)):
        i, wx, sx = _splines(cells[p, 0])
        j, wy, sy = _splines(cells[p, 1])
        k, wz, sz = _splines(cells[p, 2])
        b, volume = bodies[p], half_widths[p] ** 3
        for a in range(3):
            for c in range(3):
                for e in range(3):
                    if wanted[b, i + a, j + c, k + e]:
                        inward[b, i + a, j + c, k + e, 0] += volume * sx[a] * wy[c] * wz[e]
                        inward[b, i + a, j + c, k + e, 1] += volume * wx[a] * sy[c] * wz[e]
                        inward[b, i + a, j + c, k + e, 2] += volume * wx[a] * wy[c] * sz[e]
    directions = np.zeros((*normals.shape[:4], 3, 3))
    for b, i, j, k in np.ndindex(normals.shape[:4]):
        own, others = normals[b, i, j, k], inward[b, i, j, k]
        lengths = (np.sum(own**2) ** 0.5, np.sum(others**2) ** 0.5)
        if lengths[0] > 0.0 and lengths[1] > 0.0:
            for t in range(3):
                mean = _LENGTHS[t] / lengths[0] * own + (1 - _LENGTHS[t]) / lengths[1] * others
                directions[b, i, j, k, t] = mean / max(np.sum(mean**2) ** 0.5, 1e-6)
    begins = np.full((*normals.shape[:4], 3), np.inf)
    ends = np.full((*normals.shape[:4], 3), -np.inf)
    for p in range(len(cells)):
        i, wx, _ = _splines(cells[p, 0])
        j, wy, _ = _splines(cells[p, 1])
        k, wz, _ = _splines(cells[p, 2])
        for a in range(3):
            for c in range(3):
                for e in range(3):
                    node = (bodies[p], i + a, j + c, k + e)
                    if not wanted[node] or wx[a] * wy[c] * wz[e] <= 0.0:
                        continue
                    for t in range(3):
                        place, lean = 0.0, 0.0
                        for d in range(3):
                            place += directions[node][t, d] * cells[p, d]
                            lean += directions[node][t, d] * slopes[p, d]
                        # What lies behind the body, seen from here, has another side of it before it.
                        if t == 0 and lean <= 0.0:
                            break
                        begins[node][t] = min(begins[node][t], place - half_widths[p])
                        ends[node][t] = max(ends[node][t], place - depths[p] * lean)
    for b, i, j, k in np.ndindex(normals.shape[:4]):
        best = 0
        for t in range(1, 3):
            gaps = begins[b, i, j, k] - ends[b, i, j, k]
            if gaps[t] > gaps[best] + better:
                best = t
        if best > 0:
            normals[b, i, j, k] = directions[b, i, j, k, best]
