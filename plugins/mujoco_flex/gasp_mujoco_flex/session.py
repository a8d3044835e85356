"""A running simulation: steps, what acts between them, and how points follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import EngineAccuracy, Field, PointProblem, PointState, Status, StepReport
from gasp_core.engine.detector import sound_speed
from gasp_core.engine.forcing import DomainPolicy, Impulse
from gasp_core.engine.stability import event_times, substeps_to
from gasp_core.errors import SceneError
from gasp_mujoco_flex.model import Model
from gasp_mujoco_flex.motion import Motion
from gasp_mujoco_flex.stepping import step_size

__all__ = ["MujocoSession"]

Array = NDArray[Any]

_CYCLE = 10
"""Steps between two looks at how fast matter is."""


class _StoppedError(Exception):
    """Ends an advance with anything but OK."""

    def __init__(self, status: Status, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class MujocoSession:
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
        self._problem = problem
        self._accuracy = accuracy
        self._note = note
        self._time = 0.0
        self._events = event_times(problem.drives, problem.force_fields)
        used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
        self._sound = max((speed for speed in map(sound_speed, used) if math.isfinite(speed)), default=0.0)
        self._side = min((float(cage.lattice.sides.min()) for cage in model.cages), default=math.inf)
        self._smallest = min([self._side, *(float(np.cbrt(one.matter.volumes.sum())) for one in model.bodies)])
        motion = Motion(problem, model, accuracy.solver_tolerance)
        if restart is not None:
            self._time = _restored(motion, restart)
            self._note = ""
        self._motion: Motion | None = motion

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
        motion = self._living()
        if not (math.isfinite(time) and time >= self._time):
            raise ValueError(f"cannot advance to {time!r} s: the session is at {self._time!r} s")
        span = time - self._time
        steps: list[float] = []
        warnings: list[str] = []
        status = Status.OK
        if span > 0 and self._note:
            warnings.append(self._note)
            self._note = ""
        try:
            while self._time < time:
                for impulse in self._problem.drives:
                    if isinstance(impulse, Impulse) and impulse.start == self._time:
                        motion.strike(impulse)
                later = self._events[self._events > self._time]
                landing = min(time, float(later[0])) if len(later) else time
                while self._time < landing:
                    self._cycle(motion, landing, time, span, steps)
            if span > 0:
                self._stop_outside(motion)
        except _StoppedError as stopped:
            status = stopped.status
            warnings.append(stopped.reason)
        if status is Status.OK:
            warnings += motion.complaints()
        return StepReport(
            status=status,
            substep_count=len(steps),
            smallest_substep=min(steps, default=0.0),
            largest_substep=max(steps, default=0.0),
            warnings=tuple(warnings),
        )

    def _cycle(self, motion: Motion, landing: float, end: float, span: float, steps: list[float]) -> None:
        """Some equal steps towards `landing`, whose sizes are appended to `steps`."""
        allowed = step_size(
            self._accuracy,
            span=span,
            side=self._smallest,
            sound=self._sound,
            speed=motion.speed(),
            acceleration=math.hypot(*self._problem.gravity),
        )
        needed = len(steps) + math.ceil((end - self._time) / allowed * (1 - 1e-9))
        if needed > self._accuracy.substep_limit:
            raise _StoppedError(
                Status.SUBSTEP_LIMIT,
                f"{needed:,} steps of {allowed:.3g} s would be needed, {self._accuracy.substep_limit:,} are allowed:"
                " raise substep_limit, or ask for frames closer together",
            )
        count, step = substeps_to(landing - self._time, allowed)
        taken = min(count, _CYCLE)
        begun = self._time
        for number in range(taken):
            failure = motion.step(begun + number * step, step)
            steps.append(step)
            self._time = landing if number + 1 == count else begun + (number + 1) * step
            if failure:
                raise _StoppedError(Status.NOT_CONVERGED, failure)
            lost = motion.lost()
            if lost:
                raise _StoppedError(Status.NON_FINITE, f"{lost}, with steps of {step:.3g} s: lower substep_fraction")

    def _stop_outside(self, motion: Motion) -> None:
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.STOP:
            return
        positions = motion.positions()
        outside = np.maximum(np.asarray(domain.lower) - positions, positions - np.asarray(domain.upper)).max(axis=1)
        worst = int(np.argmax(outside))
        if outside[worst] > 0:
            raise _StoppedError(
                Status.OUT_OF_DOMAIN,
                f"point {worst} left the domain, {outside[worst]:.3g} m outside: enlarge the domain, or use the"
                ' policy "expand"',
            )

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

    def close(self) -> None:
        """Let go of the model."""
        self._motion = None

    def _living(self) -> Motion:
        if self._motion is None:
            raise ValueError("mujoco-flex: the session is closed: open a new one")
        return self._motion

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()


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
