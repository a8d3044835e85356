"""A running simulation: chooses steps, lands on times, judges the state.

It knows no backend: what steps the points is a `SteppedCloud` that somebody else builds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Status, StepReport
from gasp_core.engine.forcing import DomainPolicy, Impulse
from gasp_core.engine.stability import (
    MotionLimits,
    driven_speed,
    event_times,
    hardening_of,
    substep_size,
    substeps_to,
)
from gasp_core.errors import SceneError
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import GridTooLargeError
from gasp_mpm_host.forcing_tables import (
    active_drives,
    active_winds,
    collider_rows,
    drive_rows,
    wind_rows,
)
from gasp_mpm_host.rows import Survey
from gasp_mpm_host.scaling import Units

__all__ = ["FarAwayError", "MpmSession", "SteppedCloud"]

Array = NDArray[Any]

_LONGEST_BATCH = 20
"""Steps between two looks at what bounds them."""
_BATCH_TRAVEL = 0.5
"""In cells: how far a point may fly between two looks."""
_FELT = 1.5
"""In cells: how far away from a node points feel what acts there."""


class FarAwayError(Exception):
    """A point is too many cells away to be given a cell."""


class SteppedCloud(Protocol):
    """Points and grid in a backend's memory."""

    def survey(self) -> Survey:
        """Look at every point."""
        ...

    def sort(self) -> None:
        """Put the points into order; raises FarAwayError or GridTooLargeError where there is none."""
        ...

    def set_walls(self, lower: Array, upper: Array) -> None:
        """Hold points and nodes within a box [m] from now on."""
        ...

    def begin_batch(self, step: float, gravity: Array, colliders: Array, winds: Array, drives: Array) -> None:
        """Set what acts during the next steps of `step` [s]; `drives` holds (steps, K, width) rows."""
        ...

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch: how many were done, whether a point drifted, whether the edge held any."""
        ...

    def push(self, members: Array, change: Array) -> None:
        """Add `change` (3,) [m/s] to the velocities of `members` (N,)."""
        ...

    def positions(self) -> Array:
        """(N, 3) [m], in the given order."""
        ...

    def velocities(self) -> Array:
        """(N, 3) [m/s], in the given order."""
        ...

    def deformation_gradients(self) -> Array:
        """(N, 3, 3), in the given order."""
        ...

    def tracer_positions(self) -> Array:
        """(M, 3) [m], in the given order; none where the scene has none."""
        ...

    def checkpoint(self) -> dict[str, Array]:
        """The state, for a restart."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...


CloudBuilder = Callable[[PointProblem, Units, Mapping[str, Array] | None, str], SteppedCloud]
"""From problem, units, checkpoint and the engine's name."""


