"""Runs on this machine, through joblib: on its own processes, or the backend of a surrounding parallel_config."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.processes.scratch import Scratch
from gasp_core.studies.runs.backends.interface import Ended
from gasp_core.studies.runs.outcome import Limits, Outcome, Run
from gasp_core.studies.runs.supervisor import Surroundings, keep, surroundings

__all__ = ["LocalRuns"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalRuns:
    """A `Backend`.

    Parameters
    ----------
    at_once
        How many at a time.
    """

    at_once: int = 1

    @contextmanager
    def made(self, runs: Sequence[Run], limits: Limits) -> Generator[Generator[Ended]]:
        """See `Backend`."""
        from joblib import Parallel, delayed
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        around = surroundings()
        with _leashed(runs[0].out.parent) as leash:
            # As any: joblib says that a batch size is text.
            parallel: Any = Parallel

            def outcomes() -> Generator[Ended]:
                yield from parallel(
                    n_jobs=self.at_once, return_as="generator_unordered", batch_size=1, pre_dispatch="n_jobs"
                )(delayed(_numbered)(index, run, around, leash, limits) for index, run in enumerate(runs))

            results = outcomes()
            try:
                # Where one of joblib's own processes is killed it takes the rest along; what is there by then is kept.
                with contextlib.suppress(TerminatedWorkerError):
                    yield results
            except BaseException:
                # Threads cannot be ended: those that wait for a process look whether this is still there. Renamed, as a
                # folder that somebody writes to may resist its removal.
                gone = leash.with_name(f"{leash.name}.gone")
                leash.rename(gone)
                shutil.rmtree(gone, ignore_errors=True)
                raise
            finally:
                results.close()


def _numbered(index: int, run: Run, around: Surroundings, leash: Path, limits: Limits) -> tuple[int, Outcome]:
    return index, keep(run, around, leash, limits, leash.exists)


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
