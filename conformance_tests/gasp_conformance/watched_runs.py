"""Runs that may end early, but not in silence: what an engine reports, held against what it shows, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance.subject import Subject, Undeclared
from gasp_core.contract import (
    DomainPolicy,
    EngineAccuracy,
    EngineSession,
    Field,
    PointProblem,
    PointState,
    Status,
    StepReport,
)
from gasp_core.errors import GaspError
from gasp_core.simulation.monitor import Watch, inspect, non_finite_rows, released_potential, watch_over

__all__ = ["WatchedRun", "watch_run"]

Array = NDArray[Any]

_ROUNDING = 1e-6
"""Relative: sums of substeps, and places against a domain's edge, in the coarser of the two precisions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedRun:
    """A run to its end, or to where it stopped.

    Parameters
    ----------
    faults
        What must never happen, a sentence each; empty for a run that is right or stops with a reason.
    refusal
        What the engine said where it raised a `GaspError` instead of running on; empty where it did not.
    status
        Of the last advance; None where there was none.
    states
        The start and every frame that was reported OK.
    reports
        Of every advance.
    """

    faults: tuple[str, ...]
    refusal: str
    status: Status | None
    states: tuple[PointState, ...]
    reports: tuple[StepReport, ...]

    @property
    def finished(self) -> bool:
        """Whether every frame was reported OK."""
        return not self.refusal and self.status is Status.OK

    @property
    def ending(self) -> str:
        """How it ended, in a word: a status, or "refused"."""
        return "refused" if self.refusal else "not begun" if self.status is None else self.status.value


def watch_run(
    subject: Subject, problem: PointProblem, accuracy: EngineAccuracy, times: Sequence[float], grace: int = 0
) -> WatchedRun:
    """Run a problem and collect every contradiction between reports, messages and states.

    Parameters
    ----------
    subject
        The engine.
    problem, accuracy
        What is run.
    times
        Ends of the frames [s], ascending.
    grace
        How many frames in a row may be reported OK though the detector no longer believes them. 0 where the engine
        chooses its own steps; 1 where the suite imposed a step that the engine may have to find out about.

    Raises
    ------
    Undeclared
        Where the engine does not declare what the problem needs.
    """
    declared = subject.descriptor.capabilities.output_fields
    fields = frozenset({Field.POSITIONS} | (declared & {Field.VELOCITIES, Field.DEFORMATION_GRADIENTS}))
    record = _Record(_measure(problem, accuracy, times), accuracy.substep_limit, grace)
    refusal = ""
    try:
        with subject.open(problem, accuracy, fields) as session:
            record.begin(session.read(fields))
            for time in times:
                if not record.advance(session, time, fields):
                    break
    except Undeclared:
        raise
    except GaspError as error:
        refusal = str(error)
        record.faults += _message_faults(f"{type(error).__name__}", refusal)
    except Exception as error:
        record.faults.append(f"raised {type(error).__name__} instead of a GaspError: {' '.join(str(error).split())}")
    return WatchedRun(
        faults=tuple(record.faults),
        refusal=refusal,
        status=record.reports[-1].status if record.reports else None,
        states=tuple(record.states),
        reports=tuple(record.reports),
    )


def _measure(problem: PointProblem, accuracy: EngineAccuracy, times: Sequence[float]) -> Watch:
    """The detector's measure, for clouds of a few points as well, which the core never sees for long.

    Such matter is as large as the cells it is resolved with, whatever its points span. And an affine transfer keeps
    motion below the cell to itself, which no point's velocity shows: of a mass m in a field of speeds |v - v'| <= s
    around it that is m s^2 / 2 at most (Bessel's inequality for the affine functions under the transfer's weights).
    """
    watch = watch_over(problem, float(np.diff([0.0, *times]).min()))
    velocities = problem.points.initial_velocities
    apart = velocities - watch.masses @ velocities / watch.masses.sum()
    hidden = 0.5 * watch.masses.sum() * float((apart**2).sum(axis=1).max())
    return replace(
        watch,
        diagonal=max(watch.diagonal, accuracy.spacing_for(problem.points.size)),
        kinetic_energy=watch.kinetic_energy + hidden,
        # As volume ratios: flat may be what a scene makes of a body, and pass.
        thicknesses=np.full_like(watch.thicknesses, math.inf),
    )


def _within_a_substep(watch: Watch, state: PointState, step: float) -> Watch:
    """The measure with as much more energy as gravity adds within a substep of `step` [s].

    Velocities of a stepping scheme belong to a time half a substep off that of the places, and a wall takes notice
    a substep late: with steps that are not small against the time of the fall, that is no small part of the energy.
    """
    kick = math.hypot(*watch.problem.gravity) * step
    moved = state.positions - watch.problem.points.reference_positions
    fallen = max(released_potential(watch.masses, watch.problem.gravity, moved), 0.0)
    mass = float(watch.masses.sum())
    speed = math.sqrt(2 * (watch.kinetic_energy + fallen) / mass)
    return replace(watch, kinetic_energy=watch.kinetic_energy + mass * kick * (speed + kick / 2))


