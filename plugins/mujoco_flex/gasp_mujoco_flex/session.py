"""A running simulation: steps, what acts between them, and how points follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Status
from gasp_core.engine.forcing import Impulse
from gasp_core.engine.stability import substeps_to
from gasp_core.engine.stepped import SteppedSession, StoppedError
from gasp_core.errors import SceneError
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.motion import Motion
from gasp_mujoco_flex.stepping import step_size
from gasp_mujoco_flex.units import fastest_sound

__all__ = ["MujocoSession"]

Array = NDArray[Any]

_CYCLE = 10
"""Steps between two looks at how fast matter is."""


class MujocoSession(SteppedSession[Motion]):
    """See `gasp_core.engine.contract.EngineSession`."""

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
        self._side = min((float(cage.lattice.sides.min()) for cage in model.cages), default=math.inf)
        self._smallest = min([self._side, *(float(np.cbrt(one.matter.volumes.sum())) for one in model.bodies)])
        motion = Motion(problem, model, accuracy.solver_tolerance)
        time = 0.0 if restart is None else _restored(motion, restart)
        notes = [note] if note and restart is None else []
        super().__init__(problem, motion, engine="mujoco-flex", accuracy=accuracy, time=time, notes=notes)
        self._span = 0.0

    def _begin(self, end: float) -> None:
        self._span = end - self._time

    def _remarks(self) -> list[str]:
        return self._living().complaints()

    def _strike(self, impulse: Impulse) -> None:
        self._living().strike(impulse)

    def _approach(self, landing: float, end: float) -> None:
        """Some equal steps towards `landing`."""
        motion = self._living()
        allowed = step_size(
            self._accuracy,
            span=self._span,
            size=self._size,
            side=self._smallest,
            sound=self._sound,
            speed=motion.speed(),
            acceleration=math.hypot(*self._problem.gravity),
        )
        self._refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        begun = self._time
        for number in range(min(count, _CYCLE)):
            failure = motion.step(begun + number * step, step)
            # The last one lands on the very number that was asked for, not on a sum of steps.
            self._took(1, step, landing if number + 1 == count else begun + (number + 1) * step)
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
            self._refuse_outside(motion.positions())

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given, owned."""
        motion = self._living()
        return PointState(
            time=self._time,
            positions=motion.positions(),
            velocities=motion.velocities() if Field.VELOCITIES in fields else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        return {"time": np.array(self._time), **self._living().checkpoint()}


def _restored(motion: Motion, checkpoint: Mapping[str, Array]) -> float:
    expected = {"time": (), **{name: np.shape(array) for name, array in motion.checkpoint().items()}}
    for name, shape in expected.items():
        found = np.shape(checkpoint[name]) if name in checkpoint else "nothing"
        if found != shape:
            raise SceneError(
                f"mujoco-flex: the checkpoint holds {found} for {name}, expected {shape}: it belongs to another scene"
                " or engine; start the run anew"
            )
    motion.restore(checkpoint)
    return float(checkpoint["time"])
