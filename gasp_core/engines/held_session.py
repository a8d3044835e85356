"""A session that is held to the contract: what its engine gets wrong is said of that engine, in one line."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineSession, Field, PointProblem, PointState, StepReport
from gasp_core.discovery.loading import one_line
from gasp_core.engines.contract_faults import (
    ContractFault,
    checked_checkpoint,
    checked_report,
    checked_state,
    fault_told,
    shapes_of,
)
from gasp_core.engines.passing_session import PassingSession
from gasp_core.errors import EngineCrashedError, GaspError

__all__ = ["HeldSession", "held"]

Array = NDArray[Any]
T = TypeVar("T")

_WHERE = "this is a fault of the engine (set GASP_TRACEBACK=1 to see where)"


def held(opening: Callable[[], EngineSession], engine: str, problem: PointProblem) -> EngineSession:
    """A session that is opened, whatever happens meanwhile, in the folder that one is in, and held to the contract.

    Raises
    ------
    EngineCrashedError
        Where the engine raises what is none of GASP's errors.
    """
    try:
        # An engine that goes elsewhere takes along what is written by relative paths.
        with contextlib.chdir("."):
            session = opening()
    except (GaspError, ImportError):
        # An engine may import its backend only now: whoever opens it says what is to be installed.
        raise
    except SystemExit as error:
        raise EngineCrashedError(
            f"{engine} tries to exit the program while it is opened (status {error.code!r})"
        ) from error
    except Exception as error:
        raise EngineCrashedError(f"{engine} failed while it was opened: {one_line(error)}; {_WHERE}") from error
    return HeldSession(session, engine, problem)


class HeldSession(PassingSession):
    """An `EngineSession` that passes everything on, and looks at what comes back.

    What is wrong in a worker of its own is told there already, in the same words; see `contract_faults`.

    Parameters
    ----------
    session
        Of the engine.
    engine
        Its name.
    problem
        What it was opened with.
    """

    def __init__(self, session: EngineSession, engine: str, problem: PointProblem) -> None:
        super().__init__(session)
        self._engine = engine
        # Whatever is declared: what is asked for and missing is told of as that.
        self._shapes = shapes_of(problem, frozenset(Field))

    def advance_to(self, time: float) -> StepReport:
        """See `EngineSession.advance_to`."""
        return self._held(f"advancing to {time:.6g} s", lambda: checked_report(self._session.advance_to(time)))

    def read(self, fields: frozenset[Field]) -> PointState:
        """See `EngineSession.read`; what is of another precision or order is converted."""
        return self._held(
            f"reading {', '.join(sorted(field.value for field in fields))}",
            lambda: _converted(checked_state(self._session.read(fields), fields, self._shapes, self.time), fields),
        )

    def checkpoint(self) -> Mapping[str, Array]:
        """See `EngineSession.checkpoint`."""
        return self._held("making a checkpoint", lambda: checked_checkpoint(self._session.checkpoint()))

    def _held(self, doing: str, call: Callable[[], T]) -> T:
        try:
            return call()
        except GaspError:
            raise
        except ContractFault as fault:
            raise EngineCrashedError(f"{self._engine} {fault_told(fault, doing)}") from None
        except SystemExit as error:
            exits = f"tries to exit the program (status {error.code!r})"
            raise EngineCrashedError(f"{self._engine} {fault_told(exits, doing)}") from error
        except Exception as error:
            raise EngineCrashedError(f"{self._engine} failed while {doing}: {one_line(error)}; {_WHERE}") from error


def _converted(state: PointState, fields: frozenset[Field]) -> PointState:
    """The same with these fields as float64 and C-contiguous arrays, copied only where they are not."""
    names = [field.value for field in {Field.POSITIONS, *fields} if getattr(state, field.value) is not None]
    wanted = {name: np.ascontiguousarray(getattr(state, name), dtype=np.float64) for name in names}
    other = {name: array for name, array in wanted.items() if array is not getattr(state, name)}
    return replace(state, **other) if other else state
