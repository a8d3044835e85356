"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, Field, Impulse, PointProblem, PointState, Status
from gasp_core.errors import SceneError
from gasp_core.stepping.grid import grid_node
from gasp_core.stepping.session import SteppedSession, StoppedError, impulse_change
from gasp_core.stepping.time_step import MotionLimits, hardening_of, substep_size, substeps_to
from gasp_genesis_mpm.checkpoint import restored, stored
from gasp_genesis_mpm.grid_window import TooWideError
from gasp_genesis_mpm.scene_lease import Performance
from gasp_genesis_mpm.time_step import stable_step

__all__ = ["GenesisSession"]

Array = NDArray[Any]

_CALM = 0.625
"""Of the stable step, on top of `substep_fraction`: half of it in all by default. With four fifths, what float32 loses
of the momentum of a collision (V10, 64 cells) is 1.1e-6 of it, and not 6e-7."""
_LONGEST_BATCH = 20
"""Substeps between two looks at what bounds them."""
_BATCH_TRAVEL = 0.5
"""In cells: how far a point may fly between two looks."""


class GenesisSession(SteppedSession[Performance]):
    """See `gasp_core.contract.EngineSession`.

    Between two advances the state is here, in SI, and Genesis has it only while it steps. So a session that goes on and
    one that is taken up from a checkpoint do the same, bit for bit.
    """

    def __init__(
        self,
        problem: PointProblem,
        spacing: float,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None,
    ) -> None:
        self._spacing = spacing
        self._origin = grid_node(problem, spacing)
        self._hardening = hardening_of(problem)
        start = restored(restart, problem, self._origin, spacing)
        self._motion = start.motion
        self._inverted = 0
        try:
            performance = Performance(problem, spacing, self._origin, start.motion, start.window)
        except TooWideError as error:
            raise SceneError(f"genesis-mpm: {self._too_wide(error)}") from error
        super().__init__(problem, performance, engine="genesis-mpm", accuracy=accuracy, time=start.time)

    def begin_advance(self, end: float) -> None:
        """See `SteppedSession`."""
        self._inverted = 0

    def warnings(self) -> list[str]:
        """See `SteppedSession`."""
        if not self._inverted:
            return []
        return [f"{self._inverted} point(s) were turned inside out (det F <= 0) at once; results there are rough"]

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        self.held()
        motion = self._motion
        return PointState(
            time=self._time,
            positions=self._places(),
            velocities=motion.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=motion.deformations.copy() if Field.DEFORMATION_GRADIENTS in fields else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        window = self.held().window
        return stored(self._time, self._motion, window, self._origin, self._spacing)

    def release(self, held: Performance) -> None:
        """See `SteppedSession`."""
        held.end()

    def _places(self) -> Array:
        return self._motion.cells * self._spacing + self._origin

    def step_toward(self, landing: float, end: float) -> None:
        """A few equal substeps towards `landing`."""
        limits = self._limits()
        share = _CALM * self.accuracy.substep_fraction
        allowed = substep_size(limits, self._spacing, replace(self.accuracy, substep_fraction=share))
        self.refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        reach = int(min(_LONGEST_BATCH, limits.lasting(_BATCH_TRAVEL * self._spacing) / step))
        taking = min(count, max(1, reach))
        try:
            self._motion = self.held().play(self._motion, taking, step)
        except TooWideError as error:
            raise StoppedError(Status.OUT_OF_DOMAIN, self._too_wide(error)) from error
        except FloatingPointError as error:
            raise StoppedError(
                Status.NON_FINITE,
                f"Genesis: {error} (substeps of {step:.3g} s): lower substep_fraction, or check the scene's forces",
            ) from error
        # The last batch lands on the very number that was asked for, not on a sum of steps.
        self.record_steps(taking, step, landing if taking == count else self._time + taking * step)
        self._refuse_leap(step)

    def _limits(self) -> MotionLimits:
        motion = self._motion
        return MotionLimits(
            stress=stable_step(self._problem, self.held().portions, motion, self._spacing),
            speed=float(np.linalg.norm(motion.velocities, axis=1).max()),
            velocity_gradient=float(np.linalg.norm(motion.affine_velocities, axis=(1, 2)).max()),
            acceleration=math.hypot(*self._problem.gravity),
            hardening=self._hardening,
        )

    def apply_impulse(self, impulse: Impulse) -> None:
        """See `SteppedSession`."""
        given = impulse_change(impulse, self._places(), self._problem.masses)
        if given is not None:
            struck, change = given
            self._motion = replace(self._motion, velocities=self._motion.velocities + struck[:, None] * change)

    def _refuse_leap(self, step: float) -> None:
        motion = self._motion
        self.refuse_lost(step, motion.cells, motion.velocities, motion.deformations)
        speeds = np.linalg.norm(motion.velocities, axis=1)
        leap = float(speeds.max()) * step / self._spacing
        if leap > 1:
            raise StoppedError(
                Status.NON_FINITE,
                f"point {int(speeds.argmax())} moves {leap:.3g} cells in one substep of {step:.3g} s: the motion has"
                " blown up; lower substep_fraction, or check the scene's forces",
            )
        if not self.held().window.holds(motion.cells):
            raise StoppedError(
                Status.OUT_OF_DOMAIN,
                "a point flew to the edge of Genesis' grid between two looks, where it is held back: lower"
                " substep_fraction, or check the scene's forces",
            )

    def check_state(self, step: float) -> None:
        """See `SteppedSession`."""
        self.refuse_outside(self._places())
        if step:
            self._inverted = max(self._inverted, int((np.linalg.det(self._motion.deformations) <= 0).sum()))

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
