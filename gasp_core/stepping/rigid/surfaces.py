"""Where the surfaces of rigid bodies are: smooth distances to them, and places on them.

Trilinear distances have a kink at every cell, on which a ball would roll as a polyhedron does, losing speed at each of
its edges. Here they are interpolated by quadratic B-splines, whose gradient has none: of a ball of radius R on nodes h
apart the surface is everywhere the same h^2 / 4 R too far in. Edges are rounded by it: a block stands on what is 3/4 h
within its own. Splines that go through the values at the nodes would do less, and have ripples on faces beside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes
from scipy.spatial import KDTree

from gasp_core.contract import PointCloud, PointProblem, SignedDistanceField
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.rigid.bodies import RigidBodies
from gasp_core.stepping.rigid_motion import Pose
from gasp_core.stepping.vectors import lengths

__all__ = ["RigidSurfaces", "cubes_field", "distances", "onto", "rigid_surfaces_of", "unit"]

Array = NDArray[Any]

_MARGIN = 3
"""Nodes around a body."""
_MOST_NODES = 160
"""Along an axis of a field that is made of points."""
_SAMPLES = 800
"""Places on the surface of a body, about."""
_NEIGHBOURS = 7
_ALIKE = 1e-6
"""Of the way between samples: what differs by less differs by rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidSurfaces:
    """Distance fields of B bodies, and places on their surfaces, in the scene's frame at the reference positions.

    Parameters
    ----------
    values : (M,) [m]
        Of all nodes of all fields, behind each other.
    starts : (B,)
        Where each field begins.
    shapes : (B, 3)
    origins : (B, 3) [m]
    spacings : (B,) [m]
    radii : (B,) [m]
        Of balls about the centres of mass in which the bodies are.
    samples : (S, 3) [m]
        Places on the surfaces, those of a body behind each other.
    normals : (S, 3)
        Out of the body.
    reaches : (S,) [m]
        How far from a sample the surface is as it says: half the way between samples, about.
    bends : (S,) [m]
        Radius of curvature where the surface is bent the most.
    sample_starts : (B + 1,)
    """

    values: Array
    starts: Array
    shapes: Array
    origins: Array
    spacings: Array
    radii: Array
    samples: Array
    normals: Array
    reaches: Array
    bends: Array
    sample_starts: Array

    @classmethod
    def of(cls, fields: list[SignedDistanceField], centers: Array) -> Self:
        """Of bodies with these fields and centres of mass (B, 3) [m]."""
        sizes = np.array([field.values.size for field in fields])
        parts = [_sampled(field) for field in fields]
        radii = [
            float(np.linalg.norm(places - center, axis=1).max(initial=0.0)) + field.spacing
            for (places, *_), center, field in zip(parts, centers, fields)
        ]
        counts = [len(part[0]) for part in parts]
        return cls(
            values=np.concatenate([field.values.reshape(-1) for field in fields]).astype(np.float64),
            starts=np.cumsum(sizes) - sizes,
            shapes=np.array([field.values.shape for field in fields]),
            origins=np.array([field.origin for field in fields], dtype=np.float64),
            spacings=np.array([field.spacing for field in fields]),
            radii=np.array(radii),
            samples=np.concatenate([part[0] for part in parts]),
            normals=np.concatenate([part[1] for part in parts]),
            reaches=np.concatenate([part[2] for part in parts]),
            bends=np.concatenate([part[3] for part in parts]),
            sample_starts=np.concatenate([[0], np.cumsum(counts)]),
        )

    def seen(self, body: int, pose: Pose, places: Array) -> tuple[Array, Array]:
        """Distances (K,) [m] of places (K, 3) [m] to a body that stands so, and their gradients (K, 3)."""
        found = distances(
            self.values,
            self.starts[body],
            self.shapes[body],
            self.origins[body],
            self.spacings[body],
            pose.before(places),
        )
        return found[:, 0], found[:, 1:] @ pose.rotation.T


def unit(vectors: Array) -> Array:
    """Vectors (K, 3), each of length one; zero stays zero."""
    return vectors / np.maximum(lengths(vectors), 1e-300)[:, None]


def onto(places: Array, depths: Array, slopes: Array) -> Array:
    """Places (K, 3) [m] brought onto a surface by a step of Newton's, of distances (K,) [m] and gradients (K, 3)."""
    return places - (depths / np.maximum(np.sum(slopes**2, axis=1), 0.01))[:, None] * slopes


