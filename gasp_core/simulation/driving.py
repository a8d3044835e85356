"""What moves matter from outside: from when on, and how fast."""

from __future__ import annotations

import math

import numpy as np

from gasp_core.contract import Driven, Impulse, Pinned, PointProblem, Trajectories, Wind
from gasp_core.stepping.rigid_motion import pose_of, starts_of

__all__ = ["drive_speed", "work_starts"]


def work_starts(problem: PointProblem) -> float:
    """Time [s] from which a drive, a wind, a collider or points that are led do work on the matter; inf if none does.

    A pinned region and still colliders do none. What the others put in, the engine alone knows, and part of it stays
    behind as elastic energy when they end: so the energy check is off from their start for good.
    """
    starts = [drive.start for drive in problem.drives if not isinstance(drive, Pinned)]
    starts += [field.start for field in problem.force_fields]
    starts += [starts_of(collider.motion) for collider in problem.colliders if collider.motion is not None]
    starts += [] if problem.trajectories is None else [0.0]
    return min(starts, default=math.inf)


def drive_speed(problem: PointProblem, time: float, step: float, reach: float) -> float:
    """Largest speed [m/s] that what moves matter gives to it in the frame before `time`.

    `reach` [m] is how far matter may be from a centre of rotation. An impulse gives any: inf.
    """
    speed = 0.0
    for event in [*problem.drives, *problem.force_fields]:
        begins, ends = event.start, event.end
        if isinstance(event, Impulse):
            if time - step <= begins <= time:
                return math.inf
        elif begins <= time and ends >= time - step:
            if isinstance(event, Driven):
                speed = max(speed, math.hypot(*event.velocity) + math.hypot(*event.angular_velocity) * reach)
            elif isinstance(event, Wind):
                speed = max(speed, math.hypot(*event.velocity))
    for collider in problem.colliders:
        if collider.motion is not None:
            for moment in (time - step, time):
                pose = pose_of(collider.motion, moment)
                speed = max(speed, math.hypot(*pose.velocity) + math.hypot(*pose.angular_velocity) * reach)
    return max(speed, _leading_speed(problem.trajectories, time, step))


def _leading_speed(led: Trajectories | None, time: float, step: float) -> float:
    """Largest mean speed [m/s] between two moments, of those within the frame before `time` [s] and one around it.

    Matter that is held by what is led has the speed of the fastest of it.
    """
    if led is None or len(led.times) == 1:
        return 0.0
    first = max(int(np.searchsorted(led.times, time - step)) - 1, 0)
    last = min(int(np.searchsorted(led.times, time)) + 2, len(led.times))
    ways = np.linalg.norm(np.diff(led.displacements[first:last].astype(np.float64), axis=0), axis=2)
    return float((ways / np.diff(led.times[first:last])[:, None]).max(initial=0.0))
