"""Carries out several runs through joblib, which may have them done here, elsewhere, one by one or at once."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import pickle
import shutil
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gasp_core.errors import EngineEnvironmentError, RecordingError, SceneError
from gasp_core.processes.scratch import Scratch
from gasp_core.studies.runs.outcome import Outcome, Run, RunStatus
from gasp_core.studies.runs.supervisor import Surroundings, keep, surroundings

__all__ = ["carry_out", "check_limits"]


def carry_out(
    runs: Sequence[Run],
    *,
    at_once: int = 1,
    time_limit: float | None = None,
    finished: Callable[[Outcome], None] | None = None,
) -> list[Outcome]:
    """Simulate, each run in a fresh process; whatever becomes of one is an outcome and harms no other.

    They go through `joblib.Parallel`: on its own processes where nothing else is said, else on the backend of a
    surrounding `joblib.parallel_config`. Times of runs that share a machine are longer than of runs alone.

    Parameters
    ----------
    runs
        Of different keys and recordings.
    at_once
        How many at a time, at least 1.
    time_limit
        Wall time [s] of each, start included, after which it is given up; None: none.
    finished
        Called here, in this thread, with each outcome as it comes.

    Returns
    -------
    list of Outcome
        In the order of `runs`.

    Raises
    ------
    SceneError
        Where keys or recordings are not different, a number is impossible, or a scene cannot be sent to a process.
    RecordingError
        Where the folder for the first recording cannot be made.
    EngineEnvironmentError
        Where the system has no process groups.
    """
    if os.name != "posix":
        raise EngineEnvironmentError(f"runs in processes of their own need Linux or macOS, and this is {sys.platform}")
    check_limits(at_once, time_limit)
    if not runs:
        return []
    runs = [dataclasses.replace(run, out=Path(run.out).absolute()) for run in runs]
    _check_different("key", [run.key for run in runs])
    _check_different("recording", [str(run.out) for run in runs])
    for run in runs:
        _check_sendable(run)
    outcomes: dict[int, Outcome] = {}
    around = surroundings()
    with _leashed(runs[0].out.parent) as leash, _done(runs, around, leash, at_once, time_limit) as results:
        for index, outcome in results:
            outcomes[index] = outcome
            if finished is not None:
                finished(outcome)
    return [outcomes.get(index) or _lost(run) for index, run in enumerate(runs)]


def check_limits(at_once: int, time_limit: float | None) -> None:
    """Refuse what `carry_out` would, for those who have something to do before.

    Raises
    ------
    SceneError
        Where a number is impossible.
    """
    if at_once < 1:
        raise SceneError(f"at_once must be at least 1, found {at_once!r}")
    if time_limit is not None and not 0 < time_limit < float("inf"):
        raise SceneError(f"time_limit must be a number of seconds > 0, found {time_limit!r}")


@contextmanager
def _done(
    runs: Sequence[Run], around: Surroundings, leash: Path, at_once: int, time_limit: float | None
) -> Generator[Generator[tuple[int, Outcome]]]:
    """Outcomes as they come, with the number of their run."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    # As any: joblib says that a batch size is text.
    parallel: Any = Parallel
    results = parallel(n_jobs=at_once, return_as="generator_unordered", batch_size=1, pre_dispatch="n_jobs")(
        delayed(_numbered)(index, run, around, leash, time_limit) for index, run in enumerate(runs)
    )
    try:
        # Where one of joblib's own processes is killed it takes the rest along; what is there by then is kept.
        with contextlib.suppress(TerminatedWorkerError):
            yield results
    except BaseException:
        # Threads cannot be ended: those that wait for a process look whether this is still there. Renamed, as a folder
        # that somebody writes to may resist its removal.
        gone = leash.with_name(f"{leash.name}.gone")
        leash.rename(gone)
        shutil.rmtree(gone, ignore_errors=True)
        raise
    finally:
        results.close()


def _numbered(index: int, run: Run, around: Surroundings, leash: Path, time_limit: float | None) -> tuple[int, Outcome]:
    return index, keep(run, around, leash, time_limit)


@contextmanager
def _leashed(folder: Path) -> Generator[Path]:
    """A folder for notes beside the recordings, where whoever makes them can see it; gone in the end."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        leash = Scratch(".runs-", folder)
    except OSError as error:
        raise RecordingError(
            f"{folder}: cannot be written: {error.strerror or error}: choose a folder that is writable and has room"
        ) from None
    try:
        yield leash.path
    finally:
        leash.remove()


def _lost(run: Run) -> Outcome:
    return Outcome(
        key=run.key,
        ending=RunStatus.CRASHED,
        reason="the process that watched over it was killed, perhaps for lack of memory: run fewer at once",
    )


def _check_different(what: str, values: Sequence[str]) -> None:
    seen: set[str] = set()
    for value in values:
        if value in seen:
            raise SceneError(f'two runs have the same {what} "{value}": give each its own')
        seen.add(value)


def _check_sendable(run: Run) -> None:
    try:
        pickle.Pickler(_Nowhere()).dump(run)
    except Exception as error:
        raise SceneError(f'run "{run.key}" cannot be sent to a process of its own: {error}') from error


class _Nowhere(io.RawIOBase):
    """Takes whatever is written."""

    def writable(self) -> bool:
        """It is."""
        return True

    def write(self, data: Any, /) -> int:
        """As if it were."""
        return len(data)