class _Record:
    """What a run has shown so far."""

    def __init__(self, watch: Watch, substep_limit: int, grace: int) -> None:
        self.faults: list[str] = []
        self.states: list[PointState] = []
        self.reports: list[StepReport] = []
        self._watch = watch
        self._limit = substep_limit
        self._grace = grace
        self._doubted = 0

    def begin(self, state: PointState) -> None:
        """Take the state before the first advance."""
        self.states.append(state)
        self.faults += [f"at the start {fault}" for fault in _state_faults(self._watch.problem, state)]

    def advance(self, session: EngineSession, time: float, fields: frozenset[Field]) -> bool:
        """Advance to `time` [s]; whether the run goes on."""
        before = self.states[-1]
        report = session.advance_to(time)
        self.reports.append(report)
        where = f"on the way to {time:.4g} s"
        self.faults += [f"{where} {fault}" for fault in _report_faults(report, before.time, time, session, self._limit)]
        if report.status is not Status.OK:
            return False
        state = session.read(fields)
        found = _state_faults(self._watch.problem, state)
        if state.time != time:
            found.append(f"the state is that of {state.time!r} s, not of {time!r} s")
        if found:
            self.faults += [f"{where}, reported OK, {fault}" for fault in found]
            return False
        # A volume ratio out of range may be what a scene does to a material; it is not for an engine to refuse.
        watch = _within_a_substep(self._watch, state, report.largest_substep)
        verdict = inspect(watch, before, replace(state, deformation_gradients=None))
        self._doubted = 0 if verdict.status is Status.OK else self._doubted + 1
        if self._doubted > self._grace:
            self.faults.append(f"{where}, reported OK, the detector says {verdict.status.value}: {verdict.reason}")
            return False
        self.states.append(state)
        return True


def _message_faults(what: str, message: str) -> Iterator[str]:
    if not message.strip():
        yield f"{what} gives no reason"
    elif len(message.splitlines()) > 1:
        yield f"{what} says it in {len(message.splitlines())} lines: {message.splitlines()[0]!r}"


def _report_faults(
    report: StepReport, before: float, asked: float, session: EngineSession, limit: int
) -> Iterator[str]:
    """What is wrong with a report in itself, and with where the session says it is."""
    count, small, large = report.substep_count, report.smallest_substep, report.largest_substep
    for warning in report.warnings:
        yield from _message_faults("a warning", warning)
    if count < 0 or count > limit:
        yield f"{count} substeps were taken where at most {limit} were allowed"
    if not (np.isfinite([small, large]).all() and 0 <= small <= large):
        yield f"the smallest substep is {small!r} s and the largest {large!r} s"
    if report.status is not Status.OK:
        if not report.warnings:
            yield f"{report.status.value} comes without a reason"
        if not before <= session.time <= asked:
            yield f"it stopped at {session.time!r} s, which is not between {before!r} s and {asked!r} s"
        return
    if session.time != asked:
        yield f"it landed on {session.time!r} s, not on {asked!r} s"
    span = asked - before
    if not small * count <= span * (1 + _ROUNDING) or not large * count >= span * (1 - _ROUNDING):
        yield f"{count} substeps of {small:.4g} to {large:.4g} s do not make {span:.4g} s"


def _state_faults(problem: PointProblem, state: PointState) -> list[str]:
    """What no state may show."""
    faults: list[str] = []
    count = len(problem.points)
    for name in ("positions", "velocities", "deformation_gradients"):
        array: Array | None = getattr(state, name)
        if array is None:
            continue
        if len(array) != count:
            faults.append(f"{name} are those of {len(array)} points, not of {count}")
            continue
        rows = non_finite_rows(array)
        if len(rows):
            faults.append(f"{name} are not finite in {len(rows)} of {count} points, first {rows[0]}")
    domain = problem.domain
    if domain is not None and domain.policy is not DomainPolicy.EXPAND and not faults and state.time > 0:
        lower, upper = np.asarray(domain.lower), np.asarray(domain.upper)
        room = _ROUNDING * (upper - lower)
        outside = ((state.positions < lower - room) | (state.positions > upper + room)).any(axis=1)
        if outside.any():
            first = int(np.flatnonzero(outside)[0])
            faults.append(
                f'{int(outside.sum())} points are outside a domain with policy "{domain.policy.value}", first {first}'
            )
    return faults
