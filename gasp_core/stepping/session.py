"""What sessions that step have in common: the clock, the landing on events, the verdicts, the report, the closing.

An engine's session derives from `SteppedSession` and says how its own state is stepped; nobody has to.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    DomainPolicy,
    EngineAccuracy,
    Field,
    Impulse,
    PointProblem,
    PointState,
    Status,
    StepReport,
)
from gasp_core.stepping.flow import is_flowing
from gasp_core.stepping.time_step import collider_times, event_times

__all__ = ["CRUSHED_VOLUME", "SteppedSession", "StoppedError", "impulse_change"]

Array = NDArray[Any]
Held = TypeVar("Held")

_NAMED = 5
"""How many points a message names."""

CRUSHED_VOLUME = 1e-3
"""The volume ratio det F up to which a point of elastic matter counts as crushed, as does what is inside out.

A law that reaches no volume at a finite energy, as the fixed-corotated one does, bears an impact at about the speed of
sound; what comes faster is flat for good (`benchmarks/impacts.py`)."""
_CRUSHED_SHARE = 0.1
"""Of elastic points; what fewer do is a wound in a body that is still one."""


class StoppedError(Exception):
    """Ends an advance with anything but `Status.OK`; what was stepped until then is kept and reported."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class SteppedSession(ABC, Generic[Held]):
    """The part of `gasp_core.contract.EngineSession` that no backend has a say in.

    A derived class has to have:

    step_toward(landing, end)
        Take at least one step towards `landing` [s], and tell `record_steps`.
    apply_impulse(impulse)
        Give an impulse that starts now; `impulse_change` says to which points, and how much.
    read(fields)
        Positions and the asked fields, as `EngineSession.read` has it.
    checkpoint()
        What a session can be taken up from, as `EngineSession.checkpoint` has it; only where that is declared.

    It may also have, where the default of doing nothing is not enough:

    begin_advance(end)
        Forget what the last report told: an advance begins.
    check_state(step)
        Raise `StoppedError` where the state after steps of `step` [s] cannot go on.
    warnings()
        What the report of the advance that is over has to tell.
    solver_figures()
        What the solves of the advance that is over took.
    release(held)
        Give back to the backend what is held.

    For these there are `time`, `accuracy`, `held()`, which is what is stepped, `hold(held)`, which puts the next
    arrays in its place, and `record_steps(count, step, now)`.

    Parameters
    ----------
    held
        What is stepped: arrays, or a handle of the backend. It is let go of when the session is closed.
    engine
        The engine's name, for messages.
    time
        Of `held` [s].
    notes
        For the user: warnings of the first report with a step in it.
    """

    def __init__(
        self,
        problem: PointProblem,
        held: Held,
        *,
        engine: str,
        accuracy: EngineAccuracy,
        time: float = 0.0,
        notes: Sequence[str] = (),
    ) -> None:
        self._problem = problem
        self._held: Held | None = held
        self._engine = engine
        self._accuracy = accuracy
        self._time = time
        self._notes = tuple(notes)
        moments = [] if problem.trajectories is None else problem.trajectories.times
        abrupt = collider_times(problem.colliders, problem.points, accuracy.spacing_for(problem.points.size))
        self._events = np.unique([*event_times(problem.drives, problem.force_fields), *moments, *abrupt])
        self._steps: list[tuple[int, float]] = []
        elastic = [not is_flowing(material) for material in problem.materials]
        self._elastic_count = int(np.array(elastic, dtype=np.bool_)[problem.points.material_ids].sum())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    @property
    def accuracy(self) -> EngineAccuracy:
        """The knobs the session was opened with."""
        return self._accuracy

    @abstractmethod
    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields: fresh float64 arrays, C-contiguous, rows in the order given."""

    def advance_to(self, time: float) -> StepReport:
        """Advance to exactly `time` [s], landing on everything that starts or ends on the way.

        Raises
        ------
        ValueError
            Where `time` lies in the past or is not finite, or the session is closed.
        """
        self.held()
        if not (math.isfinite(time) and time >= self._time):
            raise ValueError(f"cannot advance to {time!r} s: the session is at {self._time!r} s")
        self._steps = []
        self.begin_advance(time)
        status, warnings = Status.OK, list[str]()
        try:
            while self._time < time:
                later = self._events[self._events > self._time]
                self._stretch(min(time, float(later[0])) if len(later) else time, time)
        except StoppedError as stopped:
            status = stopped.status
            warnings.append(stopped.reason)
        if self._steps:
            warnings = [*self._notes, *warnings]
            self._notes = ()
        sizes = [size for _, size in self._steps]
        iterations, residual = self.solver_figures()
        return StepReport(
            status=status,
            substep_count=self._taken,
            smallest_substep=min(sizes, default=0.0),
            largest_substep=max(sizes, default=0.0),
            warnings=(*warnings, *self.warnings()),
            solver_iterations=iterations,
            solver_residual=residual,
        )

    def _stretch(self, landing: float, end: float) -> None:
        """Advance to `landing`, between which and now nothing starts or ends."""
        for drive in self._problem.drives:
            if isinstance(drive, Impulse) and drive.start == self._time:
                self.apply_impulse(drive)
        self.check_state(0.0)
        while self._time < landing:
            self.step_toward(landing, end)
            self.check_state(self._steps[-1][1])

    def solver_figures(self) -> tuple[int, float | None]:
        """Iterations of all solves of this advance, and the largest relative residual that one of them ended with."""
        return 0, None

    @abstractmethod
    def step_toward(self, landing: float, end: float) -> None:
        """Take at least one step towards `landing` [s] on the way to `end` [s], telling `record_steps` of each.

        The last one lands on that very number.
        """

    @abstractmethod
    def apply_impulse(self, impulse: Impulse) -> None:
        """Give an impulse that starts now; see `impulse_change`."""

    def begin_advance(self, end: float) -> None:
        """Before anything is done towards `end` [s], e.g. to forget what the last report told."""

    def check_state(self, step: float) -> None:
        """Raise StoppedError where the state, after steps of `step` [s] (0: before the first), cannot go on."""

    def warnings(self) -> Sequence[str]:
        """Warnings about the advance that is over."""
        return ()

    def release(self, held: Held) -> None:
        """Give back what is held."""

    @property
    def _taken(self) -> int:
        """Steps of this advance."""
        return sum(count for count, _ in self._steps)

    def record_steps(self, count: int, step: float, now: float) -> None:
        """Report `count` steps of `step` [s], after which it is `now` [s]."""
        self._steps.append((count, step))
        self._time = now

    def refuse_too_many(self, step: float, end: float) -> None:
        """Stop where steps of `step` [s] up to `end` [s] would be more than are allowed."""
        limit = self._accuracy.substep_limit
        needed = self._taken + ((end - self._time) / step * (1 - 1e-9) if step > 0 else math.inf)
        if needed > limit:
            total = f"{math.ceil(needed):,}" if math.isfinite(needed) else "infinitely many"
            raise StoppedError(
                Status.SUBSTEP_LIMIT,
                f"this frame needs {total} substeps of {step:.3g} s, more than the limit of {limit:,}: raise"
                " substep_limit, ask for frames closer together, lower the stiffness, or coarsen the resolution",
            )

    def refuse_lost(self, step: float, *rows: Array) -> None:
        """Stop where an array (N, ...) of `rows` is not finite after steps of `step` [s]."""
        finite = np.logical_and.reduce([np.isfinite(each.reshape(len(each), -1)).all(axis=1) for each in rows])
        if not finite.all():
            first = ", ".join(map(str, np.flatnonzero(~finite)[:_NAMED]))
            raise StoppedError(
                Status.NON_FINITE,
                f"{int((~finite).sum())} point(s) are no longer finite, first {first}, with substeps of {step:.3g} s:"
                " check the scene's forces",
            )

    def refuse_crushed(self, count: int, step: float) -> None:
        """Stop where `count` elastic points, after steps of `step` [s], are at `CRUSHED_VOLUME` or below."""
        elastic = self._elastic_count
        if count > _CRUSHED_SHARE * elastic:
            raise StoppedError(
                Status.CRUSHED,
                f"{count:,} of {elastic:,} elastic points are flat or inside out after substeps of {step:.3g} s:"
                " what meets faster than sound in it is crushed; slow it down, raise youngs_modulus, or make it rigid",
            )

    def refuse_outside(self, positions: Array) -> None:
        """Stop where one of `positions` (N, 3) [m] has left a domain that ends the run."""
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.STOP:
            return
        outside = np.maximum(np.array(domain.lower) - positions, positions - np.array(domain.upper)).max(axis=1)
        worst = int(np.argmax(outside))
        if outside[worst] > 0:
            place = ", ".join(f"{coordinate:.4g}" for coordinate in positions[worst])
            raise StoppedError(
                Status.OUT_OF_DOMAIN,
                f"{int((outside > 0).sum())} point(s) left the domain, farthest point {worst} at ({place}) m,"
                f' {outside[worst]:.3g} m outside: enlarge the domain, or choose its policy "expand" or "clamp"',
            )

    def held(self) -> Held:
        """What is held; ValueError where the session is closed."""
        if self._held is None:
            raise ValueError(f"{self._engine}: the session is closed: open a new one")
        return self._held

    def hold(self, held: Held) -> None:
        """Put the next state in the place of what is held; ValueError where the session is closed."""
        self.held()
        self._held = held

    def close(self) -> None:
        """Give everything back; may be called twice."""
        held, self._held = self._held, None
        if held is not None:
            self.release(held)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()


def impulse_change(impulse: Impulse, positions: Array, masses: Array) -> tuple[Array, Array] | None:
    """Which of the points an impulse strikes, (N,) of bool, and by how much their velocity changes, (3,) [m/s].

    It is shared in proportion to mass, so all that are struck change alike; None where it strikes nothing.
    """
    struck = impulse.region.signed_distance(positions) <= 0
    if not struck.any():
        return None
    return struck, np.asarray(impulse.impulse) / float(masses[struck].sum())
