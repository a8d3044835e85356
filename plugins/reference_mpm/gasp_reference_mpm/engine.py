"""The engine: opens sessions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, PointCloud, PointProblem, Precision
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.time_step import refuse_unstable_substep
from gasp_reference_mpm.grid import grid_excess, grid_origin
from gasp_reference_mpm.material_points import Motion, matter_of
from gasp_reference_mpm.session import ReferenceSession
from gasp_reference_mpm.substep import seeded_affine_velocities

__all__ = ["ReferenceMpm"]

Array = NDArray[Any]


class ReferenceMpm:
    """MLS-MPM in plain NumPy and double precision; see `gasp_core.contract.PointEngine`."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any = None,
        restart: Mapping[str, Array] | None = None,
    ) -> ReferenceSession | RigidSession:
        """Set a problem up, or go on from a checkpoint of it.

        Nothing is drawn at random, there is one device and one precision, and no options of its own.

        Raises
        ------
        SceneError
            Where a fixed substep is above the stable bound, the points are too far apart for one grid, or the
            checkpoint is of another problem.
        """
        spacing = accuracy.spacing_for(problem.points.size)
        refuse_unstable_substep(problem, spacing, accuracy)
        rigid = RigidSide.of(problem, restart, "reference-mpm")
        if rigid is not None:
            if rigid.soft is None:
                return RigidSession(rigid, engine="reference-mpm", accuracy=accuracy, restart=restart)
            problem = rigid.soft
        excess = grid_excess(problem.points.reference_positions, spacing)
        if excess:
            raise SceneError(excess)
        origin = grid_origin(problem, spacing)
        matter = matter_of(problem, spacing)
        time, motion = (0.0, None) if restart is None else _restored(restart, problem.points)
        if motion is None:
            positions = problem.points.reference_positions - origin
            velocities = problem.points.initial_velocities
            tracers = problem.points.tracer_positions
            affine = seeded_affine_velocities(positions, spacing, problem.points.body_ids, matter.masses, velocities)
            motion = Motion(
                positions=positions,
                velocities=velocities,
                affine_velocities=affine,
                velocity_gradients=affine,
                deformations=np.tile(np.eye(3), (len(positions), 1, 1)),
                history=np.zeros(len(positions)),
                shock_pressures=np.zeros(len(positions)),
                tracers=np.zeros((0, 3)) if tracers is None else tracers - origin,
            )
        return ReferenceSession(problem, matter, motion, origin, spacing, accuracy, time, rigid)


def _restored(checkpoint: Mapping[str, Array], points: PointCloud) -> tuple[float, Motion]:
    count = len(points)
    shapes = {
        "positions": (count, 3),
        "velocities": (count, 3),
        "affine_velocities": (count, 3, 3),
        "velocity_gradients": (count, 3, 3),
        "deformations": (count, 3, 3),
        "history": (count,),
        "shock_pressures": (count,),
        "tracers": np.shape(np.zeros((0, 3)) if points.tracer_positions is None else points.tracer_positions),
    }
    arrays = checkpoint_arrays(checkpoint, {"time": (), **shapes}, "reference-mpm")
    motion = Motion(**{name: arrays[name].astype(np.float64) for name in shapes})
    return float(arrays["time"]), motion
