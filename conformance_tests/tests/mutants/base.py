"""The reference engine with openings for a fault, and the catalogue of those that have one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Any, ClassVar, Self, TypeVar

from gasp_reference_mpm.engine import ReferenceMpm
from gasp_reference_mpm.plugin import CAPABILITIES
from numpy.typing import NDArray

from gasp_core.contract import (
    EngineAccuracy,
    EngineCapabilities,
    EngineSession,
    Field,
    PointProblem,
    PointState,
    StepReport,
)

__all__ = ["MUTANTS", "Mutant", "Session", "mutant"]

Array = NDArray[Any]
Opener = Callable[[Mapping[str, Array] | None], EngineSession]
Kind = TypeVar("Kind", bound="type[Mutant]")


class Session:
    """A right session. A subclass overrides what it gets wrong.

    Parameters
    ----------
    opened
        Opens the right session, from a checkpoint or from the start.
    restart
        The checkpoint to begin with.
    engine, problem
        Where it comes from.
    """

    def __init__(
        self, opened: Opener, restart: Mapping[str, Array] | None, engine: Mutant, problem: PointProblem
    ) -> None:
        self.opened = opened
        self.engine = engine
        self.problem = problem
        self.inner = opened(restart)

    @property
    def time(self) -> float:
        return self.inner.time

    def advance_to(self, time: float) -> StepReport:
        return self.inner.advance_to(time)

    def read(self, fields: frozenset[Field]) -> PointState:
        return self.inner.read(fields)

    def view(self, field: Field) -> Any:
        return self.inner.view(field)

    def checkpoint(self) -> Mapping[str, Array]:
        return self.inner.checkpoint()

    def close(self) -> None:
        self.inner.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def change(self, **arrays: Array) -> None:
        """Go on with other numbers than the right session had."""
        self.inner = self.opened({**self.inner.checkpoint(), **arrays})


class Mutant:
    """The right engine. A subclass overrides what it gets wrong; its docstring says what that is.

    Attributes
    ----------
    caught_by
        Names of checks that have to fail, and a pattern within what they say. It begins with "raised" where the
        engine's own error ends the check.
    slow
        Those of them that take more than a few seconds.
    right_can
        Whether the right engine declares what those are about.
    device
        The one on which they have to fail; None for its first.
    """

    name: ClassVar[str]
    caught_by: ClassVar[Mapping[str, str]]
    slow: ClassVar[Sequence[str]] = ()
    right_can: ClassVar[bool] = True
    device: ClassVar[str | None] = None
    declares: ClassVar[EngineCapabilities] = CAPABILITIES
    session: ClassVar[type[Session]] = Session

    def problem(self, problem: PointProblem) -> PointProblem:
        """The problem as the engine understands it."""
        return problem

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        """The knobs as the engine understands them."""
        return accuracy

    def open(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None = None,
        **choices: Any,
    ) -> Session:
        def opened(checkpoint: Mapping[str, Array] | None) -> EngineSession:
            return ReferenceMpm().open(
                self.problem(problem), accuracy=self.accuracy(accuracy, problem), restart=checkpoint, **choices
            )

        return self.session(opened, restart, self, problem)


MUTANTS: dict[str, type[Mutant]] = {}


def mutant(name: str, caught_by: Mapping[str, str], *, slow: Sequence[str] = ()) -> Callable[[Kind], Kind]:
    """Enter a mutant into the catalogue."""

    def enter(kind: Kind) -> Kind:
        kind.name, kind.caught_by, kind.slow = name, caught_by, slow
        MUTANTS[name] = kind
        return kind

    return enter
