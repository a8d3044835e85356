"""Carries out several runs, here or elsewhere, one by one or at once."""

from __future__ import annotations

import dataclasses
import io
import os
import pickle
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gasp_core.errors import EngineEnvironmentError, SceneError
from gasp_core.studies.runs.backends import Backend, chosen_backend
from gasp_core.studies.runs.outcome import Limits, Outcome, Run, RunStatus

__all__ = ["carry_out", "check_limits"]


def carry_out(
    runs: Sequence[Run],
    *,
    at_once: int = 1,
    time_limit: float | None = None,
    limits: Limits | None = None,
    backend: Backend | None = None,
    begun: Callable[[], None] | None = None,
    finished: Callable[[Outcome], None] | None = None,
) -> list[Outcome]:
    """Simulate, each run in a fresh process; whatever becomes of one is an outcome and harms no other.

    Where no backend is given they go through `joblib.Parallel`: on its own processes where nothing else is said, else
    on the backend of a surrounding `joblib.parallel_config`. Times of runs that share a machine are longer than of
    runs alone.

    Parameters
    ----------
    runs
        Of different keys and recordings.
    at_once
        How many at a time, at least 1, where no backend is given.
    time_limit
        Wall time [s] of each, start included, after which it is given up; None: as `limits` says.
    limits
        Of each run; None: none.
    backend
        Who makes them, see `chosen_backend`; None: this machine.
    begun
        Called once whoever makes them is there, before the first one begins.
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
    BackendError
        Where there is nobody who could make them.
    EngineEnvironmentError
        Where the system has no process groups.
    """
    if os.name != "posix":
        raise EngineEnvironmentError(f"runs in processes of their own need Linux or macOS, and this is {sys.platform}")
    limits = limits or Limits()
    if time_limit is not None:
        limits = dataclasses.replace(limits, seconds=time_limit)
    backend = backend or chosen_backend(at_once=at_once)
    if not runs:
        if begun is not None:
            begun()
        return []
    runs = [dataclasses.replace(run, out=Path(run.out).absolute()) for run in runs]
    _check_different("key", [run.key for run in runs])
    _check_different("recording", [str(run.out) for run in runs])
    for run in runs:
        _check_sendable(run)
    outcomes: dict[int, Outcome] = {}
    with backend.made(runs, limits) as results:
        if begun is not None:
            begun()
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
    chosen_backend(at_once=at_once)
    Limits(seconds=time_limit)


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
