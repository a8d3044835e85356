"""A session whose engine works in another process."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Field, PointState, StepReport
from gasp_core.engines.contract_faults import ContractFault, fault_told
from gasp_core.engines.worker import replies
from gasp_core.engines.worker.buffer_pool import Recycling
from gasp_core.engines.worker.process import WorkerProcess
from gasp_core.engines.worker.shared_memory import Layout
from gasp_core.engines.worker.transport import Message
from gasp_core.errors import EngineCrashedError

__all__ = ["Limits", "WorkerSession", "answered"]

Array = NDArray[Any]
T = TypeVar("T")

_CLOSING = 5.0
"""Seconds a session may take to close before its process is killed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """How long a worker may take [s] before it is given up.

    Parameters
    ----------
    opening
        To start, import the backend and set the scene up.
    frame
        To advance to a time, and to show what it has come to.
    """

    opening: float = 900.0
    frame: float = 3600.0


class WorkerSession:
    """An `EngineSession` that passes everything on.

    Parameters
    ----------
    worker
        In which it has been opened.
    time
        It is at [s].
    shapes
        Of what can be read out, see `gasp_core.engines.contract_faults.shapes_of`.
    limits
        How long to wait.
    take_back
        Given the worker when the session is closed; where its object is no more, the worker is ended.
    """

    def __init__(
        self,
        worker: WorkerProcess,
        time: float,
        shapes: Mapping[Field, tuple[int, ...]],
        limits: Limits,
        take_back: weakref.WeakMethod[Callable[[WorkerProcess], None]],
    ) -> None:
        self._worker: WorkerProcess | None = worker
        self._time = time
        self._shapes = shapes
        self._limits = limits
        self._take_back = take_back
        self._memory = Recycling()
        self._finalizer = weakref.finalize(self, worker.end)  # where nobody closes it

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    def advance_to(self, time: float) -> StepReport:
        """See `EngineSession.advance_to`."""
        words = f"advancing to {time:.6g} s" if math.isfinite(time) else "refusing a time"
        self._time, report = self._asked({"do": "advance", "time": float(time)}, words, _advanced)
        return report

    def read(self, fields: frozenset[Field]) -> PointState:
        """See `EngineSession.read`."""
        words = sorted(field.value for field in fields)
        # Positions are read always, and what the session does not have never.
        shapes = {field.value: self._shapes[field] for field in {*fields, Field.POSITIONS} & self._shapes.keys()}
        time, layout = self._asked(
            {"do": "read", "fields": words},
            f"reading {', '.join(words)}",
            lambda done: (replies.time(done), replies.expected_layout(done, shapes)),
        )
        return PointState(time=time, **self._unpacked(layout, self._memory.empty))

    def checkpoint(self) -> Mapping[str, Array]:
        """See `EngineSession.checkpoint`."""
        return self._unpacked(self._asked({"do": "checkpoint"}, "making a checkpoint", replies.any_layout))

    def close(self) -> None:
        """End the session; its worker is kept or ended. May be called twice."""
        worker, self._worker = self._worker, None
        if worker is None:
            return
        take_back = self._take_back()
        try:
            if take_back is not None and worker.is_idle:
                answered(worker, {"do": "close"}, "closing", replies.nothing, _CLOSING)
        except EngineCrashedError:
            # All that was asked for has been given: how it dies now is nobody's concern, as backends crash at exit.
            worker.discard_log()
        finally:
            self._finalizer.detach()
            if take_back is not None:
                take_back(worker)
            else:
                worker.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _asked(self, message: Message, doing: str, read: Callable[[Any], T]) -> T:
        if self._worker is None:
            raise ValueError("the session is closed")
        return answered(self._worker, message, doing, read, self._limits.frame, "set a longer frame_limit")

    def _unpacked(self, layout: Layout, empty: Callable[[tuple[int, ...], Any], Array] = np.empty) -> dict[str, Array]:
        assert self._worker is not None
        try:
            return self._worker.block.unpack(layout, empty)
        except (TypeError, ValueError) as error:
            raise self._worker.crash(f"sent arrays that are not there ({error})") from error


def answered(
    worker: WorkerProcess, message: Message, doing: str, read: Callable[[Any], T], limit: float, remedy: str = ""
) -> T:
    """What a worker answers, or the error it met, raised here.

    Parameters
    ----------
    worker, message, doing, limit, remedy
        As of `WorkerProcess.ask`.
    read
        Makes of the answer what is returned; ValueError where it is none.

    Raises
    ------
    EngineCrashedError
        As `WorkerProcess.ask`, and where what was answered is no answer.
    GaspError, ValueError
        What the engine raised.
    """
    answer = worker.ask(message, doing, limit, remedy)
    try:
        if "failed" not in answer:
            return read(answer.get("done"))
        failed = replies.failure(answer["failed"])
    except ValueError as error:
        raise worker.crash(f"sent what is no answer while {doing} ({error})") from None
    if isinstance(failed, ContractFault):
        raise worker.crash(fault_told(failed, doing))
    if isinstance(failed, str):
        raise worker.crash(f"failed while {doing}: {failed}")
    raise failed


def _advanced(done: Any) -> tuple[float, StepReport]:
    return replies.time(done), replies.report(done.get("report"))