def rigid_surfaces_of(problem: PointProblem, bodies: RigidBodies) -> RigidSurfaces:
    """Of the rigid bodies of a problem: the shapes that it knows, and otherwise the cubes of the points."""
    known = body_shapes(problem)
    fields = [
        known[int(body)] if int(body) in known else cubes_field(problem.points, bodies.rows[bodies.owners == index])
        for index, body in enumerate(bodies.bodies)
    ]
    return RigidSurfaces.of(fields, bodies.centers)


def cubes_field(points: PointCloud, rows: Array) -> SignedDistanceField:
    """Distances to what cubes along the axes fill that the points `rows` (K,) stand for, without gaps and hollows."""
    places = points.reference_positions[rows]
    halves = np.cbrt(points.reference_volumes[rows]) / 2
    low, high = (places - halves[:, None]).min(axis=0), (places + halves[:, None]).max(axis=0)
    spacing = max(float(np.median(halves)), float((high - low).max()) / _MOST_NODES)
    counts = np.ceil((high - low) / spacing - 1e-6).astype(int) + 2 * _MARGIN + 1
    # The middle of the field is that of the body: a block's opposite faces are alike.
    origin = (low + high - spacing * (counts - 1)) / 2
    nodes = origin + spacing * np.indices(tuple(counts)).reshape(3, -1).T
    near = min(8, len(places))
    # By their middles' straight distances: along one axis dozens of cubes are as far, and the nearest may be left out.
    _, index = KDTree(places).query(nodes, k=near)
    nearest = index.reshape(len(nodes), near)
    offsets = nodes[:, None] - places[nearest]
    beyond = np.sign(offsets) * np.maximum(np.abs(offsets) - halves[nearest][..., None], 0.0)
    ways = np.linalg.norm(beyond, axis=2)
    best = ways.argmin(axis=1)
    outside, away = ways[np.arange(len(nodes)), best], beyond[np.arange(len(nodes)), best]
    # Between cubes that are not quite beside each other there are gaps: what is nearer than half a width is closed, and
    # taken off again: inside, a distance is that to the surface so far out.
    closing = float(np.median(halves))
    closed: Any = binary_fill_holes((outside <= closing * (1 + 1e-9)).reshape(counts))
    closed = closed.reshape(-1)
    rim = ~closed & (outside < closing + 2 * spacing)
    shell = nodes[rim] - (1 - closing / outside[rim])[:, None] * away[rim]
    depth, _ = KDTree(shell).query(nodes[closed])
    values = outside.copy()
    values[closed] = closing - depth
    values = values.reshape(counts)
    # Where a cube is smaller than a cell of the field it would be lost.
    own = np.rint((places - origin) / spacing).astype(int)
    there = values[tuple(own.T)]
    values[tuple(own.T)] = np.where(there < 0, there, -halves)
    return SignedDistanceField(origin=tuple(origin), spacing=spacing, values=values)


def _sampled(field: SignedDistanceField) -> tuple[Array, Array, Array, Array]:
    """Places (S, 3) [m] on the surface, normals (S, 3), reaches (S,) [m] and radii of curvature (S,) [m]."""
    values = field.values.astype(np.float64)
    # With those a cell away, whose distance is a cell but for rounding.
    near = np.argwhere(np.abs(values) < 1.01 * field.spacing)
    places = np.asarray(field.origin) + field.spacing * near
    flat, shape, origin = values.reshape(-1), np.array(values.shape), np.asarray(field.origin, dtype=np.float64)
    for _ in range(3):
        found = distances(flat, 0, shape, origin, field.spacing, places)
        places = onto(places, found[:, 0], found[:, 1:])
    found = distances(flat, 0, shape, origin, field.spacing, places)
    places = places[np.abs(found[:, 0]) < 0.1 * field.spacing]
    # As many as were asked for, whatever the body's shape: the surface has an area of about a spacing squared a node.
    apart = field.spacing * max(1.0, np.sqrt(0.5 * len(places) / _SAMPLES))
    places = places[_spread(places - (origin + 0.5 * field.spacing * (shape - 1)), apart)]
    found = distances(flat, 0, shape, origin, field.spacing, places)
    normals = unit(found[:, 1:])
    around = min(_NEIGHBOURS, len(places))
    ways, index = (part.reshape(len(places), around) for part in KDTree(places).query(places, k=around))
    turns = np.linalg.norm(normals[index] - normals[:, None], axis=2)
    bends = np.where(turns > 1e-9, ways / np.maximum(turns, 1e-9), np.inf)[:, 1:].min(axis=1, initial=1e9 * apart)
    return places, normals, np.full(len(places), apart), bends


