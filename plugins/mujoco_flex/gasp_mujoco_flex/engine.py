"""The engine behind the descriptor: opens sessions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, PointProblem, Precision, Rigid, SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.neighbours import point_distance
from gasp_core.stepping.voxel_cage import voxel_grid_around
from gasp_mujoco_flex.body_mass import matter_of
from gasp_mujoco_flex.cage import Cage, cage_of
from gasp_mujoco_flex.model import build_model
from gasp_mujoco_flex.plugin import MujocoOptions
from gasp_mujoco_flex.rigid import RigidBody, rigid_body
from gasp_mujoco_flex.session import MujocoSession
from gasp_mujoco_flex.voxel_grid import node_count

__all__ = ["MujocoFlex"]

Array = NDArray[Any]

_RIGID_CELLS = 16
"""Along a rigid body's longest side, where boxes stand for it."""
_MOST_CELLS = 2**14
"""Of a cage's whole grid: MuJoCo keeps 4.6 kB for each, filled or not."""
_COARSER = 1.03
"""By how much cells grow at least until their nodes are few enough."""


class MujocoFlex:
    """Soft bodies in cages of finite elements, and rigid ones; see `gasp_core.contract.PointEngine`."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str = "cpu",
        precision: Precision = Precision.FLOAT64,
        seed: int = 0,
        accuracy: EngineAccuracy | None = None,
        options: MujocoOptions | None = None,
        restart: Mapping[str, Array] | None = None,
    ) -> MujocoSession:
        """Open a session; nothing here is random, and there is one device and one precision.

        Raises
        ------
        SceneError
            Where a body is rigid and soft at once, is too large for a cage, or the checkpoint is of another scene.
        """
        accuracy = EngineAccuracy() if accuracy is None else accuracy
        options = MujocoOptions() if options is None else options
        soft, hard = _sorted_bodies(problem)
        spacing = accuracy.spacing_for(problem.points.size)
        cages, side = _cages(problem, soft, spacing, options)
        shapes = body_shapes(problem)
        bodies = [_rigid(problem, rows, spacing, shapes, filled=options.filled) for rows in hard]
        model = build_model(problem, cages, bodies, options)
        note = ""
        if side > 1.5 * spacing and not options.cells:
            note = (
                f"cages have cells of {side:.3g} m, not of {spacing:.3g} m, so as to have no more than"
                f" {options.node_limit} nodes: options cells and node_limit say otherwise"
            )
        return MujocoSession(problem, model, accuracy, note=note, restart=restart)


def _sorted_bodies(problem: PointProblem) -> tuple[list[Array], list[Array]]:
    """Rows of each soft and of each rigid body."""
    points = problem.points
    is_rigid = np.array([isinstance(material, Rigid) for material in problem.materials])[points.material_ids]
    order = np.argsort(points.body_ids, kind="stable")
    _, starts = np.unique(points.body_ids[order], return_index=True)
    soft: list[Array] = []
    hard: list[Array] = []
    for rows in np.split(order, starts[1:]):
        rigid = is_rigid[rows]
        if rigid.any() and not rigid.all():
            raise SceneError(
                f"body {points.body_ids[rows[0]]} is partly rigid and partly soft: make it two bodies, or one of them"
            )
        (hard if rigid.all() else soft).append(rows.astype(np.int32))
    return soft, hard


def _cages(
    problem: PointProblem, bodies: list[Array], spacing: float, options: MujocoOptions
) -> tuple[list[Cage], float]:
    """Cages of the soft bodies, and the size of their cells that was aimed at [m]."""
    if not bodies:
        return [], spacing
    points = problem.points
    clouds = [points.reference_positions[rows] for rows in bodies]
    margins = [point_distance(cloud, points.reference_volumes[rows]) / 2 for cloud, rows in zip(clouds, bodies)]
    largest = max(float(np.ptp(cloud, axis=0).max()) + 2 * margin for cloud, margin in zip(clouds, margins))
    if 8 * len(bodies) > options.node_limit:
        raise SceneError(
            f"{len(bodies)} soft bodies need {8 * len(bodies)} nodes at least, and node_limit is {options.node_limit}:"
            " raise it, or simulate fewer bodies"
        )
    side = largest / options.cells if options.cells else spacing

    def nodes(side: float) -> float:
        grids = [voxel_grid_around(cloud, margin, side) for cloud, margin in zip(clouds, margins)]
        if sum(np.prod(one.shape) for one in grids) > _MOST_CELLS:
            return math.inf
        return sum(node_count(one, cloud, filled=options.filled) for one, cloud in zip(grids, clouds))

    def built(side: float) -> list[Cage]:
        found: list[Cage] = []
        for rows, cloud, margin in zip(bodies, clouds, margins):
            grid = voxel_grid_around(cloud, margin, side)
            found.append(cage_of(matter_of(problem, rows, grid, spacing, filled=options.filled), grid))
        return found

    if options.cells:
        count = nodes(side)
        if count > options.node_limit:
            raise SceneError(
                f"{options.cells} cells along the largest body make cages of more than {_MOST_CELLS:,} cells or"
                f" {options.node_limit:,} nodes (node_limit): ask for fewer cells, or drop floaters"
            )
        return built(side), side
    side = max(side, largest / _MOST_CELLS ** (2 / 3))
    while (count := nodes(side)) > options.node_limit:
        # Cells that fill a line, a face or a body are the fewer the larger they are, by the power of one to three.
        side *= max(_COARSER, 0.9 * float(np.cbrt(count / options.node_limit)) if math.isfinite(count) else 1.2)
    cages = built(side)
    while sum(len(cage.masses) for cage in cages) > options.node_limit:
        side *= _COARSER
        cages = built(side)
    return cages, side


def _rigid(
    problem: PointProblem, rows: Array, spacing: float, shapes: Mapping[int, SignedDistanceField], *, filled: bool
) -> RigidBody:
    cloud = problem.points.reference_positions[rows]
    margin = point_distance(cloud, problem.points.reference_volumes[rows]) / 2
    side = (float(np.ptp(cloud, axis=0).max()) + 2 * margin) / _RIGID_CELLS
    grid = voxel_grid_around(cloud, margin, max(side, min(spacing, 2 * margin)))
    matter = matter_of(problem, rows, grid, spacing, filled=filled)
    return rigid_body(matter, grid, margin, shapes.get(int(problem.points.body_ids[rows[0]])))
