"""The engine: opens sessions, and a session steps its bodies to the times that are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, Impulse, PointProblem, PointState, Precision
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.session import SteppedSession, impulse_change
from gasp_core.stepping.time_step import substeps_to

from .motion import Bodies, Motion, allowed_step, bodies_of, flown, places, pushed, velocities

__all__ = ["Engine", "Session"]

Array = NDArray[Any]


class Engine:
    """See `gasp_core.contract.PointEngine`."""

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any = None,
        restart: Mapping[str, Array] | None = None,
    ) -> Session:
        """Set a problem up, or go on from a checkpoint of it.

        There is one device and one precision, nothing is drawn at random, and there are no options of its own. A step
        can be as long as one likes; an engine that has a bound refuses an `accuracy.substep` above it here.

        Raises
        ------
        SceneError
            Where the checkpoint is of another problem.
        """
        bodies, motion = bodies_of(problem)
        time = 0.0
        if restart is not None:
            time, motion = _restored(restart, bodies, motion)
        return Session(problem, bodies, motion, accuracy, time)


class Session(SteppedSession[Motion]):
    """Steps a `Motion`; the clock, the landing on events, the report and the closing are those of `SteppedSession`."""

    def __init__(
        self, problem: PointProblem, bodies: Bodies, motion: Motion, accuracy: EngineAccuracy, time: float
    ) -> None:
        super().__init__(problem, motion, engine="my-engine", accuracy=accuracy, time=time)
        self._bodies = bodies
        self._gravity = np.array(problem.gravity)

    def step_toward(self, landing: float, end: float) -> None:
        """One step towards `landing` [s]. This is where your own stepping goes."""
        motion = self.held()
        longest = self.accuracy.substep or self.accuracy.substep_fraction * allowed_step(self._bodies, motion)
        # Ends the advance, with a reason, where the user's limit does not allow for so many steps.
        self.refuse_too_many(longest, end)
        count, step = substeps_to(landing - self.time, longest)
        # What is no longer finite is not silenced but looked for in `check_state`.
        with np.errstate(over="ignore", invalid="ignore"):
            self.hold(flown(self._bodies, motion, self._gravity, step))
        # The last step lands on the very number that was asked for, not on a sum of steps.
        self.record_steps(1, step, landing if count == 1 else self.time + step)

    def apply_impulse(self, impulse: Impulse) -> None:
        """Strike the points in the impulse's region."""
        motion = self.held()
        given = impulse_change(impulse, places(self._bodies, motion), self._bodies.masses)
        if given is not None:
            self.hold(pushed(self._bodies, motion, *given))

    def check_state(self, step: float) -> None:
        """End the advance, with a reason, where a point is no longer finite."""
        motion = self.held()
        self.refuse_lost(step, places(self._bodies, motion), velocities(self._bodies, motion))

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields: fresh arrays, rows in the order given."""
        motion = self.held()
        return PointState(
            time=self.time,
            positions=places(self._bodies, motion),
            velocities=velocities(self._bodies, motion) if Field.VELOCITIES in fields else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes, and by what to know the problem again."""
        return {"time": np.array(self.time), "rows": self._bodies.rows, **asdict(self.held())}


def _restored(checkpoint: Mapping[str, Array], bodies: Bodies, fresh: Motion) -> tuple[float, Motion]:
    """Time and motion of a checkpoint that has the arrays of a session of the same bodies."""
    motion: dict[str, Array] = asdict(fresh)
    own = {"time": np.zeros(()), "rows": bodies.rows, **motion}
    arrays = checkpoint_arrays(checkpoint, {name: np.shape(array) for name, array in own.items()}, "my-engine")
    return float(arrays["time"]), Motion(**{name: arrays[name].astype(np.float64) for name in motion})