def _spread(places: Array, apart: float) -> Array:
    """Rows of places (K, 3) [m], about the middle of a body, that are `apart` [m] or more from each other, about.

    Of each cell the one that is farthest out, so that what stands does so on all of its base. Cells are counted from
    the middle to both sides, and what rounding alone tells apart is as far: opposite faces of a block are alike,
    wherever in the scene it lies.
    """
    counted = np.rint(places / (_ALIKE * apart)).astype(np.int64)
    ways, sides = np.abs(counted), np.sign(counted)
    cells = sides * (1 + np.floor(_ALIKE * (ways + 1)).astype(np.int64))
    out = np.rint(np.linalg.norm(ways, axis=1))
    order = np.lexsort((*ways.T, -out))
    _, first = np.unique(cells[order], axis=0, return_index=True)
    extremes = np.concatenate([counted.argmin(axis=0), counted.argmax(axis=0)])
    return np.unique(np.concatenate([order[first], extremes]))


@numba.njit(inline="always", error_model="numpy")
def _distance_at(
    values: Array, start: int, shape: Array, origin: Array, spacing: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Distance [m] of a place to a surface, negative inside, and its gradient (3 numbers).

    Parameters
    ----------
    values, start, shape, origin, spacing
        Of a field, as in `RigidSurfaces`.
    """
    u, v, w = (x - origin[0]) / spacing, (y - origin[1]) / spacing, (z - origin[2]) / spacing
    # Splines are of three nodes: half a spacing from the outermost ones they still have all of them.
    a = min(max(u, 0.5), shape[0] - 1.5)
    b = min(max(v, 0.5), shape[1] - 1.5)
    c = min(max(w, 0.5), shape[2] - 1.5)
    i, j, k = int(a + 0.5), int(b + 0.5), int(c + 0.5)
    i, j, k = min(max(i, 1), shape[0] - 2), min(max(j, 1), shape[1] - 2), min(max(k, 1), shape[2] - 2)
    p, q, r = a - i, b - j, c - k
    wx = (0.5 * (0.5 - p) ** 2, 0.75 - p * p, 0.5 * (0.5 + p) ** 2)
    wy = (0.5 * (0.5 - q) ** 2, 0.75 - q * q, 0.5 * (0.5 + q) ** 2)
    wz = (0.5 * (0.5 - r) ** 2, 0.75 - r * r, 0.5 * (0.5 + r) ** 2)
    dx, dy, dz = (p - 0.5, -2 * p, p + 0.5), (q - 0.5, -2 * q, q + 0.5), (r - 0.5, -2 * r, r + 0.5)
    found, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for e in range(3):
        for f in range(3):
            row = start + ((i + e - 1) * shape[1] + j + f - 1) * shape[2] + k - 1
            line = wz[0] * values[row] + wz[1] * values[row + 1] + wz[2] * values[row + 2]
            slope = dz[0] * values[row] + dz[1] * values[row + 1] + dz[2] * values[row + 2]
            found += wx[e] * wy[f] * line
            gx += dx[e] * wy[f] * line
            gy += wx[e] * dy[f] * line
            gz += wx[e] * wy[f] * slope
    gx, gy, gz = gx / spacing, gy / spacing, gz / spacing
    away_x, away_y, away_z = (u - a) * spacing, (v - b) * spacing, (w - c) * spacing
    away = (away_x * away_x + away_y * away_y + away_z * away_z) ** 0.5
    if away > 0:
        found += away
        gx, gy, gz = away_x / away, away_y / away, away_z / away
    return found, gx, gy, gz


@numba.njit(cache=True, nogil=True, error_model="numpy")
def distances(values: Array, start: int, shape: Array, origin: Array, spacing: float, places: Array) -> Array:
    """Of places (K, 3) [m], with gradients: (K, 4)."""
    found = np.empty((len(places), 4))
    for row in range(len(places)):
        x, y, z = places[row, 0], places[row, 1], places[row, 2]
        found[row] = _distance_at(values, start, shape, origin, spacing, x, y, z)
    return found
