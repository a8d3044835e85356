"""How they advance: times, frames and reports that are not what they say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gasp_reference_mpm.engine import ReferenceMpm
from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, EngineSession, Field, PointProblem, PointState, Status, StepReport
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


class Stopping(Session):
    def advance_to(self, time: float) -> StepReport:
        return self.inner.advance_to(max(self.inner.time, _whole(time)))


def _whole(time: float) -> float:
    """Down to a millisecond."""
    return np.floor(time * 1000) / 1000


@mutant("stops-short", {"lands-on-time": "asked for"})
class StopsShort(Mutant):
    """It stops at the last whole millisecond, and says so."""

    session = Stopping


class Pretending(Stopping):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.asked = self.inner.time

    @property
    def time(self) -> float:
        return self.asked

    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        self.asked = time
        return report

    def read(self, fields: frozenset[Field]) -> PointState:
        return replace(self.inner.read(fields), time=self.asked)


@mutant("pretends-to-land", {"lands-on-time": r"largest error \[m\]"})
class PretendsToLand(Mutant):
    """It stops at the last whole millisecond, and says it went on."""

    session = Pretending


class Differing(Session):
    def advance_to(self, time: float) -> StepReport:
        before, span = self.inner.checkpoint()["positions"], time - self.time
        report = super().advance_to(time)
        if span > 0:
            self.change(velocities=(self.inner.checkpoint()["positions"] - before) / span)
        return report


@mutant(
    "velocities-by-difference",
    {"lands-on-time": r"at 1e-06 s, after steps down to 2.1e-25 s: largest error \[m\]"},
)
class VelocitiesByDifference(Mutant):
    """Velocities are the difference of places over the time between, however short that is."""

    session = Differing


class GoingBack(Session):
    def advance_to(self, time: float) -> StepReport:
        if not time < self.time:
            return super().advance_to(time)
        return StepReport(status=Status.OK, substep_count=0, smallest_substep=0.0, largest_substep=0.0)


@mutant("past-accepted", {"lifecycle": "DID NOT RAISE"})
class PastAccepted(Mutant):
    """An advance into the past does nothing and is fine."""

    session = GoingBack


class OneStep(Session):
    def advance_to(self, time: float) -> StepReport:
        span = time - self.time
        report = super().advance_to(time)
        if report.substep_count == 0:
            return report
        return replace(report, substep_count=1, smallest_substep=span, largest_substep=span)


@mutant("substeps-misreported", {"substep-obeyed": "substeps of time in"})
class SubstepsMisreported(Mutant):
    """Every advance is reported as one step."""

    session = OneStep


class Stuttering(Session):
    def advance_to(self, time: float) -> StepReport:
        if time > self.time:
            self.change(affine_velocities=np.zeros((len(self.problem.points), 3, 3)))
        return super().advance_to(time)


@mutant("frames-leave-traces", {"split-advance": "1 advance from 40"})
class FramesLeaveTraces(Mutant):
    """Points forget their affine velocities at every frame."""

    session = Stuttering


class Disturbed(Session):
    def read(self, fields: frozenset[Field]) -> PointState:
        state = self.inner.read(fields)
        if self.time > 0:
            self.change(affine_velocities=np.zeros((len(self.problem.points), 3, 3)))
        return state


@mutant("reading-disturbs", {"determinism": "bit for bit"})
class ReadingDisturbs(Mutant):
    """Looking at a run changes how it goes on."""

    session = Disturbed


class Counting(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.counted = self.inner.time

    @property
    def time(self) -> float:
        return self.counted

    def advance_to(self, time: float) -> StepReport:
        before = self.inner.time
        report = super().advance_to(time)
        for _ in range(report.substep_count):
            self.counted += (time - before) / report.substep_count
        return report


@mutant("time-added-up", {"lands-on-time": "it is at"})
class TimeAddedUp(Mutant):
    """Its time is the sum of its substeps."""

    session = Counting


class Heating(Session):
    RATE = 1e-3
    """[1/s]"""

    def advance_to(self, time: float) -> StepReport:
        span = time - self.time
        report = super().advance_to(time)
        if report.substep_count:
            velocities = self.inner.checkpoint()["velocities"]
            mean = velocities.mean(axis=0)
            self.change(velocities=mean + (velocities - mean) * np.exp(self.RATE * span))
        return report


@mutant("energy-grows", {"long-run": "inner energy"})
class EnergyGrows(Mutant):
    """What moves within a body moves faster by a thousandth a second."""

    session = Heating


class Boiling(Heating):
    RATE = 3.0


@mutant("energy-boils", {"kinetic-energy[sand]": r"largest / \(start \+ released\)"})
class EnergyBoils(Mutant):
    """What moves within a body moves faster at every frame."""

    session = Boiling


class StartingFlat(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        if self.inner.time == 0:
            self.change(affine_velocities=np.zeros((len(self.problem.points), 3, 3)))


@mutant("spin-hidden", {"conserved:angular_momentum": "relative change", "V8[4 cells]": "spin kept is"})
class SpinHidden(Mutant):
    """Points start without affine velocities, which then swallow angular momentum that is declared to be conserved."""

    session = StartingFlat


class StartingAnew(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.since = 0.0

    @property
    def time(self) -> float:
        return self.since + self.inner.time

    def advance_to(self, time: float) -> StepReport:
        report = self.inner.advance_to(time - self.since)
        if report.status is not Status.OK:
            self.inner = self.opened(None)
            self.since = time
        return replace(report, status=Status.OK, warnings=())

    def read(self, fields: frozenset[Field]) -> PointState:
        return replace(self.inner.read(fields), time=self.time)


@mutant(
    "resets-in-silence",
    {"unstable-substep": "frames of nonsense untold|do not make", "random-scenes": "of 40 scenes"},
    slow=["random-scenes"],
)
class ResetsInSilence(Mutant):
    """Any fixed substep is taken, and what blows up begins anew, as if nothing had been."""

    session = StartingAnew

    def open(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None = None,
        **choices: Any,
    ) -> Session:
        def opened(checkpoint: Mapping[str, Array] | None) -> EngineSession:
            session = ReferenceMpm().open(
                problem, accuracy=replace(accuracy, substep=None), restart=checkpoint, **choices
            )
            # Past the right engine's refusal of a substep above the bound.
            session._accuracy = accuracy
            return session

        return self.session(opened, restart, self, problem)
