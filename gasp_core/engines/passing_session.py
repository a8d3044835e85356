"""A session that passes everything on to another one: those that look at something on the way derive from it."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from numpy.typing import NDArray

from gasp_core.contract import EngineSession, Field, PointState, StepReport

__all__ = ["PassingSession"]

Array = NDArray[Any]


class PassingSession:
    """An `EngineSession` that does what another one does.

    Parameters
    ----------
    session
        The other one.
    """

    def __init__(self, session: EngineSession) -> None:
        self._session = session

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._session.time

    def advance_to(self, time: float) -> StepReport:
        """See `EngineSession.advance_to`."""
        return self._session.advance_to(time)

    def read(self, fields: frozenset[Field]) -> PointState:
        """See `EngineSession.read`."""
        return self._session.read(fields)

    def checkpoint(self) -> Mapping[str, Array]:
        """See `EngineSession.checkpoint`."""
        return self._session.checkpoint()

    def close(self) -> None:
        """End the session."""
        self._session.close()

    def __enter__(self) -> Self:
        self._session.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self._session.__exit__(kind, error, trace)
