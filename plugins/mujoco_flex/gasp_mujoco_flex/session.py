"""A running simulation: steps, what acts between them, and how points follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, Impulse, PointProblem, PointState, Status
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.session import SteppedSession, StoppedError
from gasp_core.stepping.time_step import substeps_to
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.stepper import Motion
from gasp_mujoco_flex.time_step import step_size
from gasp_mujoco_flex.units import fastest_sound

__all__ = ["MujocoSession"]

Array = NDArray[Any]

_CYCLE = 10
"""Steps between two looks at how fast matter is."""


class MujocoSession(SteppedSession[Motion]):
    """See `gasp_core.contract.EngineSession`."""

    def __init__(
        self,
        problem: PointProblem,
        model: Model,
        accuracy: EngineAccuracy,
        *,
        note: str = "",
        restart: Mapping[str, Array] | None = None,
    ) -> None:
        self._sound = fastest_sound(problem)
        self._size = model.units.length
        self._side = min((float(cage.grid.sides.min()) for cage in model.cages), default=math.inf)
        self._smallest = min([self._side, *(float(np.cbrt(one.matter.volumes.sum())) for one in model.bodies)])
        motion = Motion(problem, model, accuracy)
        time = 0.0 if restart is None else _restored(motion, restart)
        notes = [note] if note and restart is None else []
        super().__init__(problem, motion, engine="mujoco-flex", accuracy=accuracy, time=time, notes=notes)
        self._span = 0.0

    def begin_advance(self, end: float) -> None:
        """See `SteppedSession`."""
        self._span = end - self._time
        self.held().iterations = 0

    def solver_figures(self) -> tuple[int, float | None]:
        """See `SteppedSession`; MuJoCo's own measure of what is left is no relative one."""
        return self.held().iterations, None

    def warnings(self) -> list[str]:
        """See `SteppedSession`."""
        return self.held().complaints()

    def apply_impulse(self, impulse: Impulse) -> None:
        """See `SteppedSession`."""
        self.held().strike(impulse)

    def step_toward(self, landing: float, end: float) -> None:
        """Some equal steps towards `landing`."""
        motion = self.held()
        led = 0.0 if motion.led is None else motion.led.points.fastest(self._time)
        allowed = step_size(
            self._accuracy,
            span=self._span,
            size=self._size,
            side=self._smallest,
            sound=self._sound,
            speed=max(motion.speed(), led),
            acceleration=math.hypot(*self._problem.gravity),
        )
        self.refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        begun = self._time
        for number in range(min(count, _CYCLE)):
            failure = motion.step(begun + number * step, step)
            # The last one lands on the very number that was asked for, not on a sum of steps.
            self.record_steps(1, step, landing if number + 1 == count else begun + (number + 1) * step)
            if failure:
                raise StoppedError(Status.NOT_CONVERGED, failure)
            lost = motion.lost()
            if lost:
                raise StoppedError(Status.NON_FINITE, f"{lost}, with steps of {step:.3g} s: lower substep_fraction")
            self._stop_outside(motion)

    def _stop_outside(self, motion: Motion) -> None:
        domain = self._problem.domain
        if domain is None:
            return
        least, most = motion.bounds()
        if (least < domain.lower).any() or (most > domain.upper).any():
            self.refuse_outside(motion.positions())

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given, owned."""
        motion = self.held()
        positions, velocities = motion.positions(), motion.velocities() if Field.VELOCITIES in fields else None
        if motion.led is not None:
            motion.led.points.put(self._time, positions, velocities)
        return PointState(time=self._time, positions=positions, velocities=velocities)

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        return {"time": np.array(self._time), **self.held().checkpoint()}


def _restored(motion: Motion, checkpoint: Mapping[str, Array]) -> float:
    expected = {"time": (), **{name: np.shape(array) for name, array in motion.checkpoint().items()}}
    arrays = checkpoint_arrays(checkpoint, expected, "mujoco-flex")
    motion.restore(arrays)
    return float(arrays["time"])
