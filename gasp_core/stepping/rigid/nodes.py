"""Which nodes of a grid carry matter that touches a rigid body, how near that is, and along which normal.

A node hears of matter that is a cell and a half away, so that its own place says little: within the edge of a block
that slides on a slab there are nodes of the slab, and the nearest face of the block is the one in front. What touches
is judged where the matter is, at the points around the node, as between two bodies that deform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.stepping.rigid.node_normals import nearest, parting
from gasp_core.stepping.rigid.surfaces import RigidSurfaces, unit
from gasp_core.stepping.rigid_motion import Pose

__all__ = ["NodeContacts", "nodes_near"]

Array = NDArray[Any]

_REACH = 0.5
"""In cells: nodes farther out of a body are left to the matter around them; nearer ones there are wherever it is."""
_WELDED = 0.75
"""In cells: as far out those are held that are welded. The last one that is held is between a quarter of a cell within
the body and here, and felt a quarter of a cell behind itself: in the mean just where the body ends."""
_FELT = 3.0
"""In cells: points farther away than this touch no such node."""
_NEAREST = 0.1
"""In cells: over how much the nearest points around a node share in its normal."""
_PREFERRED = 0.02
"""In cells: by how much wider the gap has to be along the normal of the matter for that to be taken."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeContacts:
    """Nodes of matter that is near rigid bodies, K of them, each with the body that is nearest.

    Parameters
    ----------
    nodes : (K, 3)
        Whole-number coordinates, in cells.
    bodies : (K,)
        Whose matter it is, as the points have it.
    rigid : (K,)
        The rigid body.
    normals : (K, 3)
        Out of it.
    gaps : (K,) [m]
        From its surface to that of the matter.
    welded : (K,) of bool
        Whether it is a part of the body whose matter it is.
    """

    nodes: Array
    bodies: Array
    rigid: Array
    normals: Array
    gaps: Array
    welded: Array


def nodes_near(
    surfaces: RigidSurfaces,
    poses: list[Pose],
    positions: Array,
    half_widths: Array,
    bodies: Array,
    spacing: float,
    origin: Array,
    open_gap: float,
    hosts: Array,
) -> NodeContacts:
    """Nodes where matter is nearer than `open_gap` [m] to a rigid body, or welded to it.

    Parameters
    ----------
    poses
        Of the rigid bodies.
    positions : (P, 3) [m]
        Of points.
    half_widths : (P,) [m]
        Of what they stand for.
    bodies : (P,)
        Whose they are: 0, 1, 2, ...
    spacing, origin : [m], (3,) [m]
        Nodes are at the origin and multiples of the spacing away from it.
    hosts
        See `gasp_core.stepping.rigid.welds.Welds`.
    """
    found: list[tuple[Array, ...]] = []
    kinds = int(bodies.max(initial=-1)) + 1
    for number, pose in enumerate(poses):
        reach = surfaces.radii[number] + _FELT * spacing
        near = np.flatnonzero(np.sum((positions - pose.place) ** 2, axis=1) < reach * reach)
        if not len(near):
            continue
        depth, slopes = surfaces.seen(number, pose, positions[near])
        close = depth < _FELT * spacing
        near, depth, slopes = near[close], depth[close], slopes[close]
        if not len(near):
            continue
        cells = (positions[near] - origin) / spacing
        low = np.floor(cells.min(axis=0) - 0.5).astype(np.int64)
        size = np.floor(cells.max(axis=0) - 0.5).astype(np.int64) - low + 3
        gaps, normals = np.full((kinds, *size), np.inf), np.zeros((kinds, *size, 3))
        places, slopes, whose = cells - low, np.ascontiguousarray(slopes), bodies[near].astype(np.int64)
        halves = half_widths[near]
        nearest(places, depth - halves, slopes, whose, gaps, normals, _NEAREST * spacing)
        welded = (np.arange(kinds) == hosts[number])[:, None, None, None]
        asked = (gaps < open_gap) & ~welded
        if asked.any():
            parting(places, depth / spacing, halves / spacing, slopes, whose, asked, normals, _PREFERRED)
        rows = np.argwhere((gaps < open_gap) | (welded & np.isfinite(gaps)))
        nodes = rows[:, 1:] + low
        out, _ = surfaces.seen(number, pose, nodes * spacing + origin)
        own = rows[:, 0] == hosts[number]
        there = out <= np.where(own, _WELDED, _REACH) * spacing
        rows, nodes, own = rows[there], nodes[there], own[there]
        at = tuple(rows.T)
        found.append((nodes, rows[:, 0], np.full(len(rows), number), unit(normals[at]), gaps[at], own))
    if not found:
        nothing = np.zeros((0, 3))
        none = np.zeros(0, dtype=np.int64)
        nodes, zero = nothing.astype(np.int64), np.zeros(0)
        return NodeContacts(nodes=nodes, bodies=none, rigid=none, normals=nothing, gaps=zero, welded=zero.astype(bool))
    nodes, whose, rigid, normals, gaps, welded = (np.concatenate(part) for part in zip(*found))
    if len(found) > 1 and len(whose):
        # Of several bodies at a node the nearest one, and before all one that it is welded to.
        order = np.lexsort((gaps, ~welded, *nodes.T, whose))
        same = np.all(np.diff(np.column_stack([whose, nodes])[order], axis=0) == 0, axis=1)
        kept = np.sort(order[np.append(True, ~same)])
        nodes, whose, rigid = nodes[kept], whose[kept], rigid[kept]
        normals, gaps, welded = normals[kept], gaps[kept], welded[kept]
    return NodeContacts(nodes=nodes, bodies=whose, rigid=rigid, normals=normals, gaps=gaps, welded=welded)
