"""A running simulation: chooses steps, lands on times, judges the state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Status, StepReport
from gasp_core.engine.forcing import Domain, DomainPolicy, Impulse
from gasp_core.engine.stability import (
    MotionLimits,
    driven_speed,
    event_times,
    hardening_of,
    substep_size,
    substeps_to,
)
from gasp_core.errors import SceneError
from gasp_taichi_mpm import layout as at
from gasp_taichi_mpm import runtime
from gasp_taichi_mpm.cells import GridTooLargeError
from gasp_taichi_mpm.cloud import Cloud, FarAwayError, Survey
from gasp_taichi_mpm.forcing_tables import active_drives, active_winds, collider_rows, drive_rows, wind_rows
from gasp_taichi_mpm.scaling import Units

__all__ = ["TaichiSession"]

Array = NDArray[Any]

_LONGEST_BATCH = 20
"""Steps between two looks at what bounds them."""


class _StoppedError(Exception):
    """Leaves the stepping loops with a verdict."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


def _farthest(positions: Array) -> str:
    away = np.abs(positions - np.median(positions, axis=0)).max(axis=1)
    worst = int(np.argmax(away))
    place = ", ".join(f"{value:.4g}" for value in positions[worst])
    return f"point {worst} at ({place}) m is {away[worst]:.3g} m away from the others"


