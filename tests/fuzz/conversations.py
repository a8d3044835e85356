"""What a worker says from its greeting to its end, as mutants; one line of JSON each."""

from __future__ import annotations

import json
import math
import traceback
import weakref
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["read_conversation", "said"]

COUNT, TRACERS = 7, 3


def _arrays() -> dict[str, Any]:
    return {
        "positions": np.ones((COUNT, 3)),
        "velocities": np.ones((COUNT, 3), dtype=np.float32),
        "deformation_gradients": np.ones((COUNT, 3, 3)),
        "tracer_positions": np.ones((TRACERS, 3)),
    }


def said() -> bytes:
    """A good conversation, with an error of every kind in it that leaves a worker of use."""
    from gasp_core.contract import Status, StepReport
    from gasp_core.engines.worker.serialization import to_plain
    from gasp_core.engines.worker.shared_memory import Block

    report = StepReport(
        status=Status.OK, substep_count=12, smallest_substep=1e-4, largest_substep=2e-4, warnings=("odd", "odder")
    )
    block = Block.make()
    layout = block.pack(_arrays())
    block.close()
    lines = [
        {"protocol": 1, "python": "3.11.2", "numpy": "2.1.0"},
        {"done": {"time": 0.0}},
        {"done": {"time": 0.1, "report": to_plain(report, {})}},
        {"done": {"time": 0.1, "layout": layout}},
        {"done": {"layout": {"x": layout["positions"], "odd name": ["<U4", [2], 0], "steps": ["<i8", [], 64]}}},
        {"failed": {"kind": "ValueError", "words": "0.1 is before 0.2"}},
        {"failed": {"kind": "UnsupportedSceneError", "words": "it cannot", "report": None}},
        {"failed": {"kind": "EngineDivergedError", "words": "it blew up", "report": to_plain(report, {})}},
        {"done": None},
    ]
    return b"".join(json.dumps(line).encode() + b"\n" for line in lines)


def read_conversation(path: Path) -> None:
    """Open, advance, read, keep and close, as the driver does, with a worker that says what the file says."""
    from gasp_core.contract import Field
    from gasp_core.engines.worker import replies
    from gasp_core.engines.worker.session import Limits, WorkerSession, answered
    from gasp_core.errors import EngineCrashedError, GaspError

    worker = _worker(path.read_bytes())
    taken = _Taken()
    try:
        worker.greet(5.0)
        time = answered(worker, {"do": "open"}, "opening the scene", replies.time, 5.0)
        shapes = {field: _arrays()[field.value].shape for field in Field}
        session = WorkerSession(worker, time, shapes, Limits(opening=5.0, frame=5.0), weakref.WeakMethod(taken.take))
        _expect_report(session.advance_to(0.1))
        state = session.read(frozenset(Field))
        assert all(getattr(state, field.value).shape == shapes[field] for field in Field)
        assert all(array.dtype.kind in "biufcSU" for array in session.checkpoint().values())
        for _ in range(3):
            try:
                session.advance_to(0.1)
            except EngineCrashedError:
                raise
            except (GaspError, ValueError) as error:
                assert str(error).isprintable()
                _expect_report(getattr(error, "report", None))
        session.close()
    except ValueError as error:
        # The contract lets engines raise it, and a worker say so; nothing else of the kind may come out.
        assert traceback.extract_tb(error.__traceback__)[-1].name == "answered", error
    finally:
        worker.end()
        worker.discard_log()


def _expect_report(report: Any) -> None:
    from gasp_core.contract import Status

    if report is None:
        return
    assert math.isfinite(report.smallest_substep + report.largest_substep) or report.status is not Status.OK
    assert report.substep_count >= 0
    assert all(warning.isprintable() for warning in report.warnings)


class _Taken:
    def take(self, worker: Any) -> None:
        worker.end()


def _worker(content: bytes) -> Any:
    """A worker that has said all it will ever say, and has ended; in no process."""
    import io
    import os

    from gasp_core.engines.worker.process import WorkerProcess
    from gasp_core.engines.worker.shared_memory import Block
    from gasp_core.engines.worker.transport import Inbox
    from gasp_core.processes.scratch import Scratch

    class Ended:
        pid = 0

        def poll(self) -> int:
            return 0

        def wait(self, timeout: float) -> int:
            return 0

    class Said(WorkerProcess):
        def __init__(self) -> None:
            self.name = "engine"
            self.block = Block.make()
            self.block.pack(_arrays())
            self._busy = self._over = False
            self._obituary = ""
            self._owner = os.getpid()
            self._scratch = Scratch("gasp-worker-")
            self.log = self._scratch.path / "engine.log"
            self.log.write_text("what it \x1b[31mprinted\n")
            self._process: Any = Ended()
            self._to = io.BytesIO()
            self._from = io.BytesIO(content)
            self._inbox = Inbox(self._from)

        def _end_group(self, patience: float = 0.0) -> None:
            self._over = True
            self.block.close()

    return Said()
