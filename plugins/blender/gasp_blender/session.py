"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Status, StepReport
from gasp_core.engine.stability import event_times

__all__ = ["BlenderSession", "Part"]

Array = NDArray[Any]


class Part(Protocol):
    """Some of the bodies of a scene, all simulated in one way."""

    def step(self, now: float, end: float, step: float) -> bool:
        """From `now` to `end` [s], which are `step` apart but for its last digits.

        False, and the state stays as it is, where Blender's is not finite.
        """
        ...

    def positions(self) -> Array:
        """Of its points [m]."""
        ...

    def velocities(self) -> Array:
        """Of its points [m/s]."""
        ...

    def keep(self) -> dict[str, Array]:
        """Everything that changes."""
        ...

    def close(self) -> None:
        """Let go of Blender's scene."""
        ...


class BlenderSession:
    """See `gasp_core.engine.contract.EngineSession`.

    Parameters
    ----------
    parts
        With the rows of their points.
    longest_step
        Largest substep [s].
    notices
        For the user: warnings of the first report.
    """

    def __init__(
        self,
        problem: PointProblem,
        parts: Sequence[tuple[Array, Part]],
        longest_step: float,
        accuracy: EngineAccuracy,
        time: float,
        notices: Sequence[str] = (),
    ) -> None:
        self._problem = problem
        self._parts: Sequence[tuple[Array, Part]] | None = parts
        self._longest = longest_step
        self._accuracy = accuracy
        self._time = time
        self._notices = tuple(notices)
        self._events = event_times(problem.drives, problem.force_fields)

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
        status = Status.OK
        warnings = list(self._notices)
        self._notices = ()
        while self._time < time and status is Status.OK:
            later = self._events[self._events > self._time]
            landing = min(time, float(later[0])) if len(later) else time
            span = landing - self._time
            count = max(1, math.ceil(span / self._longest * (1 - 1e-9)))
            left = math.ceil((time - self._time) / self._longest * (1 - 1e-9))
            if len(steps) + left > self._accuracy.substep_limit:
                status = Status.SUBSTEP_LIMIT
                warnings.append(
                    f"this frame needs about {len(steps) + left} substeps of {self._longest:.3g} s, more than the limit"
                    f" of {self._accuracy.substep_limit}: raise substep_limit, lower the stiffness, or coarsen the"
                    " resolution"
                )
                break
            start, step = self._time, span / count
            for index in range(count):
                # The last one lands on the very number that was asked for, not on a sum of steps.
                end = landing if index + 1 == count else start + (index + 1) * step
                if not all(part.step(self._time, end, step) for _, part in self._living()):
                    status = Status.NON_FINITE
                    warnings.append(
                        f"Blender's state is not finite after {end:.6g} s: try a substep below {step / 2:.3g} s"
                    )
                    break
                self._time = end
                steps.append(step)
        return StepReport(
            status=status,
            substep_count=len(steps),
            smallest_substep=min(steps, default=0.0),
            largest_substep=max(steps, default=0.0),
            warnings=tuple(warnings),
        )

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        count = len(self._problem.points)
        positions, velocities = np.empty((count, 3)), np.empty((count, 3))
        for rows, part in self._living():
            positions[rows] = part.positions()
            if Field.VELOCITIES in fields:
                velocities[rows] = part.velocities()
        return PointState(
            time=self._time, positions=positions, velocities=velocities if Field.VELOCITIES in fields else None
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        kept = {"time": np.array(self._time)}
        for _, part in self._living():
            kept |= part.keep()
        return kept

    def close(self) -> None:
        """Let go of Blender's scenes."""
        for _, part in self._parts or ():
            part.close()
        self._parts = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _living(self) -> Sequence[tuple[Array, Part]]:
        if self._parts is None:
            raise ValueError("the session is closed")
        return self._parts
