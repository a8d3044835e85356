"""An engine behind the usual contract that works in a process of its own."""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core import errors
from gasp_core.engine.contract import (
    EngineAccuracy,
    EngineDescriptor,
    EngineSession,
    Field,
    PointProblem,
    PointState,
    Precision,
    StepReport,
)
from gasp_core.engine.worker import start
from gasp_core.engine.worker.lending import lent_for, loans
from gasp_core.engine.worker.lines import Message
from gasp_core.engine.worker.parcels import Block
from gasp_core.engine.worker.process import WorkerProcess
from gasp_core.engine.worker.recycling import Recycling
from gasp_core.engine.worker.wire import from_plain, to_plain
from gasp_core.errors import EngineCrashedError, EngineDivergedError, EngineEnvironmentError

_CLOSING = 5.0
"""Seconds a session may take to close before its process is killed."""

__all__ = ["Interpreter", "Limits", "WorkerEngine", "own_interpreter"]

Array = NDArray[Any]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Interpreter:
    """A Python that workers run in.

    Parameters
    ----------
    python
        The executable.
    path
        Its import path; None: its own.
    """

    python: Path
    path: tuple[str, ...] | None


def own_interpreter() -> Interpreter:
    """The Python of this process, with what can be imported here."""
    return Interpreter(
        python=Path(sys.executable), path=tuple(entry and str(Path(entry).absolute()) for entry in sys.path)
    )


class WorkerEngine:
    """A `PointEngine` whose sessions are each in a process of their own.

    The process of a closed session is kept for the next one, as long as the engine itself is: some backends take half a
    minute to import.

    Parameters
    ----------
    descriptor
        The engine.
    interpreter
        The Python to run it in.
    remedy
        What the user can do where its code, or the backend it stands on, cannot be imported there.
    limits
        How long to wait.
    """

    def __init__(
        self, descriptor: EngineDescriptor, interpreter: Interpreter, remedy: str, limits: Limits | None = None
    ) -> None:
        self._descriptor = descriptor
        self._interpreter = interpreter
        self._remedy = remedy
        self._limits = limits or Limits()
        self._idle: list[WorkerProcess] = []
        # Called at exit too.
        weakref.finalize(self, _end_all, self._idle)

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any = None,
        restart: Mapping[str, Array] | None = None,
    ) -> EngineSession:
        """Set a problem up in a worker.

        Raises
        ------
        EngineEnvironmentError
            Where the worker cannot be started, or the options cannot be sent to it.
        EngineCrashedError
            Where it dies, hangs, or fails with an error that is not one of GASP's.
        GaspError, ValueError
            What the engine itself raises.
        """
        arguments = {
            "problem": problem,
            "device": device,
            "precision": precision,
            "seed": seed,
            "accuracy": accuracy,
            "options": options,
            "restart": restart,
        }
        arrays: dict[str, Array] = {}
        try:
            plain = to_plain(arguments, arrays)
        except TypeError as error:
            raise EngineEnvironmentError(f'engine "{self._descriptor.name}": {error}') from error
        worker = self._idle.pop() if self._idle else self._started()
        try:
            message = {
                "do": "open",
                "factory": self._descriptor.factory,
                "remedy": self._remedy,
                "arguments": plain,
                "layout": worker.block.pack(arrays),
            }
            opened = _answered(worker, message, "opening the scene", self._limits.opening)
        except BaseException:
            self.take_back(worker)
            raise
        return _WorkerSession(worker, opened["time"], self._limits, weakref.ref(self))

    def probe(self) -> None:
        """Start a worker and end it.

        Raises
        ------
        EngineEnvironmentError, EngineCrashedError
            Where that fails.
        """
        self._started().end()

    def take_back(self, worker: WorkerProcess) -> None:
        """Keep a worker that is done with its session, if it is of any more use."""
        if worker.is_idle:
            self._idle.append(worker)
        else:
            worker.end()

    def _started(self) -> WorkerProcess:
        name = self._descriptor.name
        if os.name != "posix":
            raise EngineEnvironmentError(f'engine "{name}": workers need Linux or macOS, and this is {sys.platform}')
        block = Block.make()
        settings = {
            "block": block.descriptor,
            "path": self._interpreter.path,
            "loans": loans(lent_for(self._descriptor)),
            # The system takes the death of the thread that started a process for that of the parent.
            "dies_with_parent": threading.current_thread() is threading.main_thread(),
        }
        flags = ["-I", "-u", *(["-B"] if sys.dont_write_bytecode else [])]
        command = [str(self._interpreter.python), *flags, str(Path(start.__file__)), json.dumps(settings)]
        try:
            worker = WorkerProcess(name, command, block)
        except BaseException:
            block.close()
            raise
        try:
            worker.greet(self._limits.opening)
        except BaseException:
            worker.end()
            raise
        return worker


