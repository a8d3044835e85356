"""A session that is held to the contract: what its engine gets wrong is said of that engine, in one line."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import EngineSession, Field, PointProblem, PointState, Status, StepReport
from gasp_core.discovery.loading import one_line
from gasp_core.engines.passing_session import PassingSession
from gasp_core.engines.worker.session import shapes_of
from gasp_core.errors import EngineCrashedError, GaspError

__all__ = ["HeldSession", "held"]

Array = NDArray[Any]

_WHERE = "this is a fault of the engine (set GASP_TRACEBACK=1 to see where)"
_SAME_TIME = 1e-9
"""Relative: how far the time of a state may be from the one asked for."""


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

    A worker of its own process is looked at where its answers are read; engines in this one are only here.

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
        doing = f"advancing to {time:.6g} s"
        report = self._done(lambda: self._session.advance_to(time), doing)
        if not isinstance(report, StepReport) or not isinstance(cast("object", report.status), Status):
            raise self._fault(doing, f"reports {report!r:.60}, which is no StepReport with a Status")
        if isinstance(cast("object", report.warnings), str):
            raise self._fault(doing, "gives a text as warnings, which must be a tuple of them")
        return report

    def read(self, fields: frozenset[Field]) -> PointState:
        """See `EngineSession.read`."""
        doing = f"reading {', '.join(sorted(field.value for field in fields))}"
        state = self._done(lambda: self._session.read(fields), doing)
        if not isinstance(state, PointState):
            raise self._fault(doing, f"gives {state!r:.60}, which is no PointState")
        # What was asked for; what more it gives is looked at by nobody.
        for field in {Field.POSITIONS, *fields} & self._shapes.keys():
            self._look_at(getattr(state, field.value), field, doing)
        now = self.time
        if not math.isclose(state.time, now, rel_tol=_SAME_TIME, abs_tol=1e-12):
            raise self._fault(doing, f"gives a state of {state.time!r} s, where the session is at {now!r} s")
        return state

    def checkpoint(self) -> Mapping[str, Array]:
        """See `EngineSession.checkpoint`."""
        doing = "making a checkpoint"
        found = self._done(self._session.checkpoint, doing)
        if not isinstance(found, Mapping):
            raise self._fault(doing, f"gives {found!r:.60}, which is no mapping of arrays")
        for name, array in cast("Mapping[Any, Any]", found).items():
            if not isinstance(name, str) or np.asarray(array).dtype.hasobject:
                raise self._fault(doing, f"gives {array!r:.60} as {name!r:.60}, which is no array of numbers")
        return cast("Mapping[str, Array]", found)

    def _look_at(self, values: object, field: Field, doing: str) -> None:
        if not isinstance(values, np.ndarray):
            raise self._fault(doing, f"gives {values!r:.60} as {field.value}, which is no array")
        array = cast("Array", values)
        # float16 has too few digits for places, and LAPACK none for it.
        if array.shape != self._shapes[field] or array.dtype.kind != "f" or array.itemsize < 4:
            raise self._fault(
                doing,
                f"gives {field.value} of shape {array.shape} and type {array.dtype}, expected {self._shapes[field]} of"
                " float32 or float64",
            )

    def _done(self, call: Callable[[], object], doing: str) -> object:
        try:
            return call()
        except GaspError:
            raise
        except SystemExit as error:
            raise self._fault(doing, f"tries to exit the program (status {error.code!r})") from error
        except Exception as error:
            raise EngineCrashedError(f"{self._engine} failed while {doing}: {one_line(error)}; {_WHERE}") from error

    def _fault(self, doing: str, what: str) -> EngineCrashedError:
        return EngineCrashedError(f"{self._engine} {what}, while {doing}: this is a fault of the engine")
