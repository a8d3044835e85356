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
from gasp_core.stepping.time_step import MotionLimits, driven_speed, substep_size, substeps_to, wall_speed

__all__ = ["RigidSession"]

Array = NDArray[Any]

_CYCLE = 20
"""Steps between two looks at how fast the bodies have become."""
_LONGEST_STEP = 1e-3
"""[s] Contacts hold for a step: what rolls or rocks goes on as if they did not change in it."""
_FALL_SHARE = 3e-2
"""Of sqrt(r / g) for the radius r of the smallest body: small ones fall past themselves, and rock, as fast as that."""


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
        self._longest = _longest_step(side)

    def step_toward(self, landing: float, end: float) -> None:
        """A few equal steps towards `landing`."""
        side = self.held()
        limits = _limits(side, self._time, self._longest, self._spacing)
        allowed = substep_size(limits, self._spacing, self._accuracy)
        self.refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        taking = min(count, _CYCLE)
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


def _longest_step(side: RigidSide) -> float:
    """What rolling and rocking bear [s], of bodies of any size."""
    gravity = math.hypot(*side.problem.gravity)
    if gravity == 0:
        return _LONGEST_STEP
    bodies = side.world.bodies
    # Of the ball that turns as easily: a pencil rolls by its thickness, not by its length.
    radius = math.sqrt(2.5 * float((bodies.moments.min(axis=1) / bodies.masses).min()))
    return min(_LONGEST_STEP, _FALL_SHARE * math.sqrt(radius / gravity))


def _limits(side: RigidSide, time: float, longest: float, spacing: float) -> MotionLimits:
    """What bounds a step of rigid bodies alone, on a grid of `spacing` [m]."""
    places = side.world.state.places
    radius = float(side.world.surfaces.radii.max())
    low, high = places.min(axis=0) - radius, places.max(axis=0) + radius
    return MotionLimits(
        stress=longest,
        speed=max(
            side.world.fastest,
            wall_speed(side.problem.colliders, time, low, high, spacing),
            driven_speed(side.problem.drives, time, low, high),
        ),
        velocity_gradient=0.0,
        acceleration=math.hypot(*side.problem.gravity),
    )
