"""What acts on matter at a time, worked out once for every engine that steps: windows, moved regions, walls."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    Drive,
    Driven,
    ForceField,
    HalfSpace,
    Impulse,
    PointProblem,
    Side,
    SteadyMotion,
)
from gasp_core.stepping.rigid_motion import Pose, pose_of, rotation_matrix

__all__ = [
    "bodies_held",
    "drives_at",
    "force_fields_at",
    "pose_of_drive",
    "position_at_start",
    "prescribed_velocities",
    "problem_fingerprint",
    "rotation_matrix",
    "walls_of",
]

Array = NDArray[Any]

_OUTWARD = np.array([[-1.0, 0, 0], [1.0, 0, 0], [0, -1.0, 0], [0, 1.0, 0], [0, 0, -1.0], [0, 0, 1.0]])


def force_fields_at(force_fields: Iterable[ForceField], time: float) -> list[ForceField]:
    """Those that act at a time [s]: from their start on, at their end no more."""
    return [force for force in force_fields if force.start <= time < force.end]


def drives_at(drives: Iterable[Drive], time: float) -> list[Drive]:
    """Those that hold matter at a time [s], in the order given; impulses hold nothing."""
    return [drive for drive in drives if not isinstance(drive, Impulse) and drive.start <= time < drive.end]


def pose_of_drive(drive: Driven, time: float) -> Pose:
    """Where what a drive holds is at a time [s] of its window, from where it was at its start, and how fast."""
    motion = SteadyMotion(
        velocity=drive.velocity, angular_velocity=drive.angular_velocity, center=drive.center, start=drive.start
    )
    return pose_of(motion, time)


def position_at_start(drive: Drive, time: float, positions: Array) -> Array:
    """Where places (N, 3) [m] at a time [s] were when a drive began, had they gone with it.

    The region of a drive moves with it: a place is in it where the place it came from is in `drive.region`.
    """
    return pose_of_drive(drive, time).before(positions) if isinstance(drive, Driven) else positions


def bodies_held(
    drives: Sequence[Drive], time: float, positions: Array, bodies: Array, count: int, spacing: float
) -> Array:
    """Which of `count` bodies, all of a scene's, have matter in the region of each drive at a time [s], (K, count) of
    bool.

    What lies against a region is not held by it, though nodes that it speaks to are inside: a block that glides on
    one that is pinned glides on. So a body counts that has a point a third of a cell deep in the region, which is more
    than contact leaves, or half as deep as any other. Where none has a point inside, nodes may still be, and they hold
    what is nearest, with what is less than a third of a cell farther: a body by itself is held by whatever a drive
    finds, wherever others are.

    Parameters
    ----------
    positions : (N, 3) [m]
    bodies : (N,)
        Whose they are.
    spacing
        Of the grid [m].
    """
    found = np.ones((len(drives), count), dtype=np.bool_)
    if count > 1:
        for row, drive in enumerate(drives):
            depths = np.full(count, -np.inf)
            np.maximum.at(depths, bodies, -drive.region.signed_distance(position_at_start(drive, time, positions)))
            deepest = depths.max()
            found[row] = depths >= (min(spacing / 3, deepest / 2) if deepest > 0 else deepest - spacing / 3)
    return found


def prescribed_velocities(drive: Drive, time: float, step: float, positions: Array) -> Array:
    """Velocities (N, 3) [m/s] that a drive gives to matter at places (N, 3) [m] at a time [s], for a step [s]."""
    if not isinstance(drive, Driven):
        return np.zeros_like(positions)
    return pose_of_drive(drive, time).during(step).velocities(positions)


def walls_of(collider: Collider) -> Sequence[Collider]:
    """A box seen from inside as its six walls: on its edges two of them hold, in its corners three; others as they are.

    The gradient of a hollow box's signed distance knows only the nearest wall, so that matter in an edge would be held
    by one and pass through the other.
    """
    if not (isinstance(collider.shape, BoxShape) and collider.side is Side.INSIDE):
        return [collider]
    center, half = np.asarray(collider.shape.center), np.asarray(collider.shape.half_extents)
    faces = [HalfSpace(point=tuple(center + half * out), normal=tuple(-out)) for out in _OUTWARD]
    return [dataclasses.replace(collider, shape=face, side=Side.OUTSIDE) for face in faces]


def problem_fingerprint(problem: PointProblem) -> str:
    """SHA-256 of all that a problem says, to the last bit: what a checkpoint may be known by.

    But for its hints, and where points are led, which is longer in a run that is made longer.
    """
    digest = hashlib.sha256()
    given = [(field.name, getattr(problem.points, field.name)) for field in dataclasses.fields(problem.points)]
    given += [] if problem.trajectories is None else [("led", problem.trajectories.rows)]
    for field, value in given:
        columns = sorted(value.items()) if isinstance(value, dict) else [(field, value)]
        for name, array in columns:
            if array is not None:
                digest.update(f"{field} {name} {array.dtype.str} {array.shape};".encode())
                digest.update(np.ascontiguousarray(array).tobytes())
    for field in dataclasses.fields(problem):
        if field.name not in ("points", "trajectories", "hints"):
            # Frozen dataclasses of numbers, whose repr has every digit.
            digest.update(f"{field.name} {getattr(problem, field.name)!r};".encode())
    return digest.hexdigest()
