"""Keeps the process of one run: starts it, waits for it, ends it, and says what came of it."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.processes.exit_report import ending as how_it_ended
from gasp_core.processes.exit_report import tail
from gasp_core.processes.group import kill_group
from gasp_core.studies.runs import child
from gasp_core.studies.runs.outcome import Outcome, Run, RunStatus
from gasp_core.studies.runs.timing import split_times

__all__ = ["Surroundings", "keep", "surroundings"]

_CORE = str(Path(child.__file__).parents[2])
_GLANCE = 0.01
"""Seconds between looks at the process."""
_LINGER = 10.0
"""Seconds it may take to end by itself once its run is over, as some backends hang at exit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Where a process runs; that of whoever asked, not of whoever starts it, whose threads are told another number.

    Parameters
    ----------
    python
        The interpreter.
    environment
        Variables.
    folder
        The current one.
    """

    python: str
    environment: dict[str, str]
    folder: str


def surroundings() -> Surroundings:
    """Those of this process, with all that can be imported here."""
    path = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    return Surroundings(python=sys.executable, environment={**os.environ, "PYTHONPATH": path}, folder=str(Path.cwd()))


def keep(run: Run, around: Surroundings, leash: Path, time_limit: float | None) -> Outcome:
    """Make a run in a process of its own.

    Parameters
    ----------
    run
        With absolute paths.
    around
        Where it runs.
    leash
        A folder for notes; the process is ended once it is gone.
    time_limit
        Seconds after which it is ended; None: never.
    """
    begin = time.monotonic()
    try:
        folder = Path(tempfile.mkdtemp(dir=leash))
        (folder / child.RUN).write_bytes(pickle.dumps(run))
        process = _Process(around, folder)
    except OSError as error:
        reason = f"its process cannot be started: {error.strerror or error}"
        return Outcome(key=run.key, ending=RunStatus.FAILED, reason=reason, wall_seconds=time.monotonic() - begin)
    with process:
        verdict = process.wait(leash, None if time_limit is None else begin + time_limit)
    end = time.monotonic()
    ending, reason = _judged(folder, verdict, process.status, time_limit)
    stamps = list(_stamps(folder))
    recording = run.out if stamps else None
    frame_count, substeps = _frames_of(run.out) if recording is not None else (0, 0)
    start, stride = split_times(begin, [stamp["at"] for stamp in stamps], end)
    looks = [stamp["cpu"] for stamp in stamps[1:] if "cpu" in stamp]
    return Outcome(
        key=run.key,
        ending=ending,
        reason=reason,
        recording=recording,
        frame_count=frame_count,
        substeps=substeps,
        wall_seconds=end - begin,
        start_seconds=start,
        run_seconds=stride,
        cpu_seconds=process.cpu_seconds,
        run_cpu_seconds=looks[-1] - looks[0] if looks else 0.0,
        peak_bytes=max((stamp.get("peak", 0) for stamp in stamps), default=0),
    )


class _Process:
    """The process, and the group of all it starts; a context manager at whose end none of them is left."""

    def __init__(self, around: Surroundings, folder: Path) -> None:
        self._folder = folder
        self.status: int | None = None
        self.cpu_seconds = 0.0
        with (folder / child.OUTPUT).open("wb") as output:
            self._process = subprocess.Popen(
                # -P: what lies in the current folder is not imported in place of what is installed.
                [around.python, "-P", "-m", child.__name__, str(folder)],
                env=around.environment,
                cwd=around.folder,
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                # A session of its own: Ctrl-C on the terminal is for us, who then end it.
                start_new_session=True,
            )

    def wait(self, leash: Path, deadline: float | None) -> str:
        """Wait until it has ended by itself: nothing; or for as long as it may: "late", "loose"."""
        parent = os.getppid()
        over: float | None = None
        while not self._reaped(os.WNOHANG):
            now = time.monotonic()
            if over is not None and now > over:
                return ""
            if over is None and (self._folder / child.ENDING).exists():
                over = now + _LINGER
            elif over is None and deadline is not None and now > deadline:
                return "late"
            # A worker of joblib may be left alone by whoever asked.
            if not leash.exists() or os.getppid() != parent:
                return "loose"
            time.sleep(_GLANCE)
        return ""

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *error: object) -> None:
        kill_group(self._process)
        if self.status is None:
            self._reaped(0)
        assert self._process.stdin is not None
        self._process.stdin.close()

    def _reaped(self, options: int) -> bool:
        # Not Popen's own: it does not say what the process has used.
        try:
            pid, status, used = os.wait4(self._process.pid, options)
        except ChildProcessError:
            # Whoever hosts us ignores SIGCHLD: the system says nothing of how it ended.
            self.status = self._process.returncode = 0
            return True
        if pid == 0:
            return False
        self.status = self._process.returncode = os.waitstatus_to_exitcode(status)
        self.cpu_seconds = used.ru_utime + used.ru_stime
        return True


def _judged(folder: Path, verdict: str, status: int | None, time_limit: float | None) -> tuple[RunStatus, str]:
    """How a run ended, and why."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        told = json.loads((folder / child.ENDING).read_text())
        # All that was asked for has been done: how the process dies then is nobody's concern.
        return RunStatus(told["ending"]), told["reason"]
    if verdict == "late":
        what = f"was given up after {time_limit:g} s"
    elif verdict == "loose":
        what = "was ended, as nobody waits for it any more"
    else:
        what = f"its process {how_it_ended(status or 0)}"
    # Of where it fell, the last eight lines would be our own loop.
    said = tail(folder / child.OUTPUT, without=[_CORE, "<frozen runpy>"])
    return RunStatus.CRASHED, f"{what}{f'; its output ends: {said}' if said else ''}"


def _stamps(folder: Path) -> Iterator[dict[str, Any]]:
    """When frames were recorded; the last line may be cut."""
    try:
        lines = (folder / child.STAMPS).read_text().splitlines(keepends=True)
    except OSError:
        return
    for line in lines:
        if line.endswith("\n"):
            yield json.loads(line)


def _frames_of(path: Path) -> tuple[int, int]:
    """Number of frames, and of substeps, of a recording; none where it cannot be read."""
    from gasp_core.recording import Recording

    with contextlib.suppress(RecordingError):
        steps = [int(known["substeps"]) for known in Recording.open(path).diagnostics()]
        return len(steps), sum(steps)
    return 0, 0
