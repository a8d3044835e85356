"""An engine behind the usual contract that works in a process of its own."""

from __future__ import annotations

import json
import os
import sys
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from gasp_core.contract import EngineAccuracy, EngineDescriptor, EngineSession, PointProblem, Precision
from gasp_core.engines.contract_faults import shapes_of
from gasp_core.engines.worker import bootstrap, replies
from gasp_core.engines.worker.package_paths import lent_for, loans
from gasp_core.engines.worker.process import WorkerProcess
from gasp_core.engines.worker.serialization import to_plain
from gasp_core.engines.worker.session import Limits, WorkerSession, answered
from gasp_core.engines.worker.shared_memory import Block
from gasp_core.errors import EngineEnvironmentError

__all__ = ["Interpreter", "WorkerEngine", "own_interpreter"]

Array = NDArray[Any]

_COMPILING = "try it once more: what a backend compiles the first time it may keep"


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

    def surroundings(self) -> dict[str, str]:
        """Environment variables for it: those that steer the Python of this process would mislead another one."""
        own = self.path is not None
        return {key: value for key, value in os.environ.items() if own or not key.startswith("PYTHON")}


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
            time = answered(worker, message, "opening the scene", replies.time, self._limits.opening, _COMPILING)
        except BaseException:
            self.take_back(worker)
            raise
        shapes = shapes_of(problem, self._descriptor.capabilities.output_fields)
        return WorkerSession(worker, time, shapes, self._limits, weakref.WeakMethod(self.take_back))

    def probe(self) -> None:
        """Start a worker and end it.

        Raises
        ------
        EngineEnvironmentError, EngineCrashedError
            Where that fails.
        """
        self._started().end()

    def load(self) -> None:
        """Import the engine's code in a worker, make the engine there, and end the worker.

        Raises
        ------
        PluginLoadError
            Where its code, or the backend it stands on, cannot be imported, or what is made is no engine.
        EngineEnvironmentError, EngineCrashedError
            As `open`.
        """
        worker = self._started()
        try:
            message = {"do": "load", "factory": self._descriptor.factory, "remedy": self._remedy}
            answered(worker, message, "loading its code", replies.nothing, self._limits.opening, _COMPILING)
        finally:
            worker.end()

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
        }
        flags = ["-I", "-u", *(["-B"] if sys.dont_write_bytecode else [])]
        command = [str(self._interpreter.python), *flags, str(Path(bootstrap.__file__)), json.dumps(settings)]
        try:
            worker = WorkerProcess(name, command, self._interpreter.surroundings(), block)
        except BaseException:
            block.close()
            raise
        try:
            worker.greet(self._limits.opening)
        except BaseException:
            worker.end()
            raise
        return worker


def _end_all(workers: Sequence[WorkerProcess]) -> None:
    for worker in workers:
        worker.end()
