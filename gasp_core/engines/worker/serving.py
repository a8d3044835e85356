"""The worker's side: opens sessions, one after the other, and does what it is told with them."""

from __future__ import annotations

import platform
import traceback
from collections.abc import Mapping
from typing import Any, BinaryIO, cast

import numpy as np

from gasp_core import errors
from gasp_core.contract import EngineSession, Field, PointEngine
from gasp_core.discovery.loading import attribute_at, contained, one_line
from gasp_core.engines.contract_faults import (
    ContractFault,
    checked_checkpoint,
    checked_report,
    checked_state,
    shapes_of,
)
from gasp_core.engines.worker.serialization import from_plain, to_plain
from gasp_core.engines.worker.shared_memory import Block
from gasp_core.engines.worker.transport import PROTOCOL, Inbox, Message, send
from gasp_core.errors import EngineDivergedError, GaspError, PluginLoadError

__all__ = ["serve"]


def serve(inbox: Inbox, answers: BinaryIO, block: Block) -> None:
    """Greet, then answer every message until none will come any more."""
    send(answers, {"protocol": PROTOCOL, "python": platform.python_version(), "numpy": np.__version__})
    desk = _Desk(block)
    while True:
        try:
            message = inbox.take()
        except EOFError:
            return
        try:
            answer = {"done": desk.do(message)}
        except BaseException as error:
            # Whatever it is, an exit included: the other side decides what becomes of it.
            answer = {"failed": _failure(error)}
        send(answers, answer)


class _Desk:
    """Where one session at a time is worked on."""

    def __init__(self, block: Block) -> None:
        self._block = block
        self._engines: dict[str, PointEngine] = {}
        self._session: EngineSession | None = None
        self._shapes: Mapping[Field, tuple[int, ...]] = {}

    def do(self, message: Message) -> Any:
        """Carry a message out and return what is to be answered."""
        what = message["do"]
        if what == "open":
            return self._open(message)
        if what == "load":
            return self._load(message)
        session = self._session
        if session is None:
            raise ValueError("no session is open")
        if what == "advance":
            report = checked_report(session.advance_to(message["time"]))
            return {"time": float(session.time), "report": to_plain(report, {})}
        if what == "read":
            fields = frozenset(Field(name) for name in message["fields"])
            state = checked_state(session.read(fields), fields, self._shapes, session.time)
            arrays = {field.value: getattr(state, field.value) for field in Field}
            shown = {name: np.asarray(array) for name, array in arrays.items() if array is not None}
            return {"time": float(state.time), "layout": self._block.pack(shown)}
        if what == "checkpoint":
            kept = {name: np.asarray(array) for name, array in checked_checkpoint(session.checkpoint()).items()}
            return {"layout": self._block.pack(kept)}
        if what == "close":
            self._session = None
            session.close()
            return None
        raise ValueError(f"unknown message {what!r}")

    def _open(self, message: Message) -> Any:
        arrays = self._block.unpack(message["layout"])
        given = from_plain(message["arguments"], arrays)
        engine = self._engine(message["factory"], message["remedy"])
        problem = given.pop("problem")
        # Whatever is declared: what is asked for and missing is told of as that.
        self._shapes = shapes_of(problem, frozenset(Field))
        self._session = engine.open(problem, **given)
        return {"time": float(self._session.time)}

    def _load(self, message: Message) -> None:
        engine: object = self._engine(message["factory"], message["remedy"])
        if not callable(getattr(engine, "open", None)):
            raise PluginLoadError(
                f"{message['factory']} makes no engine: what it returns, {engine!r:.60}, has no method open"
            )

    def _engine(self, factory: str, remedy: str) -> PointEngine:
        if factory not in self._engines:
            try:
                made = contained(attribute_at(factory))
            except ImportError as error:
                raise PluginLoadError(f"{factory} cannot be loaded: {one_line(error)}; {remedy}") from error
            self._engines[factory] = cast(PointEngine, made)
        return self._engines[factory]


def _failure(error: BaseException) -> Message:
    """What the other side is told of an error: its words, and its type where that is ours or the contract's."""
    if isinstance(error, GaspError):
        kind = next(kind.__name__ for kind in type(error).__mro__ if kind.__name__ in errors.__all__)
        report = to_plain(error.report, {}) if isinstance(error, EngineDivergedError) else None
        return {"kind": kind, "words": str(error), "report": report}
    if isinstance(error, ContractFault):
        return {"kind": ContractFault.__name__, "words": str(error)}
    if type(error) is ValueError:
        return {"kind": "ValueError", "words": str(error)}
    traceback.print_exception(error)
    return {"kind": None, "words": one_line(error)}
