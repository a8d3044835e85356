"""When two runs part, and whether something had met something by then.

An error after a bounce is another thing than one before it: what hits the ground a frame later is somewhere else for
the rest of the run, however alike two engines are.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.accuracy.trajectories import TrajectoryDistance
from gasp_core.contract import Collider, PointProblem, Side
from gasp_core.errors import RecordingError
from gasp_core.recording import Recording
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["APART", "Parting", "first_meeting", "parting_of"]

Array = NDArray[Any]

APART = 0.01
"""Of the diagonal: two runs are apart from the first frame on whose rms distance is beyond it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting:
    """Of two runs, in their frames.

    Parameters
    ----------
    apart_at
        Time [s] of the first frame in which they are further apart than `APART`; None: in no frame.
    met_at
        Time [s] of the first frame in which, in one of them, something touches what it did not touch at the start;
        None: in no frame that both have.
    """

    apart_at: float | None
    met_at: float | None

    def __str__(self) -> str:
        """In words."""
        percent = f"{100 * APART:g} %"
        if self.apart_at is None:
            return f"never {percent} apart"
        when = f"{percent} apart at {self.apart_at:.3g} s"
        if self.met_at is None:
            return f"{when}, and nothing meets anything"
        if self.apart_at < self.met_at:
            return f"{when}, before anything meets anything"
        if self.apart_at == self.met_at:
            return f"{when}, in the frame of the first contact"
        return f"{when}, {self.apart_at - self.met_at:.3g} s after the first contact"


def parting_of(distance: TrajectoryDistance, meetings: tuple[float | None, float | None]) -> Parting:
    """Of two runs that are so far apart, and in which something first meets something at these times [s]."""
    beyond = np.flatnonzero(np.asarray(distance.per_frame.rms) > APART * distance.diagonal)
    last = float(distance.times[-1])
    met = [time for time in meetings if time is not None and time <= last]
    return Parting(
        apart_at=float(distance.times[beyond[0]]) if len(beyond) else None,
        met_at=min(met) if met else None,
    )


def first_meeting(recording: Recording, problem: PointProblem, reach: float) -> float | None:
    """Time [s] of the first frame in which a body touches a collider, or another body, that it did not at the start.

    Parameters
    ----------
    recording
        Of the problem.
    problem
        Colliders, and which points are of which body.
    reach
        [m] within which points touch: a cell of the grid.

    Returns
    -------
    None where that is in no frame.

    Raises
    ------
    RecordingError
        Where its points are others, or a frame is damaged.
    """
    if len(problem.points) != len(recording.start_points):
        raise RecordingError(
            f"{recording.path}: has {len(recording.start_points)} points, not the {len(problem.points)} of its scene"
        )
    bodies = [slice(entry.first, entry.last) for entry in recording.header.bodies]
    at_start: set[tuple[int, int]] = set()
    for frame, time in enumerate(recording.times):
        touching = set(_touching(recording.points(frame), bodies, problem.colliders, float(time), reach))
        if frame == 0:
            at_start = touching
        elif touching - at_start:
            return float(time)
    return None


def _touching(
    points: Array, bodies: list[slice], colliders: tuple[Collider, ...], time: float, reach: float
) -> Iterator[tuple[int, int]]:
    """Pairs that touch: of a body and a collider, which counts on from -1 downwards, and of two bodies."""
    for body, rows in enumerate(bodies):
        for number, collider in enumerate(colliders):
            places = points[rows]
            if collider.motion is not None:
                places = pose_of(collider.motion, time).before(places)
            outside = 1.0 if collider.side is Side.OUTSIDE else -1.0
            if float((outside * collider.shape.signed_distance(places)).min()) < reach:
                yield body, -1 - number
    for one, other in itertools.combinations(range(len(bodies)), 2):
        if _near(points[bodies[one]], points[bodies[other]], reach):
            yield one, other


def _near(first: Array, second: Array, reach: float) -> bool:
    """Whether some point of (N, 3) is within reach of one of (M, 3)."""
    from scipy.spatial import KDTree

    lower = np.maximum(first.min(axis=0), second.min(axis=0)) - reach
    upper = np.minimum(first.max(axis=0), second.max(axis=0)) + reach
    # Only what is in both boxes can touch.
    first, second = (own[((own >= lower) & (own <= upper)).all(axis=1)] for own in (first, second))
    if not (len(first) and len(second)):
        return False
    tree: Any = KDTree(first)
    return bool(np.isfinite(tree.query(second, distance_upper_bound=reach)[0]).any())
