"""Elastic bodies as nets for Blender's cloth: of the faces of their own mesh, or of quads through a flat body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.cage import Cage, scatter
from gasp_blender.net_stiffness import sheet_stiffness
from gasp_blender.sheet import build_sheet, net_edges
from gasp_blender.spring_model import Matter, half_side, joined
from gasp_core.contract import PointProblem
from gasp_core.errors import SceneError
from gasp_core.stepping.body_faces import body_faces

__all__ = ["CLOTH_STEP", "cloth_matter"]

Array = NDArray[Any]

CLOTH_STEP = 1 / 12
"""Of cloth [s], which is stepped implicitly and bears any: a longer one flies past what it should touch."""


def cloth_matter(problem: PointProblem, spacing: float, most_quads: int) -> Matter | None:
    """All bodies of elastic material as nets of cloth; None where there are none.

    Raises
    ------
    SceneError
        Where a body has no faces and is no sheet, or bodies are of different materials.
    """
    faces = body_faces(problem)

    def net(rows: Array) -> Matter:
        if len({problem.materials[number] for number in problem.points.material_ids}) > 1:
            raise SceneError("blender's cloth has one material in a scene: simulate them apart, or use elastic = cage")
        own = faces.get(int(problem.points.body_ids[rows[0]]))
        return _of_quads(problem, rows, spacing, most_quads) if own is None else _of_faces(problem, rows, own)

    return joined(problem, net)


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
    length = float(np.linalg.norm(positions[edges[:, 1]] - positions[edges[:, 0]], axis=1).mean())
    one, other = (positions[own[:, k]] - positions[own[:, 0]] for k in (1, 2))
    area = float(np.linalg.norm(np.cross(one, other), axis=1).sum()) / 2
    # Blender divides by the mean length what a spring bears at a strain of one.
    return _net(problem, rows, net, edges, area, length / sheet_stiffness(positions, own, edges))


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
    return _net(problem, rows, net, edges, area, 0.75 * length)


def _net(problem: PointProblem, rows: Array, net: Cage, edges: Array, area: float, share: float) -> Matter:
    """A net of this area [m^2]; a spring bears `share` [m] times Young's modulus and thickness at a strain of one."""
    points = problem.points
    modulus = getattr(problem.materials[points.material_ids[rows[0]]], "youngs_modulus", 0.0)
    thickness = float(points.reference_volumes[rows].sum()) / area
    masses = problem.masses[rows]
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
