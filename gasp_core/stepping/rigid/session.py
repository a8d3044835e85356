"""A session of rigid bodies alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, Impulse, PointState, Status
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.session import SteppedSession, StoppedError
from gasp_core.stepping.time_step import MotionLimits, driven_speed, gust_of, substep_size, substeps_to, wall_speed

__all__ = ["RigidSession"]

Array = NDArray[Any]

_CYCLE = 20
"""Steps between two looks at how fast the bodies have become."""
_CYCLE_TRAVEL = 0.5
"""In cells: no body goes further within a cycle."""


class RigidSession(SteppedSession[RigidSide]):
    """Rigid bodies that meet each other and walls; see `gasp_core.contract.EngineSession`.

    Parameters
    ----------
    side
        The bodies; nothing else is in the problem.
    engine
        Whose session it is, for messages.
    accuracy
        The common knobs.
    restart
        What the bodies go on from; None: they begin.
    """

    def __init__(
        self, side: RigidSide, *, engine: str, accuracy: EngineAccuracy, restart: Mapping[str, Array] | None
    ) -> None:
        time = 0.0 if restart is None else float(checkpoint_arrays(restart, {"time": ()}, engine)["time"])
        super().__init__(side.problem, side, engine=engine, accuracy=accuracy, time=time)
        self._spacing = accuracy.spacing_for(side.problem.points.size)

    def step_toward(self, landing: float, end: float) -> None:
        """A few equal steps towards `landing`."""
        side = self.held()
        limits = _limits(side, self._time, self._spacing)
        allowed = substep_size(limits, self._spacing, self.accuracy)
        self.refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        taking = min(count, max(1, int(min(_CYCLE, limits.lasting(_CYCLE_TRAVEL * self._spacing) / step))))
        start = self._time
        for index in range(taking):
            side.world.step(start + index * step, step)
        self.record_steps(taking, step, landing if taking == count else start + taking * step)

    def check_state(self, step: float) -> None:
        """See `SteppedSession`."""
        side = self.held()
        positions = side.positions(np.zeros((0, 3)))
        self.refuse_lost(step, positions)
        leap = side.world.fastest * step / self._spacing
        if leap > 1:
            raise StoppedError(
                Status.NON_FINITE,
                f"rigid bodies move {leap:.3g} cells in a step of {step:.3g} s: lower substep_fraction or substep",
            )
        self.refuse_outside(positions)

    def apply_impulse(self, impulse: Impulse) -> None:
        """See `SteppedSession`."""
        self.held().impulse(impulse, np.zeros((0, 3)))

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        return self.held().state(self._time, fields, None)

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes."""
        return {"time": np.array(self._time), **self.held().world.checkpoint()}


def _limits(side: RigidSide, time: float, spacing: float) -> MotionLimits:
    """What bounds a step of rigid bodies alone, on a grid of `spacing` [m]."""
    low, high = side.box
    return MotionLimits(
        stress=side.longest_step,
        speed=max(
            side.world.fastest,
            wall_speed(side.problem.colliders, time, low, high, spacing),
            driven_speed(side.problem.drives, time, low, high),
        ),
        velocity_gradient=0.0,
        acceleration=math.hypot(*side.problem.gravity),
        gust=gust_of(side.problem.force_fields, time),
    )
