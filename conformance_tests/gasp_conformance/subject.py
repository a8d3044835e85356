"""The engine that is looked at, as seen through the contract and through nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from gasp_core.contract import (
    Determinism,
    EngineAccuracy,
    EngineDescriptor,
    EngineSession,
    Field,
    PointEngine,
    PointProblem,
    PointState,
    Precision,
    Status,
    StepReport,
)
from gasp_core.contract.capabilities import needs, unmet
from gasp_core.discovery.registry import EngineOffer, discover
from gasp_core.engines.opening import open_engine, open_worker
from gasp_core.errors import EngineDivergedError, UnsupportedSceneError
from gasp_core.simulation.monitor import non_finite_rows

__all__ = ["Journal", "Need", "Subject", "Undeclared", "find_subject", "finite_state", "isolated_subject"]


Need = Callable[[bool, str], None]
"""Ends a check as undeclared unless the engine declares what it is about: whether it does, and what that is."""


class Undeclared(UnsupportedSceneError):
    """The engine says itself that it does not do what a case needs: no reason to fail it, and none to run the case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """An engine, and the device and the precision it is run in.

    Parameters
    ----------
    distribution
        That brings it; "" where none does.
    """

    descriptor: EngineDescriptor
    engine: PointEngine
    device: str
    precision: Precision
    distribution: str = ""

    @property
    def name(self) -> str:
        """As users write it."""
        return self.descriptor.name

    @property
    def determinism(self) -> Determinism:
        """How far a second run agrees on this device: what is declared is promised on the engine's first alone."""
        can = self.descriptor.capabilities
        return can.determinism if self.device == can.devices[0] else Determinism.TOLERANCE

    @property
    def is_double(self) -> bool:
        """Whether its state is float64."""
        return self.precision is Precision.FLOAT64

    def open(
        self, problem: PointProblem, accuracy: EngineAccuracy, fields: frozenset[Field] = frozenset()
    ) -> EngineSession:
        """A session with the engine's default options, to read `fields` from.

        Raises
        ------
        Undeclared
            Where the engine does not declare what the problem or a field needs.
        """
        missing = unmet(needs(problem, fields=fields), self.descriptor.capabilities)
        if missing:
            raise Undeclared(f"{self.name} {', '.join(dict.fromkeys(need.refusal for need in missing))}")
        options = self.descriptor.options
        return self.engine.open(
            problem,
            device=self.device,
            precision=self.precision,
            seed=0,
            accuracy=accuracy,
            options=None if options is None else options(),
        )

    def states(
        self,
        problem: PointProblem,
        accuracy: EngineAccuracy,
        times: Iterable[float],
        fields: Iterable[Field] = (),
        journal: Journal | None = None,
    ) -> Iterator[PointState]:
        """States at `times` [s], positions and `fields`; what the engine reported goes into `journal`.

        Raises
        ------
        Undeclared
            As `open`.
        EngineDivergedError
            Where an advance does not end well: every case of the suite is one an engine has to finish.
        AssertionError
            Where what is read is not finite.
        """
        wanted = frozenset(fields) | {Field.POSITIONS}
        with self.open(problem, accuracy, wanted) as session:
            for time in times:
                report = session.advance_to(time)
                if report.status is not Status.OK:
                    reason = "; ".join(report.warnings) or "no reason given"
                    raise EngineDivergedError(
                        f"{self.name} ended with {report.status.value} before {time:.6g} s: {reason}", report
                    )
                if journal is not None:
                    journal.reports.append(report)
                yield finite_state(session, wanted)


@dataclass(slots=True)
class Journal:
    """What an engine reported on its way."""

    reports: list[StepReport] = field(default_factory=list)

    @property
    def substep_count(self) -> int:
        """Substeps of all advances."""
        return sum(report.substep_count for report in self.reports)

    @property
    def largest_substep(self) -> float:
        """Of all advances [s]."""
        return max(report.largest_substep for report in self.reports)


def finite_state(session: EngineSession, fields: frozenset[Field]) -> PointState:
    """What a session shows where nothing has gone wrong.

    A NaN is neither above a bound nor the larger of two numbers, and bit for bit it is equal to itself: no figure would
    show it.

    Raises
    ------
    AssertionError
        Where what is read is not finite.
    """
    state = session.read(fields)
    for what, rows in (
        ("point", non_finite_rows(state.positions, state.velocities, state.deformation_gradients)),
        ("tracer", non_finite_rows(state.tracer_positions)),
    ):
        assert not len(rows), f"what is shown at {state.time:.6g} s is not finite, first in {what} {rows[0]}"
    return state


def find_subject(name: str, precision: Precision | None, device: str | None) -> Subject:
    """The installed engine of that name, as asked or by the engine's own first choices; raises as below."""
    return _subject(name, precision, device, open_engine)


def isolated_subject(name: str, precision: Precision | None, device: str | None) -> Subject:
    """The same, with every session in a process of its own; raises as below, and EngineEnvironmentError."""
    return _subject(name, precision, device, open_worker)


def _subject(
    name: str, precision: Precision | None, device: str | None, opening: Callable[[EngineOffer], PointEngine]
) -> Subject:
    """An installed engine, once it is known to run in that precision and on that device.

    Raises
    ------
    UnknownEngineError
        Where nothing installed offers it.
    UnsupportedSceneError
        Where it does not run in that precision or on that device, or declares none of either.
    """
    offer = discover().offer(name)
    can = offer.descriptor.capabilities
    offered = can.precisions
    if not offered or not can.devices:
        raise UnsupportedSceneError(f"{name} declares no precision or no device: name at least one of each")
    if precision is not None and precision not in offered:
        known = ", ".join(one.value for one in offered)
        raise UnsupportedSceneError(f"{name} does not run in {precision.value}; it runs in {known}")
    if device is not None and device not in can.devices:
        raise UnsupportedSceneError(f'{name} does not run on device "{device}"; it runs on {", ".join(can.devices)}')
    return Subject(
        descriptor=offer.descriptor,
        engine=opening(offer),
        device=can.devices[0] if device is None else device,
        precision=precision or offered[0],
        distribution=offer.distribution,
    )
