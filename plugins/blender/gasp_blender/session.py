"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, Impulse, PointProblem, PointState, Status
from gasp_core.stepping.led_points import LedPoints
from gasp_core.stepping.session import SteppedSession, StoppedError
from gasp_core.stepping.time_step import substeps_to

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


class BlenderSession(SteppedSession[Sequence[tuple[Array, Part]]]):
    """See `gasp_core.contract.EngineSession`.

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
        super().__init__(problem, parts, engine="blender", accuracy=accuracy, time=time, notes=notices)
        self._longest = longest_step
        self._led = LedPoints.of(problem)

    def step_toward(self, landing: float, end: float) -> None:
        """All steps up to `landing`: nothing that happens on the way bounds them."""
        self.refuse_too_many(self._longest, end)
        count, step = substeps_to(landing - self._time, self._longest)
        start = self._time
        for index in range(count):
            # The last one lands on the very number that was asked for, not on a sum of steps.
            then = landing if index + 1 == count else start + (index + 1) * step
            if not all(part.step(self._time, then, step) for _, part in self.held()):
                raise StoppedError(
                    Status.NON_FINITE,
                    f"Blender's state is not finite after {then:.6g} s: try a substep below {step / 2:.3g} s",
                )
            self.record_steps(1, step, then)

    def apply_impulse(self, impulse: Impulse) -> None:
        """Parts give impulses to their nodes themselves, in the step that begins then."""

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        count = len(self._problem.points)
        positions, velocities = np.empty((count, 3)), np.empty((count, 3))
        for rows, part in self.held():
            positions[rows] = part.positions()
            if Field.VELOCITIES in fields:
                velocities[rows] = part.velocities()
        if self._led is not None:
            self._led.put(self._time, positions, velocities)
        return PointState(
            time=self._time, positions=positions, velocities=velocities if Field.VELOCITIES in fields else None
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        kept = {"time": np.array(self._time)}
        for _, part in self.held():
            kept |= part.keep()
        return kept

    def release(self, held: Sequence[tuple[Array, Part]]) -> None:
        """See `SteppedSession`."""
        for _, part in held:
            part.close()
