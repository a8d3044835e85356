"""Keeps the process of one run: starts it, waits for it, ends it, and says what came of it."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import psutil

from gasp_core.errors import GaspError, RecordingError
from gasp_core.processes.exit_report import ending as how_it_ended
from gasp_core.processes.exit_report import tail
from gasp_core.processes.group import kill_group
from gasp_core.studies.runs import child
from gasp_core.studies.runs.outcome import Limits, Outcome, Run, RunStatus
from gasp_core.studies.runs.timing import split_times

__all__ = ["Surroundings", "keep", "surroundings"]

_CORE = str(Path(child.__file__).parents[2])
_GLANCE = 0.01
"""Seconds between looks at the process."""
_LOOK = 0.5
"""Seconds between looks at its memory."""
_THREADS = (
    "GASP_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
    "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS",
)  # fmt: skip
"""Variables by which libraries, and GASP itself, are told how many threads they may have."""
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

    def with_threads(self, threads: int | None) -> Surroundings:
        """The same, with libraries told how many threads they may have; None: whatever they were told."""
        own = {} if threads is None else dict.fromkeys(_THREADS, str(threads))
        return replace(self, environment={**self.environment, **own})


def surroundings() -> Surroundings:
    """Those of this process, with all that can be imported here."""
    path = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    return Surroundings(python=sys.executable, environment={**os.environ, "PYTHONPATH": path}, folder=str(Path.cwd()))


def keep(run: Run, around: Surroundings, notes: Path, limits: Limits, wanted: Callable[[], bool]) -> Outcome:
    """Make a run in a process of its own.

    Parameters
    ----------
    run
        With absolute paths.
    around
        Where it runs.
    notes
        A folder for them.
    limits
        Beyond which it is ended.
    wanted
        Asked all the time; the process is ended once nobody wants it any more.
    """
    begin = time.monotonic()
    try:
        folder = Path(tempfile.mkdtemp(dir=notes))
        # What is measured is measured here, and need not be known to that process.
        stays = run.keep and not run.address
        made = replace(run, measure=None, out=run.out if stays else folder / "run.gasp")
        (folder / child.RUN).write_bytes(pickle.dumps(made))
        process = _Process(around.with_threads(limits.threads), folder)
    except OSError as error:
        reason = f"its process cannot be started: {error.strerror or error}"
        return Outcome(key=run.key, ending=RunStatus.FAILED, reason=reason, wall_seconds=time.monotonic() - begin)
    with process:
        verdict = process.wait(wanted, None if limits.seconds is None else begin + limits.seconds, limits.memory)
    end = time.monotonic()
    ending, reason = _judged(folder, verdict, process.status, limits)
    stamps = list(_stamps(folder))
    recording = made.out if stamps else None
    frame_count, substeps = _frames_of(made.out) if recording is not None else (0, 0)
    found: Mapping[str, Any] = {}
    if run.measure is not None and recording is not None and frame_count:
        try:
            found = run.measure(_opened(recording))
        except GaspError as error:
            # What became of the run itself stays what is told.
            if ending is RunStatus.COMPLETE:
                ending, reason = RunStatus.FAILED, f"cannot be measured: {error}"
    if not stays:
        recording = None
        shutil.rmtree(folder, ignore_errors=True)
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
        found=found,
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

    def wait(self, wanted: Callable[[], bool], deadline: float | None, memory: int | None) -> str:
        """Wait until it has ended by itself: nothing; or for as long as it may: "late", "large", "loose"."""
        parent = os.getppid()
        over: float | None = None
        looked = 0.0
        while not self._reaped(os.WNOHANG):
            now = time.monotonic()
            if over is not None and now > over:
                return ""
            if over is None and (self._folder / child.ENDING).exists():
                over = now + _LINGER
            elif over is None and deadline is not None and now > deadline:
                return "late"
            # A worker of joblib may be left alone by whoever asked.
            if not wanted() or os.getppid() != parent:
                return "loose"
            if memory is not None and now - looked > _LOOK:
                looked = now
                if _resident(self._process.pid) > memory:
                    return "large"
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


def _resident(pid: int) -> int:
    """Memory [bytes] of a process and all that it started."""
    total = 0
    with contextlib.suppress(psutil.Error):
        first = psutil.Process(pid)
        for process in (first, *first.children(recursive=True)):
            with contextlib.suppress(psutil.Error):
                total += process.memory_info().rss
    return total


def _judged(folder: Path, verdict: str, status: int | None, limits: Limits) -> tuple[RunStatus, str]:
    """How a run ended, and why."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        told = json.loads((folder / child.ENDING).read_text())
        # All that was asked for has been done: how the process dies then is nobody's concern.
        return RunStatus(told["ending"]), told["reason"]
    if verdict == "late":
        what = f"was given up after {limits.seconds:g} s"
    elif verdict == "large":
        what = f"was given up, as it took more memory than {(limits.memory or 0) / 1e6:,.0f} MB"
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
    with contextlib.suppress(RecordingError):
        steps = [int(known["substeps"]) for known in _opened(path).diagnostics()]
        return len(steps), sum(steps)
    return 0, 0


def _opened(path: Path) -> Any:
    from gasp_core.recording import Recording

    return Recording.open(path)
