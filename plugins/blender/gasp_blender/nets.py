"""Elastic bodies as nets for Blender's cloth: of the faces of their own mesh, or of quads through a flat body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage, scatter
from gasp_blender.sheet import build_sheet, net_edges
from gasp_blender.spring_model import Matter, elastic_rows, half_side
from gasp_core.contract import PointProblem
from gasp_core.errors import SceneError
from gasp_core.stepping.body_faces import body_faces

__all__ = ["CLOTH_STEP", "cloth_matter"]

Array = NDArray[Any]

CLOTH_STEP = 1 / 12
"""Of cloth [s], which is stepped implicitly and bears any: a longer one flies past what it should touch."""


def cloth_matter(problem: PointProblem, spacing: float, most_quads: int) -> list[Matter]:
    """Each body of elastic material as a net of cloth.

    Raises
    ------
    SceneError
        Where a body has no faces and is no sheet, or parts of different materials.
    """
    faces = body_faces(problem)
    found: list[Matter] = []
    for rows in elastic_rows(problem):
        own = faces.get(int(problem.points.body_ids[rows[0]]))
        # Of a body that is rigid in part they are not those of a net.
        if own is None or not np.isin(own, rows).all():
            found.append(_of_quads(problem, rows, spacing, most_quads))
        else:
            found.append(_of_faces(problem, rows, own))
    return found


def _of_faces(problem: PointProblem, rows: Array, faces: Array) -> Matter:
    """Points are the vertices of the net; faces (F, 3) are rows of the problem's points."""
    positions = problem.points.reference_positions[rows]
    count = len(rows)
    own = np.searchsorted(rows, faces)
    corners = np.zeros((count, 8), dtype=np.int64)
    corners[:, 0] = np.arange(count)
    weights = np.zeros((count, 8))
    weights[:, 0] = 1.0
    net = Cage(
        nodes=positions,
        voxels=own[:, [0, 1, 2, 2]],
        parity=np.zeros((len(own), 3), dtype=np.int64),
        corners=corners,
        weights=weights,
        coarseness=1.0,
    )
    edges = net_edges(net.voxels)
    lengths = np.linalg.norm(positions[edges[:, 1]] - positions[edges[:, 0]], axis=1)
    one, other = (positions[own[:, k]] - positions[own[:, 0]] for k in (1, 2))
    area = float(np.linalg.norm(np.cross(one, other), axis=1).sum()) / 2
    if not area > 0:
        raise SceneError(
            f"the faces of body {int(problem.points.body_ids[rows[0]])} have no area: nothing is cloth there"
        )
    # Vertices of Blender's cloth have one mass: with it, an impulse moves all of them alike.
    masses = np.full(count, problem.masses[rows].mean())
    # And what a spring bears at a strain of one, it divides by the mean length.
    share = 3 * area * float(lengths.mean()) / float(lengths @ lengths)
    return _net(problem, rows, net, edges, area, share, masses)


def _of_quads(problem: PointProblem, rows: Array, spacing: float, most_quads: int) -> Matter:
    points = problem.points
    positions, volumes = points.reference_positions[rows], points.reference_volumes[rows]
    try:
        net, thickness = build_sheet(positions, half_side(positions, volumes), spacing, most_quads)
    except ValueError as error:
        raise SceneError(
            f"body {int(points.body_ids[rows[0]])} is no sheet across an axis, {error}: cloth wants one that is at most"
            ' a third as thick as it is wide, or an open mesh (reduction = { mode = "mesh" }); turn it, or use'
            " elastic = cage"
        ) from None
    edges = net_edges(net.voxels)
    length = float(np.linalg.norm(net.nodes[edges[:, 1]] - net.nodes[edges[:, 0]], axis=1).mean())
    area = float(volumes.sum()) / thickness
    return _net(problem, rows, net, edges, area, 0.75 * length, problem.masses[rows])


def _net(
    problem: PointProblem, rows: Array, net: Cage, edges: Array, area: float, share: float, masses: Array
) -> Matter:
    """A net of this area [m^2] for points of these masses (N,) [kg].

    A spring bears `share` [m] times Young's modulus and thickness at a strain of one.
    """
    points = problem.points
    kinds = np.unique(points.material_ids[rows])
    if len(kinds) > 1:
        body = int(points.body_ids[rows[0]])
        raise SceneError(
            f"blender's cloth is of one material, and body {body} of {len(kinds)}: simulate them apart, or use"
            " elastic = cage"
        )
    modulus = getattr(problem.materials[kinds[0]], "youngs_modulus", 0.0)
    thickness = float(points.reference_volumes[rows].sum()) / area
    count = len(net.nodes)
    return Matter(
        rows=rows,
        cage=net,
        edges=edges,
        quarters=np.full(len(edges), 4),
        bodies=np.zeros(count, np.int64),
        masses=np.full(count, masses.sum() / count),
        forces=np.full(count, share * modulus * thickness),
        point_masses=masses,
        coupling=scatter(net, masses),
        stable_step=CLOTH_STEP,
        weights=np.ones(count),
        sizes=np.full(count, thickness / 2),
        is_cloth=True,
    )
