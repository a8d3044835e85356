"""A running simulation: how far to step, when to stop, what to report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import DomainPolicy, EngineAccuracy, Field, Impulse, PointProblem, PointState, Status
from gasp_core.stepping.forcing import bodies_held, drives_at
from gasp_core.stepping.held_matter import firmness
from gasp_core.stepping.led_nodes import LedGrid
from gasp_core.stepping.led_points import LedPoints
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.session import CRUSHED_VOLUME, SteppedSession, StoppedError, impulse_change
from gasp_core.stepping.time_step import MotionLimits, hardening_of, limits_of, substep_size, substeps_to
from gasp_reference_mpm.grid import grid_excess
from gasp_reference_mpm.leading import Lead
from gasp_reference_mpm.material_points import Matter, Motion, stable_step
from gasp_reference_mpm.substep import substep

__all__ = ["ReferenceSession"]

Array = NDArray[Any]

_CYCLE = 20
"""Substeps between two looks at how stiff and how fast the cloud has become."""
_CYCLE_TRAVEL = 0.5
"""In cells: no point travels further within a cycle."""


class ReferenceSession(SteppedSession[Motion]):
    """See `gasp_core.contract.EngineSession`."""

    def __init__(
        self,
        problem: PointProblem,
        matter: Matter,
        motion: Motion,
        origin: Array,
        spacing: float,
        accuracy: EngineAccuracy,
        time: float,
        rigid: RigidSide | None = None,
    ) -> None:
        super().__init__(problem, motion, engine="reference-mpm", accuracy=accuracy, time=time)
        self._matter = matter
        self._origin = origin
        self._spacing = spacing
        self._held_back = np.zeros(len(matter.masses), dtype=bool)
        self._inverted = 0
        self._firm_for: list[int] | None = None
        self._hardening = hardening_of(problem)
        self._rigid = rigid
        led = LedPoints.of(problem)
        self._led = None if led is None else LedGrid.of(problem, led, spacing, origin)

    def begin_advance(self, end: float) -> None:
        """See `SteppedSession`."""
        self._held_back[:] = False
        self._inverted = 0
        self._firm_for = None

    def warnings(self) -> list[str]:
        """See `SteppedSession`."""
        told: list[str] = []
        if self._inverted:
            told.append(
                f"{self._inverted} point(s) were turned inside out (det F <= 0) at once; results there are rough"
            )
        if self._held_back.any():
            told.append(f"{int(self._held_back.sum())} point(s) were held back at the domain's edge")
        return told

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given."""
        if self._rigid is not None:
            return self._rigid.state(self._time, fields, self._read(fields))
        return self._read(fields)

    def _read(self, fields: frozenset[Field]) -> PointState:
        motion = self.held()
        traced = Field.TRACER_POSITIONS in fields and self._problem.points.tracer_positions is not None
        return PointState(
            time=self._time,
            positions=motion.positions + self._origin,
            velocities=motion.velocities.copy() if Field.VELOCITIES in fields else None,
            deformation_gradients=motion.deformations.copy() if Field.DEFORMATION_GRADIENTS in fields else None,
            tracer_positions=motion.tracers + self._origin if traced else None,
        )

    def view(self, field: Field) -> Array:
        """A field where it is, see `gasp_core.contract.ViewingSession`; positions are kept from the grid's origin."""
        motion = self.held()
        if self._rigid is not None:
            return getattr(self.read(frozenset({field})), field.value)
        match field:
            case Field.POSITIONS:
                return motion.positions + self._origin
            case Field.VELOCITIES:
                return motion.velocities
            case Field.DEFORMATION_GRADIENTS:
                return motion.deformations
            case Field.TRACER_POSITIONS:
                return motion.tracers + self._origin

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything that changes; what does not is in the problem."""
        motion = self.held()
        rigid = {} if self._rigid is None else self._rigid.world.checkpoint()
        return {
            **rigid,
            "time": np.array(self._time),
            "positions": motion.positions.copy(),
            "velocities": motion.velocities.copy(),
            "affine_velocities": motion.affine_velocities.copy(),
            "velocity_gradients": motion.velocity_gradients.copy(),
            "deformations": motion.deformations.copy(),
            "history": motion.history.copy(),
            "shock_pressures": motion.shock_pressures.copy(),
            "tracers": motion.tracers.copy(),
        }

    def step_toward(self, landing: float, end: float) -> None:
        """A few equal substeps towards `landing`."""
        motion = self.held()
        limits = self._limits(motion)
        allowed = substep_size(limits, self._spacing, self.accuracy)
        self.refuse_too_many(allowed, end)
        remaining = landing - self._time
        count, step = substeps_to(remaining, allowed)
        reach = int(min(_CYCLE, limits.lasting(_CYCLE_TRAVEL * self._spacing) / step))
        taking = min(count, max(1, reach))
        start = self._time
        looks = limits.steps_between_looks(self._spacing, step)
        separation = None
        drives = drives_at(self._problem.drives, start)
        places, bodies = motion.positions + self._origin, self._problem.points.body_ids
        if self._rigid is None:
            holding = bodies_held(drives, start, places, bodies, int(bodies.max()) + 1, self._spacing)
        else:
            holding = self._rigid.bodies_held(drives, start, places, self._spacing)
        if self._firm_for != (acting := list(map(id, drives))):
            counted = firmness(self._problem, drives, start, places, holding, self._spacing)
            self._matter, self._firm_for = replace(self._matter, firmness=counted), acting
        lead = None if self._led is None else Lead.during(self._led, start, start + taking * step)
        for index in range(taking):
            now = start + index * step
            # Overflow is not silenced but awaited: `_refuse_leap` looks at every result before it is used.
            with np.errstate(over="ignore", invalid="ignore"):
                motion, separation, held = substep(
                    self._problem,
                    self._matter,
                    motion,
                    None if index % looks == 0 else separation,
                    holding,
                    self._origin,
                    self._spacing,
                    now,
                    step,
                    max(step, allowed),
                    self._rigid,
                    lead,
                )
            self._held_back |= held
            self._refuse_leap(motion, now, step)
            motion = self._clamped(motion)
        self.hold(motion)
        # The last cycle lands on the very number that was asked for, not on a sum of steps.
        self.record_steps(taking, step, landing if taking == count else start + taking * step)

    def _limits(self, motion: Motion) -> MotionLimits:
        places = motion.positions + self._origin
        low, high = places.min(axis=0), places.max(axis=0)
        stress, rigid = stable_step(self._matter, motion, self._spacing), 0.0
        if self._rigid is not None:
            low, high, stress = self._rigid.beside(low, high, stress)
            rigid = self._rigid.world.fastest
        felt = 1.5 * self._spacing  # drives act at nodes, which points feel from so far away
        led = 0.0 if self._led is None else self._led.points.fastest(self._time)
        return limits_of(
            self._problem,
            self._time,
            low - felt,
            high + felt,
            self._spacing,
            stress=stress,
            speed=max(float(np.linalg.norm(motion.velocities, axis=1).max()), rigid, led),
            velocity_gradient=float(np.linalg.norm(motion.affine_velocities, axis=(1, 2)).max()),
            hardening=self._hardening,
        )

    def apply_impulse(self, impulse: Impulse) -> None:
        """See `SteppedSession`."""
        motion = self.held()
        places = motion.positions + self._origin
        if self._rigid is None:
            given = impulse_change(impulse, places, self._matter.masses)
        else:
            given = self._rigid.impulse(impulse, places)
        if given is not None:
            struck, change = given
            self.hold(replace(motion, velocities=motion.velocities + struck[:, None] * change))

    def _clamped(self, motion: Motion) -> Motion:
        """Points that slipped through a clamping edge, brought back onto it, stopped at it, and remembered."""
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.CLAMP:
            return motion
        inside = np.clip(motion.positions, domain.lower - self._origin, domain.upper - self._origin)
        back = inside - motion.positions
        self._held_back |= (back != 0).any(axis=1)
        velocities = np.where(back * motion.velocities < 0, 0.0, motion.velocities)
        return replace(motion, positions=inside, velocities=velocities)

    def _refuse_leap(self, motion: Motion, time: float, step: float) -> None:
        self.refuse_lost(step, motion.positions, motion.velocities, motion.deformations)
        leap = np.linalg.norm(motion.velocities, axis=1) * step / self._spacing
        if leap.max() > 1:
            raise StoppedError(
                Status.NON_FINITE,
                f"point {int(leap.argmax())} crosses {leap.max():.3g} cells in one substep at {time:.6g} s:"
                f" try a substep below {step / 2 / leap.max():.3g} s",
            )

    def check_state(self, step: float) -> None:
        """Refuse a cloud that has left its domain or outgrown the grid; count inverted points."""
        motion = self.held()
        places = motion.positions + self._origin
        self.refuse_outside(places if self._rigid is None else self._rigid.positions(places))
        excess = grid_excess(places, self._spacing)
        if excess:
            raise StoppedError(Status.OUT_OF_DOMAIN, f"at {self._time:.6g} s {excess}")
        if step:
            volumes = np.linalg.det(motion.deformations)
            self._inverted = max(self._inverted, int((volumes <= 0).sum()))
            self.refuse_crushed(int((volumes[self._matter.elastic] <= CRUSHED_VOLUME).sum()), step)