class _StoppedError(Exception):
    """Leaves the stepping loops with a verdict."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class _Tally:
    """What one advance has done so far."""

    def __init__(self) -> None:
        self.count = 0
        self.sizes: set[float] = set()
        self.clamped = False
        self.inverted = 0

    def add(self, count: int, step: float, clamped: bool) -> None:
        self.clamped |= clamped
        if count:
            self.count += count
            self.sizes.add(step)

    def report(self, stop: _StoppedError | None) -> StepReport:
        warnings = [] if stop is None else [stop.reason]
        if self.inverted:
            warnings.append(
                f"{self.inverted} point(s) are inverted (det F <= 0): refine the grid or stiffen the material"
            )
        if self.clamped:
            warnings.append("matter was held back at the domain's edge")
        return StepReport(
            status=Status.OK if stop is None else stop.status,
            substep_count=self.count,
            smallest_substep=min(self.sizes, default=0.0),
            largest_substep=max(self.sizes, default=0.0),
            warnings=tuple(warnings),
        )


def _named(index: int, place: Array) -> str:
    return f"point {index} at ({', '.join(f'{value:.4g}' for value in place)}) m"


def _farthest(positions: Array) -> str:
    away = np.abs(positions - np.median(positions, axis=0)).max(axis=1)
    worst = int(np.argmax(away))
    return f"{_named(worst, positions[worst])} is {away[worst]:.3g} m away from the others"


class MpmSession:
    """A session of an explicit MPM engine; see `gasp_core.engine.contract.EngineSession`.

    Parameters
    ----------
    problem
        What is simulated.
    engine
        The engine's name, for messages.
    accuracy
        The common knobs.
    build
        Makes the cloud.
    restart
        A checkpoint of a session of the same problem, or None.

    Raises
    ------
    SceneError
        For points too far apart for a grid, or a checkpoint of something else.
    """

    def __init__(
        self,
        problem: PointProblem,
        *,
        engine: str,
        accuracy: EngineAccuracy,
        build: CloudBuilder,
        restart: Mapping[str, Array] | None = None,
    ) -> None:
        self._problem = problem
        self._engine = engine
        self._accuracy = accuracy
        self._units = units = Units.of(problem, accuracy.spacing_for(problem.points))
        self._frame = np.array([*units.anchor, units.spacing, units.time, units.mass])
        self._time = 0.0 if restart is None else self._time_of(restart)
        self._colliders = collider_rows(problem.colliders, units)
        self._hardening = hardening_of(problem)
        self._events = event_times(problem.drives, problem.force_fields)
        try:
            self._cloud: SteppedCloud | None = build(problem, units, restart, engine)
        except (GridTooLargeError, FarAwayError) as error:
            raise SceneError(
                f"{engine}: {_farthest(problem.points.reference_positions)}, too far for a grid of spacing"
                f" {units.spacing:.3g} m: raise the spacing (lower the resolution), or leave that point out"
            ) from error
        domain = problem.domain
        if domain is not None and domain.policy is DomainPolicy.CLAMP:
            self._cloud.set_walls(np.array(domain.lower), np.array(domain.upper))

    def _time_of(self, restart: Mapping[str, Array]) -> float:
        if "time" in restart and np.array_equal(restart.get("frame", ()), self._frame):
            return float(restart["time"])
        raise SceneError(
            f"{self._engine}: the checkpoint was written for another scene or grid spacing: resume with the scene and"
            " accuracy the run was started with"
        )

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s], landing on everything that starts or ends on the way.

        Raises
        ------
        ValueError
            Where `time` lies behind, or is not a number, or the session is closed.
        """
        cloud = self._living()
        if not (math.isfinite(time) and time >= self._time):
            raise ValueError(f"cannot advance from {self._time!r} s to {time!r} s")
        tally = _Tally()
        try:
            while self._time < time:
                later = self._events[(self._events > self._time) & (self._events < time)]
                self._land(cloud, float(later[0]) if len(later) else time, time, tally)
        except _StoppedError as stop:
            return tally.report(stop)
        return tally.report(None)

    def _land(self, cloud: SteppedCloud, landing: float, end: float, tally: _Tally) -> None:
        """Advance to `landing`, between which and now nothing starts or ends, on the way to `end`."""
        self._strike(cloud)
        survey = cloud.survey()
        self._judge(survey, tally, 0.0)
        while self._time < landing:
            limits = self._limits(survey)
            allowed = substep_size(limits, self._units.spacing, self._accuracy)
            self._refuse_too_many(allowed, end, tally)
            count, step = substeps_to(landing - self._time, allowed)
            reach = int(min(_LONGEST_BATCH, limits.lasting(_BATCH_TRAVEL * self._units.spacing) / step))
            taking = min(count, max(1, reach))
            self._take(cloud, taking, step, tally)
            if taking == count:
                self._time = landing  # the very number that was asked for, not a sum of steps
            survey = cloud.survey()
            self._judge(survey, tally, step)

    def _limits(self, survey: Survey) -> MotionLimits:
        felt = _FELT * self._units.spacing
        driven = driven_speed(self._problem.drives, self._time, survey.low - felt, survey.high + felt)
        return MotionLimits(
            stress=survey.stress,
            speed=max(survey.speed, driven),
            velocity_gradient=survey.velocity_gradient,
            acceleration=math.hypot(*self._problem.gravity),
            hardening=self._hardening,
        )

    def _take(self, cloud: SteppedCloud, count: int, step: float, tally: _Tally) -> None:
        """Take `count` steps, sorting where a point has strayed from its home."""
        begin = self._time
        winds, drives = active_winds(self._problem, begin), active_drives(self._problem, begin)
        placed = [drive_rows(drives, begin + index * step, self._units) for index in range(count)]
        cloud.begin_batch(
            step,
            np.asarray(self._problem.gravity),
            self._colliders,
            wind_rows(winds, step, self._units),
            np.array(placed).reshape(count, len(drives), at.DRIVE_WIDTH),
        )
        done = 0
        while done < count:
            taken, drifted, clamped = cloud.steps(done, count)
            done += taken
            self._time = begin + done * step
            tally.add(taken, step, clamped)
            if drifted:
                self._judge(cloud.survey(), tally, step)
                self._sort(cloud)

    def _sort(self, cloud: SteppedCloud) -> None:
        try:
            cloud.sort()
        except (GridTooLargeError, FarAwayError) as error:
            raise _StoppedError(
                Status.OUT_OF_DOMAIN,
                f"{_farthest(cloud.positions())}, too far for a grid of spacing {self._units.spacing:.3g} m:"
                " add a floor or a domain, or use a coarser resolution",
            ) from error

    def _strike(self, cloud: SteppedCloud) -> None:
        """Give the impulses that start now, each shared in proportion to mass."""
        due = [drive for drive in self._problem.drives if isinstance(drive, Impulse) and drive.start == self._time]
        if not due:
            return
        masses, positions = self._problem.masses, cloud.positions()
        for impulse in due:
            struck = impulse.region.signed_distance(positions) <= 0
            if struck.any():
                cloud.push(struck, np.asarray(impulse.impulse) / float(masses[struck].sum()))

    def _refuse_too_many(self, step: float, end: float, tally: _Tally) -> None:
        limit = self._accuracy.substep_limit
        needed = tally.count + ((end - self._time) / step * (1 - 1e-9) if step > 0 else math.inf)
        if needed <= limit:
            return
        total = f"{math.ceil(needed):,}" if math.isfinite(needed) else "infinitely many"
        raise _StoppedError(
            Status.SUBSTEP_LIMIT,
            f"this frame would need {total} substeps of {step:.3g} s, the limit is {limit:,}: raise substep_limit,"
            " lower the stiffness, or use a coarser resolution",
        )

    def _judge(self, survey: Survey, tally: _Tally, step: float) -> None:
        """Stop where the state is no longer credible or has left the domain."""
        if not survey.finite:
            raise _StoppedError(Status.NON_FINITE, self._lost(step))
        tally.inverted = max(tally.inverted, survey.inverted)
        leap = survey.speed * step / self._units.spacing
        if leap > 1:
            raise _StoppedError(
                Status.NON_FINITE,
                f"points move {leap:.3g} cells in one substep of {step:.3g} s: the motion has blown up; lower"
                " substep_fraction, or check the scene's forces",
            )
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.STOP:
            return
        lower, upper = np.array(domain.lower), np.array(domain.upper)
        if (survey.low < lower).any() or (survey.high > upper).any():
            positions = self._living().positions()
            outside = np.maximum(lower - positions, positions - upper).max(axis=1)
            worst = int(np.argmax(outside))
            raise _StoppedError(
                Status.OUT_OF_DOMAIN,
                f"{_named(worst, positions[worst])} left the domain, {outside[worst]:.3g} m outside: enlarge the"
                ' domain, or use the policy "expand" or "clamp"',
            )

    def _lost(self, step: float) -> str:
        cloud = self._living()
        rows = (cloud.positions(), cloud.velocities(), cloud.deformation_gradients().reshape(-1, 9))
        bad = ~np.isfinite(np.concatenate(rows, axis=1)).all(axis=1)
        first = ", ".join(map(str, np.flatnonzero(bad)[:5])) or "none alone"
        return (
            f"{int(bad.sum())} point(s) are no longer finite, first {first}, with substeps of {step:.3g} s:"
            " lower substep_fraction, or check the scene's forces"
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given, float64, owned."""
        cloud = self._living()
        traced = self._problem.points.tracer_positions is not None and Field.TRACER_POSITIONS in fields
        return PointState(
            time=self._time,
            positions=cloud.positions(),
            velocities=cloud.velocities() if Field.VELOCITIES in fields else None,
            deformation_gradients=cloud.deformation_gradients() if Field.DEFORMATION_GRADIENTS in fields else None,
            tracer_positions=cloud.tracer_positions() if traced else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything a restart needs."""
        return {"time": np.array(self._time), "frame": self._frame.copy(), **self._living().checkpoint()}

    def close(self) -> None:
        """Give the memory back; may be called twice."""
        cloud, self._cloud = self._cloud, None
        if cloud is not None:
            cloud.close()

    def _living(self) -> SteppedCloud:
        if self._cloud is None:
            raise ValueError(f"{self._engine}: the session is closed: open a new one")
        return self._cloud

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()