class TaichiSession:
    """A session of the Taichi engine; see `gasp_core.engine.contract.EngineSession`."""

    def __init__(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        double: bool,
        threads: int,
        on_gpu: bool,
        restart: Mapping[str, Array] | None,
    ) -> None:
        self._problem = problem
        self._accuracy = accuracy
        self._units = Units.of(problem, accuracy.spacing_for(problem.points))
        frame = np.array([*self._units.anchor, self._units.spacing, self._units.time, self._units.mass])
        self._time = 0.0
        if restart is not None:
            if "time" not in restart or not np.array_equal(restart.get("frame", ()), frame):
                raise SceneError(
                    "taichi-mpm: the checkpoint was written for another scene or grid spacing:"
                    " resume with the scene and accuracy the run was started with"
                )
            self._time = float(restart["time"])
        self._frame = frame
        self._colliders = collider_rows(problem.colliders, self._units)
        self._events = event_times(problem.drives, problem.force_fields)
        self._hardening = hardening_of(problem)
        try:
            self._cloud: Cloud | None = Cloud(
                problem, self._units, double=double, threads=threads, on_gpu=on_gpu, restart=restart
            )
        except (GridTooLargeError, FarAwayError) as error:
            raise SceneError(
                f"taichi-mpm: {_farthest(problem.points.reference_positions)}, too far for a grid of spacing"
                f" {self._units.spacing:.3g} m: raise the spacing (lower the resolution), or leave that point out"
            ) from error
        domain = problem.domain
        if domain is not None and domain.policy is DomainPolicy.CLAMP:
            self._cloud.set_walls(np.array(domain.lower), np.array(domain.upper))

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s].

        Raises
        ------
        ValueError
            Where `time` lies behind, or is not a number.
        """
        cloud = self._open_cloud()
        if not math.isfinite(time) or time < self._time:
            raise ValueError(f"cannot advance from {self._time!r} s to {time!r} s")
        tally = _Tally()
        verdict = Status.OK
        reason: tuple[str, ...] = ()
        try:
            ends = [event for event in self._events.tolist() if self._time < event < time]
            for end in [*ends, time]:
                self._segment(cloud, end, time, tally)
        except _StoppedError as stop:
            verdict, reason = stop.status, (stop.reason,)
        return tally.report(verdict, reason)

    def _segment(self, cloud: Cloud, end: float, last: float, tally: _Tally) -> None:
        """Advance to `end`, between which and now nothing starts or ends."""
        if end <= self._time:
            return
        self._impulses(cloud)
        survey = cloud.survey()
        self._judge(survey, tally, 0.0)
        while self._time < end:
            # Drives act at nodes, which points feel from a cell and a half away.
            felt = 1.5 * self._units.spacing
            driven = driven_speed(self._problem.drives, self._time, survey.low - felt, survey.high + felt)
            limits = MotionLimits(
                stress=survey.stress,
                speed=max(survey.speed, driven),
                velocity_gradient=survey.velocity_gradient,
                acceleration=math.hypot(*self._problem.gravity),
                hardening=self._hardening,
            )
            step = substep_size(limits, self._units.spacing, self._accuracy)
            self._refuse_too_many(step, last, tally)
            count, step = substeps_to(end - self._time, step)
            reach = int(min(_LONGEST_BATCH, limits.lasting(0.5 * self._units.spacing) / step))
            batch = min(count, max(1, reach))
            self._batch(cloud, batch, step, tally)
            if batch == count:
                self._time = end
            survey = cloud.survey()
            self._judge(survey, tally, step)

    def _batch(self, cloud: Cloud, count: int, step: float, tally: _Tally) -> None:
        winds = active_winds(self._problem, self._time)
        drives = active_drives(self._problem, self._time)
        placed = [drive_rows(drives, self._time + index * step, self._units) for index in range(count)]
        cloud.begin_batch(
            step,
            np.asarray(self._problem.gravity),
            self._colliders,
            wind_rows(winds, step, self._units),
            np.array(placed).reshape(count, len(drives), at.DRIVE_WIDTH),
            len(drives),
        )
        done, begin = 0, self._time
        while done < count:
            steps, drifted, clamped = cloud.steps(done, count)
            done += steps
            self._time = begin + done * step
            tally.add(steps, step, clamped)
            if drifted:
                self._judge(cloud.survey(), tally, step)
                try:
                    cloud.sort()
                except (GridTooLargeError, FarAwayError) as error:
                    raise _StoppedError(Status.OUT_OF_DOMAIN, self._strayed(cloud)) from error

    def _refuse_too_many(self, step: float, last: float, tally: _Tally) -> None:
        limit = self._accuracy.substep_limit
        needed = (last - self._time) / step * (1 - 1e-9) if step > 0 else math.inf
        if not tally.count + needed <= limit:
            total = f"{tally.count + math.ceil(needed):,}" if math.isfinite(needed) else "infinitely many"
            raise _StoppedError(
                Status.SUBSTEP_LIMIT,
                f"this frame would need {total} substeps of {step:.3g} s, the limit is {limit:,}:"
                " raise substep_limit, lower the stiffness, or use a coarser resolution",
            )

    def _impulses(self, cloud: Cloud) -> None:
        due = [drive for drive in self._problem.drives if isinstance(drive, Impulse) and drive.start == self._time]
        if not due:
            return
        masses = self._problem.masses
        positions = cloud.positions()
        for impulse in due:
            members = impulse.region.signed_distance(positions) <= 0
            mass = float(masses[members].sum())
            if mass > 0:
                cloud.push(members, np.asarray(impulse.impulse) / mass)

    def _judge(self, survey: Survey, tally: _Tally, step: float) -> None:
        """Stop where the state is no longer credible or has left the domain."""
        if not survey.finite:
            raise _StoppedError(Status.NON_FINITE, self._lost(step))
        tally.inverted = max(tally.inverted, survey.inverted)
        if survey.speed * step > self._units.spacing:
            raise _StoppedError(
                Status.NON_FINITE,
                f"points move {survey.speed * step / self._units.spacing:.3g} cells in one substep of {step:.3g} s:"
                " the motion has blown up; lower substep_fraction, or check the scene's forces",
            )
        domain = self._problem.domain
        if domain is not None and domain.policy is DomainPolicy.STOP:
            self._check_domain(survey, domain)

    def _check_domain(self, survey: Survey, domain: Domain) -> None:
        lower, upper = np.array(domain.lower), np.array(domain.upper)
        if (survey.low >= lower).all() and (survey.high <= upper).all():
            return
        positions = self._open_cloud().positions()
        outside = np.maximum(lower - positions, positions - upper).max(axis=1)
        worst = int(np.argmax(outside))
        place = ", ".join(f"{value:.4g}" for value in positions[worst])
        raise _StoppedError(
            Status.OUT_OF_DOMAIN,
            f"point {worst} left the domain at ({place}) m, {outside[worst]:.3g} m outside:"
            ' enlarge the domain, or use the policy "expand" or "clamp"',
        )

    def _strayed(self, cloud: Cloud) -> str:
        return (
            f"{_farthest(cloud.positions())}, too far for a grid of spacing {self._units.spacing:.3g} m:"
            " add a floor or a domain, or use a coarser resolution"
        )

    def _lost(self, step: float) -> str:
        cloud = self._open_cloud()
        bad = ~np.isfinite(cloud.positions()).all(axis=1)
        bad |= ~np.isfinite(cloud.velocities()).all(axis=1)
        bad |= ~np.isfinite(cloud.deformation_gradients()).all(axis=(1, 2))
        first = ", ".join(str(index) for index in np.flatnonzero(bad)[:5]) or "none alone"
        return (
            f"{int(bad.sum())} point(s) are no longer finite, first {first}, with substeps of {step:.3g} s:"
            " lower substep_fraction, or check the scene's forces"
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given, float64, owned."""
        cloud = self._open_cloud()
        return PointState(
            time=self._time,
            positions=cloud.positions(),
            velocities=cloud.velocities() if Field.VELOCITIES in fields else None,
            deformation_gradients=cloud.deformation_gradients() if Field.DEFORMATION_GRADIENTS in fields else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything a restart needs."""
        return {"time": np.array(self._time), "frame": self._frame.copy(), **self._open_cloud().checkpoint()}

    def close(self) -> None:
        """Give the memory back; may be called twice."""
        if self._cloud is not None:
            self._cloud = None
            runtime.release()

    def _open_cloud(self) -> Cloud:
        if self._cloud is None:
            raise ValueError("taichi-mpm: the session is closed: open a new one")
        return self._cloud

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()


class _Tally:
    """What one advance has done so far."""

    def __init__(self) -> None:
        self.count = 0
        self.smallest = math.inf
        self.largest = 0.0
        self.clamped = 0
        self.inverted = 0

    def add(self, count: int, step: float, clamped: int) -> None:
        self.count += count
        self.clamped += clamped
        if count:
            self.smallest = min(self.smallest, step)
            self.largest = max(self.largest, step)

    def report(self, status: Status, reason: tuple[str, ...]) -> StepReport:
        warnings = list(reason)
        if self.inverted:
            warnings.append(
                f"{self.inverted} point(s) are inverted (det F <= 0): refine the grid or stiffen the material"
            )
        if self.clamped:
            warnings.append("matter was held back at the domain's edge")
        return StepReport(
            status=status,
            substep_count=self.count,
            smallest_substep=self.smallest if self.count else 0.0,
            largest_substep=self.largest,
            warnings=tuple(warnings),
        )
