"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import (
    EngineAccuracy,
    Field,
    PointProblem,
    PointState,
    Status,
    StepReport,
)
from gasp_core.engine.forcing import DomainPolicy, Impulse
from gasp_core.engine.stability import (
    MotionLimits,
    driven_speed,
    event_times,
    hardening_of,
    substep_size,
    substeps_to,
)
from gasp_reference_mpm.lattice import grid_excess, place_name
from gasp_reference_mpm.matter import Matter, Motion, stable_step
from gasp_reference_mpm.substep import substep

__all__ = ["ReferenceSession"]

Array = NDArray[Any]

_CYCLE = 20
"""Substeps between two looks at how stiff and how fast the cloud has become."""
_CYCLE_TRAVEL = 0.5
"""In cells: no point travels further within a cycle."""


class _Verdict(Exception):
    """Ends an advance with anything but OK."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class ReferenceSession:
    """See `gasp_core.engine.contract.EngineSession`."""

    def __init__(
        self,
        problem: PointProblem,
        matter: Matter,
        motion: Motion,
        origin: Array,
        spacing: float,
        accuracy: EngineAccuracy,
        time: float,
    ) -> None:
        self._problem = problem
        self._matter = matter
        self._motion: Motion | None = motion
        self._origin = origin
        self._spacing = spacing
        self._accuracy = accuracy
        self._time = time
        self._held_back = np.zeros(len(matter.masses), dtype=bool)
        self._events = event_times(problem.drives, problem.force_fields)
        self._hardening = hardening_of(problem)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s], landing on everything that starts or ends on the way.

        Raises
        ------
        ValueError
            Where `time` lies in the past or is not finite, or the session is closed.
        """
        self._living()
        if not (math.isfinite(time) and time >= self._time):
            raise ValueError(f"cannot advance to {time!r} s: the session is at {self._time!r} s")
        steps: list[float] = []
        inverted = 0
        self._held_back[:] = False
        warnings: list[str] = []
        status = Status.OK
        try:
            while self._time < time:
                self._look()
                self._strike()
                later = self._events[self._events > self._time]
                landing = min(time, float(later[0])) if len(later) else time
                while self._time < landing:
                    steps += self._cycle(landing, time, len(steps))
                    inverted = max(inverted, self._look())
        except _Verdict as verdict:
            status = verdict.status
            warnings.append(verdict.reason)
        if inverted:
            warnings.append(f"{inverted} point(s) were turned inside out (det F <= 0) at once; results there are rough")
        if self._held_back.any():
            warnings.append(f"{int(self._held_back.sum())} point(s) were held back at the domain's edge")
        return StepReport(
            status=status,
            substep_count=len(steps),
            smallest_substep=min(steps, default=0.0),
            largest_substep=max(steps, default=0.0),
            warnings=tuple(warnings),
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        motion = self._living()
        traced = Field.TRACER_POSITIONS in fields and self._problem.points.tracer_positions is not None
        return PointState(
            time=self._time,
            positions=motion.positions + self._origin,
            velocities=motion.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=motion.deformations.copy() if Field.DEFORMATION_GRADIENTS in fields else None,
            tracer_positions=motion.tracers + self._origin if traced else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        motion = self._living()
        return {
            "time": np.array(self._time),
            "positions": motion.positions.copy(),
            "velocities": motion.velocities.copy(),
            "affine_velocities": motion.affine_velocities.copy(),
            "velocity_gradients": motion.velocity_gradients.copy(),
            "deformations": motion.deformations.copy(),
            "history": motion.history.copy(),
            "tracers": motion.tracers.copy(),
        }

    def close(self) -> None:
        """Let go of the arrays."""
        self._motion = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _living(self) -> Motion:
        if self._motion is None:
            raise ValueError("the session is closed")
        return self._motion

    def _cycle(self, landing: float, end: float, taken: int) -> list[float]:
        """A few equal substeps towards `landing`; the sizes of those taken."""
        motion = self._living()
        limits = self._limits(motion)
        allowed = substep_size(limits, self._spacing, self._accuracy)
        needed = taken + math.ceil((end - self._time) / allowed * (1 - 1e-9))
        if needed > self._accuracy.substep_limit:
            raise _Verdict(
                Status.SUBSTEP_LIMIT,
                f"this frame needs about {needed} substeps of {allowed:.3g} s, more than the limit of"
                f" {self._accuracy.substep_limit}: raise substep_limit, lower the stiffness, or coarsen the resolution",
            )
        remaining = landing - self._time
        count, step = substeps_to(remaining, allowed)
        reach = int(min(_CYCLE, limits.lasting(_CYCLE_TRAVEL * self._spacing) / step))
        taking = min(count, max(1, reach))
        start = self._time
        for index in range(taking):
            now = start + index * step
            # Overflow is not silenced but awaited: `_refuse_leap` looks at every result before it is used.
            with np.errstate(over="ignore", invalid="ignore"):
                motion, held = substep(self._problem, self._matter, motion, self._origin, self._spacing, now, step)
            self._held_back |= held
            self._refuse_leap(motion, now, step)
            motion = self._clamped(motion)
        self._motion = motion
        # The last cycle lands on the very number that was asked for, not on a sum of steps.
        self._time = landing if taking == count else start + taking * step
        return [step] * taking

    def _limits(self, motion: Motion) -> MotionLimits:
        places = motion.positions + self._origin
        felt = 1.5 * self._spacing  # drives act at nodes, which points feel from so far away
        driven = driven_speed(self._problem.drives, self._time, places.min(axis=0) - felt, places.max(axis=0) + felt)
        return MotionLimits(
            stress=stable_step(self._matter, motion, self._spacing),
            speed=max(float(np.linalg.norm(motion.velocities, axis=1).max()), driven),
            velocity_gradient=float(np.linalg.norm(motion.affine_velocities, axis=(1, 2)).max()),
            acceleration=math.hypot(*self._problem.gravity),
            hardening=self._hardening,
        )

    def _strike(self) -> None:
        """Give the impulses that start now."""
        motion = self._living()
        for drive in self._problem.drives:
            if isinstance(drive, Impulse) and drive.start == self._time:
                struck = drive.region.signed_distance(motion.positions + self._origin) <= 0
                if struck.any():
                    kick = np.asarray(drive.impulse) / self._matter.masses[struck].sum()
                    motion = replace(motion, velocities=motion.velocities + struck[:, None] * kick)
        self._motion = motion

    def _clamped(self, motion: Motion) -> Motion:
        """Points that slipped through a clamping edge, brought back onto it, stopped at it, and remembered."""
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.CLAMP:
            return motion
        inside = np.clip(motion.positions, domain.lower - self._origin, domain.upper - self._origin)
        back = inside - motion.positions
        self._held_back |= (back != 0).any(axis=1)
        velocities = np.where(back * motion.velocities < 0, 0.0, motion.velocities)
        return replace(motion, positions=inside, velocities=velocities)

    def _refuse_leap(self, motion: Motion, time: float, step: float) -> None:
        finite = np.isfinite(motion.positions).all(axis=1) & np.isfinite(motion.velocities).all(axis=1)
        finite &= np.isfinite(motion.deformations).all(axis=(1, 2))
        if not finite.all():
            lost = np.flatnonzero(~finite)
            raise _Verdict(
                Status.NON_FINITE,
                f"the state of {len(lost)} point(s), first {lost[0]}, is not finite at {time:.6g} s:"
                f" try a substep below {step / 2:.3g} s",
            )
        leap = np.linalg.norm(motion.velocities, axis=1) * step / self._spacing
        if leap.max() > 1:
            raise _Verdict(
                Status.NON_FINITE,
                f"point {int(leap.argmax())} crosses {leap.max():.3g} cells in one substep at {time:.6g} s:"
                f" try a substep below {step / 2 / leap.max():.3g} s",
            )

    def _look(self) -> int:
        """Refuse a cloud that has left its domain or outgrown the grid; the number of inverted points."""
        motion = self._living()
        places = motion.positions + self._origin
        domain = self._problem.domain
        if domain is not None and domain.policy is DomainPolicy.STOP:
            outside = ((places < domain.lower) | (places > domain.upper)).any(axis=1)
            if outside.any():
                first = int(np.flatnonzero(outside)[0])
                raise _Verdict(
                    Status.OUT_OF_DOMAIN,
                    f"{int(outside.sum())} point(s) left the domain at {self._time:.6g} s, first point {first} at"
                    f" {place_name(places[first])}: enlarge the domain, or choose its policy expand or clamp",
                )
        excess = grid_excess(places, self._spacing)
        if excess:
            raise _Verdict(Status.OUT_OF_DOMAIN, f"at {self._time:.6g} s {excess}")
        return int((np.linalg.det(motion.deformations) <= 0).sum())
