"""Points that are led along trajectories: where they are, and how fast."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem, Rigid, Trajectories
from gasp_core.errors import SceneError

__all__ = ["LedPoints", "refuse_led_rigid_bodies"]

Array = NDArray[Any]

_SAME_TIME = 1e-6
"""Of the time between two moments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LedPoints:
    """The led points of a problem.

    Parameters
    ----------
    rows : (K,)
        Of the problem's points.
    bodies : (K,)
    masses : (K,) [kg]
    trajectories
        As the problem has them.
    start : (K, 3) [m]
        Where they begin.
    """

    rows: Array
    bodies: Array
    masses: Array
    trajectories: Trajectories
    start: Array
    _segments: dict[int, _Segment] = field(default_factory=dict[int, "_Segment"], repr=False, compare=False)

    @classmethod
    def of(cls, problem: PointProblem) -> Self | None:
        """Those of a problem; None where none are led.

        Raises
        ------
        SceneError
            Where the body of one of them is rigid.
        """
        trajectories = problem.trajectories
        if trajectories is None:
            return None
        refuse_led_rigid_bodies(problem)
        rows = trajectories.rows
        return cls(
            rows=rows,
            bodies=problem.points.body_ids[rows],
            masses=problem.masses[rows],
            trajectories=trajectories,
            start=problem.points.reference_positions[rows],
        )

    def positions(self, time: float) -> Array:
        """Where they are at a time [s], (K, 3) [m]."""
        segment, share = self._segment(time)
        if segment is None:
            return self.start + self.trajectories.displacements[-1]
        return self.start + _bezier(segment.control_points(), share)

    def velocities(self, time: float) -> Array:
        """How fast they are at a time [s], (K, 3) [m/s]; at the last moment as before it."""
        segment, share = self._segment(time, closed=True)
        if segment is None:
            return np.zeros_like(self.start)
        return _bezier(segment.velocities(), share)

    def put(self, time: float, positions: Array, velocities: Array | None) -> None:
        """Set their rows of positions [m] and velocities [m/s] of all points, (N, 3), to those at a time [s]."""
        positions[self.rows] = self.positions(time)
        if velocities is not None:
            velocities[self.rows] = self.velocities(time)

    def mean_velocities(self, begin: float, end: float) -> Array:
        """By which they go from where they are at one time [s] to where they are at another, (K, 3) [m/s].

        Between two moments Simpson's rule is exact, and a difference of places over a short time would not be.
        """
        if self._segment(begin)[0] is None:
            return np.zeros_like(self.start)
        first, middle, last = (self.velocities(time) for time in (begin, (begin + end) / 2, end))
        return (first + 4 * middle + last) / 6

    def fastest(self, time: float) -> float:
        """Bound on their speeds [m/s] from a time [s] to the next moment."""
        segment, _ = self._segment(time)
        if segment is None:
            return 0.0
        # A curve lies between its control points.
        return max(float(np.linalg.norm(each, axis=1).max()) for each in segment.velocities())

    def _segment(self, time: float, *, closed: bool = False) -> tuple[_Segment | None, float]:
        """Between which moments a time lies, and how far along; None after the last, or without a second."""
        times, places = self.trajectories.times, self.trajectories.displacements
        last = len(times) - 1
        # Sums of steps end a rounding off a moment.
        over = last == 0 or time > times[-1] + _SAME_TIME * (times[-1] - times[-2])
        if over or (time >= times[-1] and not closed):
            return None, 0.0
        row = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), last - 1)
        segment = self._segments.get(row)
        if segment is None:
            segment = _Segment(
                begin=places[row].astype(np.float64),
                end=places[row + 1].astype(np.float64),
                begin_velocity=_slope(times, places, row),
                end_velocity=_slope(times, places, row + 1),
                span=float(times[row + 1] - times[row]),
            )
            # Steps ask for the same one, over and over.
            self._segments.clear()
            self._segments[row] = segment
        return segment, (time - float(times[row])) / segment.span


def refuse_led_rigid_bodies(problem: PointProblem) -> None:
    """Refuse a problem in which points of a rigid body are led.

    Raises
    ------
    SceneError
    """
    led, points = problem.trajectories, problem.points
    if led is None:
        return
    rigid = np.array([isinstance(material, Rigid) for material in problem.materials])[points.material_ids]
    if np.isin(points.body_ids[led.rows], points.body_ids[rigid]).any():
        raise SceneError("rigid bodies cannot be led along trajectories, not in part either: make them soft")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Segment:
    """A cubic between two moments: displacements (K, 3) [m] and velocities (K, 3) [m/s] at both, `span` [s] apart."""

    begin: Array
    end: Array
    begin_velocity: Array
    end_velocity: Array
    span: float

    def control_points(self) -> list[Array]:
        """Of the displacement, as a Bezier curve has them."""
        third = self.span / 3
        return [self.begin, self.begin + third * self.begin_velocity, self.end - third * self.end_velocity, self.end]

    def velocities(self) -> list[Array]:
        """Control points of the velocity."""
        mean = (self.end - self.begin) / self.span
        return [self.begin_velocity, 3 * mean - self.begin_velocity - self.end_velocity, self.end_velocity]


def _bezier(points: list[Array], share: float) -> Array:
    """de Casteljau."""
    while len(points) > 1:
        points = [(1 - share) * one + share * other for one, other in itertools.pairwise(points)]
    return points[0]


def _slope(times: Array, places: Array, row: int) -> Array:
    """Derivative (K, 3) at a moment of the parabola through it and its neighbours, at the ends through the nearest."""
    count = min(3, len(times))
    first = min(max(row - 1, 0), len(times) - count)
    nodes = times[first : first + count]
    now = times[row]
    slope = np.zeros(places.shape[1:])
    for j in range(count):
        others = [k for k in range(count) if k != j]
        scale = np.prod([nodes[j] - nodes[k] for k in others])
        # Of a Lagrange polynomial: the sum over the factors that are left out.
        weight = sum(np.prod([now - nodes[k] for k in others if k != left]) for left in others) / scale
        slope += weight * places[first + j]
    return slope
