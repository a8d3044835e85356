"""A session's state as arrays by name, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Metal, PointProblem, Sand
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_genesis_mpm.affine_velocities import seeded_affine_velocities
from gasp_genesis_mpm.grid_window import NODE_LIMIT, Window
from gasp_genesis_mpm.particle_state import Motion

__all__ = ["Start", "restored", "stored"]

Array = NDArray[Any]

_MOTION = ("cells", "velocities", "affine_velocities", "deformations", "history")


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where a session begins.

    Parameters
    ----------
    time
        [s]
    motion
        Of the points.
    window
        The place of the grid; None for any.
    """

    time: float
    motion: Motion
    window: Window | None


def stored(time: float, motion: Motion, window: Window, origin: Array, spacing: float) -> dict[str, Array]:
    """Arrays from which a session goes on as if nothing had happened."""
    arrays = {name: getattr(motion, name).copy() for name in _MOTION}
    grid = np.array([window.shift, window.half])
    frame = np.array([*origin, spacing])
    return {"time": np.array(time), "frame": frame, "window": grid, **arrays}


def restored(restart: Mapping[str, Array] | None, problem: PointProblem, origin: Array, spacing: float) -> Start:
    """The beginning of a problem, or where a checkpoint of it was made.

    Raises
    ------
    SceneError
        Where the checkpoint is of another problem.
    """
    if restart is None:
        return Start(time=0.0, motion=_beginning(problem, origin, spacing), window=None)
    count = len(problem.points)
    shapes: dict[str, tuple[int, ...]] = {"cells": (count, 3), "velocities": (count, 3), "history": (count,)}
    shapes |= {"affine_velocities": (count, 3, 3), "deformations": (count, 3, 3)}
    shapes |= {"time": (), "frame": (4,), "window": (2, 3)}
    kept = checkpoint_arrays(restart, shapes, "genesis-mpm")
    if not np.array_equal(kept["frame"], [*origin, spacing]):
        raise SceneError(
            "the checkpoint was written for another scene or grid spacing: resume with the scene and accuracy the run"
            " was started with"
        )
    shift, half = ((int(x), int(y), int(z)) for x, y, z in kept["window"])
    motion = Motion(**{name: kept[name].astype(np.float64) for name in _MOTION})
    window = Window(shift=shift, half=half)
    if window.node_count > NODE_LIMIT or not window.holds(motion.cells):
        raise SceneError(
            "genesis-mpm: the checkpoint's grid does not hold its points: it is damaged; start the run anew"
        )
    return Start(time=float(kept["time"]), motion=motion, window=window)


def _beginning(problem: PointProblem, origin: Array, spacing: float) -> Motion:
    points = problem.points
    cells = (points.reference_positions - origin) / spacing
    from_nothing = np.array([isinstance(material, Sand | Metal) for material in problem.materials])
    return Motion(
        cells=cells,
        velocities=points.initial_velocities.copy(),
        affine_velocities=seeded_affine_velocities(cells, problem.masses, points.initial_velocities) / spacing,
        deformations=np.tile(np.eye(3), (len(points), 1, 1)),
        # Sand remembers a logarithm and metal a strain, everything else a ratio.
        history=np.where(from_nothing[points.material_ids], 0.0, 1.0),
    )