class _WorkerSession:
    """A session whose engine is elsewhere."""

    def __init__(self, worker: WorkerProcess, time: float, limits: Limits, engine: weakref.ref[WorkerEngine]) -> None:
        self._worker: WorkerProcess | None = worker
        self._time = time
        self._limits = limits
        self._engine = engine
        self._memory = Recycling()
        self._finalizer = weakref.finalize(self, worker.end)  # where nobody closes it

    @property
    def time(self) -> float:
        return self._time

    def advance_to(self, time: float) -> StepReport:
        words = f"advancing to {time:.6g} s" if math.isfinite(time) else "refusing a time"
        done = self._asked({"do": "advance", "time": float(time)}, words)
        self._time = done["time"]
        return from_plain(done["report"], {})

    def read(self, fields: frozenset[Field]) -> PointState:
        words = sorted(field.value for field in fields)
        done = self._asked({"do": "read", "fields": words}, f"reading {', '.join(words)}")
        return PointState(time=done["time"], **self._unpacked(done, self._memory.empty))

    def checkpoint(self) -> Mapping[str, Array]:
        return self._unpacked(self._asked({"do": "checkpoint"}, "making a checkpoint"))

    def close(self) -> None:
        worker, self._worker = self._worker, None
        if worker is None:
            return
        engine = self._engine()
        try:
            if engine is not None and worker.is_idle:
                _answered(worker, {"do": "close"}, "closing", _CLOSING)
        except EngineCrashedError:
            # All that was asked for has been given: how it dies now is nobody's concern, as backends crash at exit.
            worker.log.unlink(missing_ok=True)
        finally:
            self._finalizer.detach()
            if engine is not None:
                engine.take_back(worker)
            else:
                worker.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _asked(self, message: Message, doing: str) -> Any:
        if self._worker is None:
            raise ValueError("the session is closed")
        return _answered(self._worker, message, doing, self._limits.frame)

    def _unpacked(self, done: Message, empty: Callable[[tuple[int, ...], Any], Array] = np.empty) -> dict[str, Array]:
        assert self._worker is not None
        try:
            return self._worker.block.unpack(done["layout"], empty)
        except (TypeError, ValueError) as error:
            raise self._worker.crash(f"sent arrays that are not there ({error})") from error


def _answered(worker: WorkerProcess, message: Message, doing: str, limit: float) -> Any:
    """What a worker answers, or the error it met, raised here."""
    answer = worker.ask(message, doing, limit)
    failed = answer.get("failed")
    if failed is None:
        return answer["done"]
    kind, words = failed["kind"], failed["words"]
    if kind is None:
        raise worker.crash(f"failed while {doing}: {words}")
    if kind == "ValueError":
        raise ValueError(words)
    if kind == EngineDivergedError.__name__:
        raise EngineDivergedError(words, from_plain(failed["report"], {}))
    raise getattr(errors, kind)(words)


def _end_all(workers: Sequence[WorkerProcess]) -> None:
    for worker in workers:
        worker.end()
