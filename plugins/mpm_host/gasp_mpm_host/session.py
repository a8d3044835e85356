"""A running simulation: chooses steps, lands on times, judges the state.

It knows no backend: what steps the points is a `SteppedCloud` that somebody else builds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import DomainPolicy, EngineAccuracy, Field, Impulse, PointProblem, PointState, Status, Wind
from gasp_core.errors import SceneError
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.forcing import drives_at, force_fields_at
from gasp_core.stepping.led_nodes import LedGrid
from gasp_core.stepping.led_points import LedPoints
from gasp_core.stepping.rigid.session import RigidSession
from gasp_core.stepping.rigid.side import RigidSide
from gasp_core.stepping.session import SteppedSession, StoppedError, impulse_change
from gasp_core.stepping.threads import ThreadOptions
from gasp_core.stepping.time_step import MotionLimits, hardening_of, limits_of, substep_size, substeps_to
from gasp_mpm_host import layout as at
from gasp_mpm_host.cells import GridTooLargeError
from gasp_mpm_host.forcing_tables import FieldTable, Forcing, collider_rows, drive_rows, wind_rows
from gasp_mpm_host.holding import Holding, WeighedCloud
from gasp_mpm_host.led_steps import LedSteps
from gasp_mpm_host.rigid_steps import RigidSteps
from gasp_mpm_host.rows import Survey
from gasp_mpm_host.scaling import Units
from gasp_mpm_host.stages import InterruptedSteps, Intervention, StagedCloud

__all__ = ["FarAwayError", "MpmSession", "SteppedCloud", "opened"]

Array = NDArray[Any]

_LONGEST_BATCH = 20
"""Steps between two looks at what bounds them."""
_BATCH_TRAVEL = 0.5
"""In cells: how far a point may fly between two looks."""
_DRIFT_BEFORE = 0.25
"""In cells: how far outside their homes points may be before a batch, so that none is a cell outside within it."""
_INTERRUPTED = 6
"""Times as many points as else have work for a thread where the host has a word in every step: threads are woken three
times a step then. With a rigid body two take 1.15 of the time of one for 4,000 other points, and 1.05 for 30,000."""
_FELT = 1.5
"""In cells: how far away from a node points feel what acts there."""


class FarAwayError(Exception):
    """A point is too many cells away to be given a cell."""


class SteppedCloud(WeighedCloud, Protocol):
    """Points and grid in a backend's memory."""

    def survey(self) -> Survey:
        """Look at every point."""
        ...

    def sort(self) -> None:
        """Put the points into order; raises FarAwayError or GridTooLargeError where there is none."""
        ...

    def set_walls(self, lower: Array, upper: Array) -> None:
        """Hold points and nodes within a box [m] from now on."""
        ...

    def set_fields(self, numbers: Array) -> None:
        """Set the distance fields (M,) that rows of what acts name, see `forcing_tables.FieldTable`."""
        ...

    def begin_batch(self, step: float, gravity: Array, forcing: Forcing, looks: int = 1) -> None:
        """Set what acts during the next steps of `step` [s] each, besides gravity (3,) [m/s^2].

        At the first and then every `looks` steps it is looked how far apart bodies are.
        """
        ...

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch: how many were done, whether a point drifted, whether the edge held any."""
        ...

    def push(self, members: Array, change: Array) -> None:
        """Add `change` (3,) [m/s] to the velocities of `members` (N,)."""
        ...

    def velocities(self) -> Array:
        """(N, 3) [m/s], in the given order."""
        ...

    def deformation_gradients(self) -> Array:
        """(N, 3, 3), in the given order."""
        ...

    def tracer_positions(self) -> Array:
        """(M, 3) [m], in the given order; none where the scene has none."""
        ...

    def checkpoint(self) -> dict[str, Array]:
        """The state, for a restart."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...


CloudBuilder = Callable[[PointProblem, Units, Mapping[str, Array] | None, str], SteppedCloud]
"""From problem, units, checkpoint and the engine's name."""


