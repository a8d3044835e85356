"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Precision, Status, StepReport
from gasp_core.engine.forcing import DomainPolicy, Impulse
from gasp_core.engine.lattice import grid_node
from gasp_core.engine.stability import MotionLimits, event_times, hardening_of, substep_size, substeps_to
from gasp_core.errors import SceneError
from gasp_genesis_mpm.bounds import stable_step
from gasp_genesis_mpm.checkpoint import restored, stored
from gasp_genesis_mpm.performance import Performance
from gasp_genesis_mpm.window import TooWideError

__all__ = ["GenesisSession"]

Array = NDArray[Any]

_LONGEST_BATCH = 20
"""Substeps between two looks at what bounds them."""
_BATCH_TRAVEL = 0.5
"""In cells: how far a point may fly between two looks."""
_SAME_PACE = 1e-6
"""Relative: times of frames are sums, and their differences are not the same to the last digit."""


class _Verdict(Exception):
    """Ends an advance with anything but OK."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class GenesisSession:
    """See `gasp_core.engine.contract.EngineSession`.

    Between two advances the state is here, in SI, and Genesis has it only while it steps. So a session that goes on and
    one that is taken up from a checkpoint do the same, bit for bit.
    """

    def __init__(
        self,
        problem: PointProblem,
        precision: Precision,
        spacing: float,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None,
    ) -> None:
        self._problem = problem
        self._spacing = spacing
        self._accuracy = accuracy
        self._origin = grid_node(problem, spacing)
        self._events = event_times(problem.drives, problem.force_fields)
        self._hardening = hardening_of(problem)
        start = restored(restart, problem, self._origin, spacing)
        self._time, self._pace, self._motion = start.time, start.pace, start.motion
        try:
            self._performance: Performance | None = Performance(
                problem, precision, spacing, self._origin, start.motion, start.window
            )
        except TooWideError as error:
            raise SceneError(f"genesis-mpm: {self._too_wide(error)}") from error

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s], landing on every impulse on the way.

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
        warnings: list[str] = []
        status = Status.OK
        try:
            while self._time < time:
                self._strike()
                later = self._events[self._events > self._time]
                landing = min(time, float(later[0])) if len(later) else time
                while self._time < landing:
                    self._judge()
                    steps += self._batch(landing, time, len(steps))
                    inverted = max(inverted, int((np.linalg.det(self._motion.deformations) <= 0).sum()))
            if steps:
                self._judge()
        except _Verdict as verdict:
            status = verdict.status
            warnings.append(verdict.reason)
        if inverted:
            warnings.append(f"{inverted} point(s) were turned inside out (det F <= 0) at once; results there are rough")
        return StepReport(
            status=status,
            substep_count=len(steps),
            smallest_substep=min(steps, default=0.0),
            largest_substep=max(steps, default=0.0),
            warnings=tuple(warnings),
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        self._living()
        motion = self._motion
        return PointState(
            time=self._time,
            positions=self._places(),
            velocities=motion.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=motion.deformations.copy() if Field.DEFORMATION_GRADIENTS in fields else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        window = self._living().window
        return stored(self._time, self._pace, self._motion, window, self._origin, self._spacing)

    def close(self) -> None:
        """Give Genesis' scene back; may be called twice."""
        performance, self._performance = self._performance, None
        if performance is not None:
            performance.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _living(self) -> Performance:
        if self._performance is None:
            raise ValueError("the session is closed")
        return self._performance

    def _places(self) -> Array:
        return self._motion.cells * self._spacing + self._origin

    def _batch(self, landing: float, end: float, taken: int) -> list[float]:
        """A few equal substeps towards `landing`; the sizes of those taken."""
        limits = self._limits()
        allowed = substep_size(limits, self._spacing, self._accuracy)
        needed = taken + (end - self._time) / allowed * (1 - 1e-9) if allowed > 0 else math.inf
        if needed > self._accuracy.substep_limit:
            total = f"{math.ceil(needed)}" if math.isfinite(needed) else "infinitely many"
            raise _Verdict(
                Status.SUBSTEP_LIMIT,
                f"this frame needs about {total} substeps of {allowed:.3g} s, more than the limit of"
                f" {self._accuracy.substep_limit}: raise substep_limit, lower the stiffness, or coarsen the resolution",
            )
        count, step = self._paced(landing - self._time, allowed)
        reach = int(min(_LONGEST_BATCH, limits.lasting(_BATCH_TRAVEL * self._spacing) / step))
        taking = min(count, max(1, reach))
        try:
            self._motion = self._living().play(self._motion, taking, step)
        except TooWideError as error:
            raise _Verdict(Status.OUT_OF_DOMAIN, self._too_wide(error)) from error
        except FloatingPointError as error:
            raise _Verdict(
                Status.NON_FINITE,
                f"Genesis: {error} (substeps of {step:.3g} s): lower substep_fraction, or check the scene's forces",
            ) from error
        # The last batch lands on the very number that was asked for, not on a sum of steps.
        self._time = landing if taking == count else self._time + taking * step
        self._refuse_leap(step)
        return [step] * taking

    def _paced(self, remaining: float, allowed: float) -> tuple[int, float]:
        """Number and size [s] of equal steps that land on the end of `remaining` [s].

        Those of before, where another size would cost a scene, as long as they land there and are neither too large
        nor less than half of what is allowed.
        """
        if self._living().is_made_for_a_step and self._pace <= allowed < 2 * self._pace:
            count = round(remaining / self._pace)
            if count and abs(remaining / count / self._pace - 1) < _SAME_PACE:
                return count, remaining / count
        count, self._pace = substeps_to(remaining, allowed)
        return count, self._pace

    def _limits(self) -> MotionLimits:
        motion = self._motion
        return MotionLimits(
            stress=stable_step(self._problem, self._living().portions, motion, self._spacing),
            speed=float(np.linalg.norm(motion.velocities, axis=1).max()),
            velocity_gradient=float(np.linalg.norm(motion.affine_velocities, axis=(1, 2)).max()),
            acceleration=math.hypot(*self._problem.gravity),
            hardening=self._hardening,
        )

    def _strike(self) -> None:
        """Give the impulses that start now, each shared in proportion to mass."""
        masses, places = self._problem.masses, self._places()
        for drive in self._problem.drives:
            if isinstance(drive, Impulse) and drive.start == self._time:
                struck = drive.region.signed_distance(places) <= 0
                if struck.any():
                    kick = np.asarray(drive.impulse) / masses[struck].sum()
                    velocities = self._motion.velocities + struck[:, None] * kick
                    self._motion = replace(self._motion, velocities=velocities)

    def _refuse_leap(self, step: float) -> None:
        motion = self._motion
        finite = np.isfinite(motion.cells).all(axis=1) & np.isfinite(motion.velocities).all(axis=1)
        finite &= np.isfinite(motion.deformations).all(axis=(1, 2))
        if not finite.all():
            first = ", ".join(map(str, np.flatnonzero(~finite)[:5]))
            raise _Verdict(
                Status.NON_FINITE,
                f"{int((~finite).sum())} point(s) are no longer finite, first {first}, with substeps of {step:.3g} s:"
                " lower substep_fraction, or check the scene's forces",
            )
        speeds = np.linalg.norm(motion.velocities, axis=1)
        leap = float(speeds.max()) * step / self._spacing
        if leap > 1:
            raise _Verdict(
                Status.NON_FINITE,
                f"point {int(speeds.argmax())} moves {leap:.3g} cells in one substep of {step:.3g} s: the motion has"
                " blown up; lower substep_fraction, or check the scene's forces",
            )
        if not self._living().window.holds(motion.cells):
            raise _Verdict(
                Status.OUT_OF_DOMAIN,
                "a point flew to the edge of Genesis' grid between two looks, where it is held back: lower"
                " substep_fraction, or check the scene's forces",
            )

    def _judge(self) -> None:
        """Stop where a point has left a domain that ends the run."""
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.STOP:
            return
        places = self._places()
        outside = np.maximum(np.array(domain.lower) - places, places - np.array(domain.upper)).max(axis=1)
        worst = int(np.argmax(outside))
        if outside[worst] > 0:
            raise _Verdict(
                Status.OUT_OF_DOMAIN,
                f"point {worst} at {_place_name(places[worst])} left the domain, {outside[worst]:.3g} m outside:"
                ' enlarge the domain, or use the policy "expand"',
            )

    def _too_wide(self, error: TooWideError) -> str:
        places = self._places()
        away = np.abs(places - np.median(places, axis=0)).max(axis=1)
        worst = int(np.argmax(away))
        return (
            f"the cloud spans {error}, too many; farthest is point {worst} at {_place_name(places[worst])}:"
            " coarsen the resolution, leave that point out, or set a domain with policy stop"
        )


def _place_name(position: Array) -> str:
    """A position (3,) [m] as one reads it."""
    return "(" + ", ".join(f"{coordinate:.4g}" for coordinate in position) + ") m"