def _named(index: int, place: Array) -> str:
    return f"point {index} at ({', '.join(f'{value:.4g}' for value in place)}) m"


def _farthest(positions: Array) -> str:
    away = np.abs(positions - np.median(positions, axis=0)).max(axis=1)
    worst = int(np.argmax(away))
    return f"{_named(worst, positions[worst])} is {away[worst]:.3g} m away from the others"


def _time_of(restart: Mapping[str, Array], frame: Array, engine: str) -> float:
    kept = checkpoint_arrays(restart, {"time": (), "frame": frame.shape}, engine)
    if np.array_equal(kept["frame"], frame):
        return float(kept["time"])
    raise SceneError(
        f"{engine}: the checkpoint was written for another scene or grid spacing: resume with the scene and"
        " accuracy the run was started with"
    )


class MpmSession(SteppedSession[SteppedCloud]):
    """A session of an explicit MPM engine; see `gasp_core.contract.EngineSession`.

    Parameters
    ----------
    problem
        What is simulated.
    engine
        The engine's name, for messages.
    accuracy
        The common knobs.
    build
        Makes the cloud.
    restart
        A checkpoint of a session of the same problem, or None.
    rigid
        Bodies beside those of the problem; None without any.

    Raises
    ------
    SceneError
        For points too far apart for a grid, or a checkpoint of something else.
    """

    _survey: Survey
    """Of the last look."""

    def __init__(
        self,
        problem: PointProblem,
        *,
        engine: str,
        accuracy: EngineAccuracy,
        build: CloudBuilder,
        restart: Mapping[str, Array] | None = None,
        rigid: RigidSide | None = None,
    ) -> None:
        self._rigid = rigid
        size = (problem if rigid is None else rigid.problem).points.size
        self._units = units = Units.of(problem, accuracy.spacing_for(size))
        self._frame = np.array([*units.anchor, units.spacing, units.time, units.mass])
        time = 0.0 if restart is None else _time_of(restart, self._frame, engine)
        self._fields = fields = FieldTable.of(problem, units)
        self._walls_move = any(collider.motion is not None for collider in problem.colliders)
        self._colliders = collider_rows(problem.colliders, 0.0, 0.0, units, fields)[None]
        self._hardening = hardening_of(problem)
        try:
            cloud = build(problem, units, restart, engine)
        except (GridTooLargeError, FarAwayError) as error:
            raise SceneError(
                f"{engine}: {_farthest(problem.points.reference_positions)}, too far for a grid of spacing"
                f" {units.spacing:.3g} m: raise the spacing (lower the resolution), or leave that point out"
            ) from error
        cloud.set_fields(fields.numbers)
        domain = problem.domain
        if domain is not None and domain.policy is DomainPolicy.CLAMP:
            cloud.set_walls(np.array(domain.lower), np.array(domain.upper))
        super().__init__(problem, cloud, engine=engine, accuracy=accuracy, time=time)
        self._led = LedPoints.of(problem)
        staged, interventions = cast("StagedCloud", cloud), list[Intervention]()
        if self._led is not None:
            grid = LedGrid.of(problem, self._led, units.spacing, units.anchor)
            interventions.append(LedSteps(staged, grid, problem))
        if rigid is not None:
            interventions.append(RigidSteps(staged, rigid))
        self._interrupted = InterruptedSteps(staged, interventions) if interventions else None
        self._bodies = int(problem.points.body_ids.max()) + 1
        self._holding = Holding(problem, rigid, units.spacing)
        self._clamped = False
        self._inverted = 0

    def begin_advance(self, end: float) -> None:
        """See `SteppedSession`."""
        self._clamped = False
        self._inverted = 0
        self._holding.begin_advance()

    def warnings(self) -> list[str]:
        """See `SteppedSession`."""
        told: list[str] = []
        if self._inverted:
            told.append(f"{self._inverted} point(s) are inverted (det F <= 0): refine the grid or stiffen the material")
        if self._clamped:
            told.append("matter was held back at the domain's edge")
        return told

    def step_toward(self, landing: float, end: float) -> None:
        """One batch of equal steps towards `landing`."""
        limits = self._limits(self._survey)
        allowed = substep_size(limits, self._units.spacing, self.accuracy)
        self.refuse_too_many(allowed, end)
        count, step = substeps_to(landing - self._time, allowed)
        reach = int(min(_LONGEST_BATCH, limits.lasting(_BATCH_TRAVEL * self._units.spacing) / step))
        taking = min(count, max(1, reach))
        # The last batch lands on the very number that was asked for, not on a sum of steps.
        if (self._bodies > 1 or self._led is not None) and self._survey.drift > _DRIFT_BEFORE:
            # Now rather than on the way: what is known of contact lasts from look to look, unless points are sorted,
            # and where a point is led nobody looks how far from home that is.
            self._sort(self.held())
        looks = limits.steps_between_looks(self._units.spacing, step)
        self._take(taking, step, max(step, allowed), landing if taking == count else None, looks)

    def check_state(self, step: float) -> None:
        """See `SteppedSession`."""
        self._survey = self.held().survey()
        self._judge(self._survey, step)

    def _limits(self, survey: Survey) -> MotionLimits:
        spacing = self._units.spacing
        low, high, stress, rigid = survey.low, survey.high, survey.stress, 0.0
        if self._rigid is not None:
            low, high, stress = self._rigid.beside(low, high, stress)
            rigid = self._rigid.world.fastest
        led = 0.0 if self._led is None else self._led.fastest(self._time)
        return limits_of(
            self._problem,
            self._time,
            low - _FELT * spacing,
            high + _FELT * spacing,
            spacing,
            stress=stress,
            speed=max(survey.speed, rigid, led),
            velocity_gradient=survey.velocity_gradient,
            hardening=self._hardening,
        )

    def _take(self, count: int, step: float, allowed: float, landing: float | None, looks: int) -> None:
        """Take `count` steps, which may be as long as `allowed`, the last up to `landing`; sort what has strayed."""
        cloud, begin = self.held(), self._time
        winds = [wind for wind in force_fields_at(self._problem.force_fields, begin) if isinstance(wind, Wind)]
        drives = drives_at(self._problem.drives, begin)
        holding = self._holding.bodies(drives, begin, cloud)
        placed = [drive_rows(drives, begin + index * step, step, self._units, self._fields) for index in range(count)]
        forcing = Forcing(
            colliders=self._walls(begin, step, count),
            winds=wind_rows(winds, step, self._units, self._fields),
            drives=np.array(placed).reshape(count, len(drives), at.DRIVE_WIDTH),
            holding=holding,
        )
        cloud.begin_batch(step, np.asarray(self._problem.gravity), forcing, looks)
        stepper = cloud if self._interrupted is None else self._interrupted
        if self._interrupted is not None:
            self._interrupted.begin_batch(begin, step, count, allowed)
        done = 0
        while done < count:
            taken, drifted, clamped = stepper.steps(done, count)
            done += taken
            self._clamped |= clamped
            if taken:
                landed = landing if done == count else None
                self.record_steps(taken, step, begin + done * step if landed is None else landed)
            if drifted:
                self._judge(cloud.survey(), step)
                self._sort(cloud)

    def _walls(self, begin: float, step: float, count: int) -> Array:
        """Rows of the colliders, one set for all steps or, where any of them moves, one for each: (sets, K, width)."""
        if not self._walls_move:
            return self._colliders
        times = [begin + index * step for index in range(count)]
        return np.array(
            [collider_rows(self._problem.colliders, time, step, self._units, self._fields) for time in times]
        )

    def _sort(self, cloud: SteppedCloud) -> None:
        try:
            cloud.sort()
        except (GridTooLargeError, FarAwayError) as error:
            raise StoppedError(
                Status.OUT_OF_DOMAIN,
                f"{_farthest(cloud.positions())}, too far for a grid of spacing {self._units.spacing:.3g} m:"
                " add a floor or a domain, or use a coarser resolution",
            ) from error

    def apply_impulse(self, impulse: Impulse) -> None:
        """See `SteppedSession`."""
        cloud = self.held()
        if self._rigid is None:
            given = impulse_change(impulse, cloud.positions(), self._problem.masses)
        else:
            given = self._rigid.impulse(impulse, cloud.positions())
        if given is not None:
            cloud.push(*given)

    def _judge(self, survey: Survey, step: float) -> None:
        """Stop where the state is no longer credible or has left the domain."""
        cloud = self.held()
        if not survey.finite:
            self.refuse_lost(step, cloud.positions(), cloud.velocities(), cloud.deformation_gradients())
            raise StoppedError(Status.NON_FINITE, f"the state is no longer finite, with substeps of {step:.3g} s")
        self._inverted = max(self._inverted, survey.inverted)
        self.refuse_crushed(survey.crushed, step)
        leap = survey.speed * step / self._units.spacing
        if leap > 1:
            raise StoppedError(
                Status.NON_FINITE,
                f"points move {leap:.3g} cells in one substep of {step:.3g} s: the motion has blown up; lower"
                " substep_fraction, or check the scene's forces",
            )
        if self._rigid is not None:
            self.refuse_outside(self._rigid.positions(cloud.positions()))
        domain = self._problem.domain
        if domain is not None and ((survey.low < domain.lower).any() or (survey.high > domain.upper).any()):
            self.refuse_outside(cloud.positions())

    def read(self, fields: frozenset[Field]) -> PointState:
        """Positions and the asked fields, in the order given, float64, owned."""
        if self._rigid is not None:
            return self._rigid.state(self._time, fields, self._read(fields))
        return self._read(fields)

    def _read(self, fields: frozenset[Field]) -> PointState:
        cloud = self.held()
        traced = self._problem.points.tracer_positions is not None and Field.TRACER_POSITIONS in fields
        return PointState(
            time=self._time,
            positions=cloud.positions(),
            velocities=cloud.velocities() if Field.VELOCITIES in fields else None,
            deformation_gradients=cloud.deformation_gradients() if Field.DEFORMATION_GRADIENTS in fields else None,
            tracer_positions=cloud.tracer_positions() if traced else None,
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """Everything a restart needs."""
        rigid = {} if self._rigid is None else self._rigid.world.checkpoint()
        return {"time": np.array(self._time), "frame": self._frame.copy(), **self.held().checkpoint(), **rigid}

    def release(self, held: SteppedCloud) -> None:
        """See `SteppedSession`."""
        held.close()


def opened(
    problem: PointProblem,
    *,
    engine: str,
    accuracy: EngineAccuracy,
    build: Callable[..., SteppedCloud],
    options: ThreadOptions | None = None,
    restart: Mapping[str, Array] | None = None,
) -> MpmSession | RigidSession:
    """The session of a problem, whatever is in it; parameters as of `MpmSession`, but that `build` is also given the
    number of `threads` that follows from the options.

    Raises
    ------
    SceneError
        As `MpmSession`, and where a body is rigid in part.
    """
    rigid = RigidSide.of(problem, restart, engine)
    own = problem
    if rigid is not None:
        if rigid.soft is None:
            return RigidSession(rigid, engine=engine, accuracy=accuracy, restart=restart)
        own = rigid.soft
    alone = rigid is None and problem.trajectories is None
    threads = (options or ThreadOptions()).threads_for(len(own.points) // (1 if alone else _INTERRUPTED))
    cloud = partial(build, threads=threads)
    return MpmSession(own, engine=engine, accuracy=accuracy, build=cloud, restart=restart, rigid=rigid)
