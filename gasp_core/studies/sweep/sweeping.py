"""`sweep`: one scene file with many settings."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gasp_core.io.atomic import replacing
from gasp_core.progress import Shown, counting, tell
from gasp_core.recording import Recording
from gasp_core.recording.content import content_digest
from gasp_core.recording.writer import refuse_existing
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, RunStatus, carry_out
from gasp_core.studies.sweep.alone import alone_in
from gasp_core.studies.sweep.earlier import (
    RUNS,
    address_of,
    is_kept,
    keep_row,
    ledger_of,
    measured_anew,
    measured_digest,
    recording_of,
)
from gasp_core.studies.sweep.measures import Measures
from gasp_core.studies.sweep.planning import Planned, key_of
from gasp_core.studies.sweep.table import DONE, REFUSED, Row, csv_text, remove, write_parquet

__all__ = ["Sweep", "sweep"]

TABLE, PARQUET = "sweep.csv", "sweep.parquet"
_PAUSE = 5.0
"""Seconds between two tables while rows are added."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What came of a sweep.

    Parameters
    ----------
    folder
        Holds ``sweep.jsonl``, ``sweep.csv``, with pyarrow ``sweep.parquet``, and recordings that are kept.
    rows
        In the order of the settings.
    kept
        How many of them were there already.
    others
        How many rows of other settings the folder holds, in ``sweep.jsonl`` alone.
    parquet
        Whether that was written.
    """

    folder: Path
    rows: tuple[Row, ...]
    kept: int
    others: int
    parquet: bool

    @property
    def completed(self) -> tuple[Row, ...]:
        """Rows whose run came to the end."""
        return tuple(row for row in self.rows if row.status == RunStatus.COMPLETE.value)


def sweep(
    plan: Sequence[Planned],
    out: Path,
    *,
    measures: Measures | None = None,
    backend: Backend | None = None,
    limits: Limits | None = None,
    keep: bool = False,
    keep_at: str = "",
    overwrite: bool = False,
    trust_code: bool = False,
    progress: Shown = None,
) -> Sweep:
    """Make a run of each setting, in a process of its own, and a table of what came of them.

    Rows are on the disk as soon as they are there: the same call goes on with those that are missing. What completed,
    diverged or was refused stays, but for one whose recording is to be kept and is not; all else is tried again.

    Parameters
    ----------
    plan
        See `planned`.
    out
        Folder for the table, and recordings that are kept.
    measures
        What each run is asked for; None: what each run is asked for anyway.
    backend
        Who makes them, see `chosen_backend`; None: this machine, one at a time.
    limits
        Of each run; None: none.
    keep
        Keep the recordings, in `out`.
    keep_at
        An address that they are kept at instead, s3://bucket/runs.
    overwrite
        Make all rows anew.
    trust_code
        Import the functions that motions of the scenes name by text, see `simulate`.
    progress
        Show how far it is.

    Raises
    ------
    RecordingError
        Where `out` holds something else, or rows of the same settings and another scene or reference; where another
        sweep is at work there, or it cannot be written; where the reference cannot be read.
    BackendError
        Where there is nobody who could make them.
    """
    measures = measures or Measures()
    # Of the reference as it is now: rows that were measured against another one of that name are none of these.
    reference = "" if measures.reference is None else content_digest(Recording.open(measures.reference))
    scenes = {key_of(each.setting): each.digest for each in plan}
    plan = [replace(each, digest=measured_digest(each.digest, measures, reference)) for each in plan]
    with alone_in(out):
        ledger, asked_otherwise = ledger_of(out, plan, scenes, overwrite)
        known = {key_of(row.setting): row for row in ledger.rows}
        for row in measured_anew(asked_otherwise, plan, measures, out, progress):
            keep_row(ledger, known, row)
        kept = {
            key_of(each.setting)
            for each in plan
            if (row := known.get(key_of(each.setting)))
            and row.status in DONE
            and (row.status == REFUSED) == (each.scene is None)
            and is_kept(out, row, keep=keep, address=address_of(keep_at, key_of(each.setting), each.digest))
        }
        waiting = {
            key_of(each.setting): each for each in plan if each.scene is not None and key_of(each.setting) not in kept
        }
        runs = [
            Run(
                key=key,
                scene=each.scene,
                out=recording_of(out, key),
                trust_code=trust_code,
                measure=measures,
                keep=keep,
                address=address_of(keep_at, key, each.digest),
            )
            for key, each in waiting.items()
            if each.scene is not None
        ]
        # A run that is kept at an address needs no room here, where it may have been kept before.
        old = list((out / RUNS).glob("*.gasp")) if overwrite else [run.out for run in runs if not run.address]
        for path in old:
            # What is somebody else's is found before anything is removed.
            refuse_existing(path, overwrite=True)
        if again := sum(key in known and known[key].status in DONE for key in waiting):
            tell(progress, f"rows without the recordings that are to be kept, which are made anew: {again:,}")
        table = _Table(out, plan, known)
        told: set[str] = set()
        with counting(progress, "runs", len(runs)) as counted:

            def begun() -> None:
                # What was there stays until there is somebody who makes it anew.
                ledger.begin()
                if overwrite:
                    # A table of rows that are no more would be taken for one of those that come.
                    table.clear()
                for path in old:
                    _clear(path)
                for each in plan:
                    if each.scene is None and key_of(each.setting) not in kept:
                        keep_row(ledger, known, Row.refused(each.setting, each.reason))

            def finished(outcome: Outcome) -> None:
                each = waiting[outcome.key]
                told.add(outcome.key)
                recording = f"{RUNS}/{outcome.key}.gasp" if outcome.recording is not None else ""
                if keep_at and outcome.frame_count:
                    recording = address_of(keep_at, outcome.key, each.digest)
                keep_row(ledger, known, Row.of(each.setting, each.digest, scenes[outcome.key], outcome, recording))
                table.write(_PAUSE)
                counted()

            try:
                outcomes = carry_out(runs, backend=backend, limits=limits, begun=begun, finished=finished)
                for outcome in outcomes:
                    # Whoever watched over it is gone: nobody has told of it.
                    if outcome.key not in told:
                        finished(outcome)
            finally:
                parquet = table.write(0.0, parquet=True)
    return Sweep(
        folder=out,
        rows=tuple(known[key_of(each.setting)] for each in plan),
        kept=len(kept),
        others=len(known.keys() - scenes.keys()),
        parquet=parquet,
    )


class _Table:
    """What is made of the rows for others to read."""

    def __init__(self, folder: Path, plan: Sequence[Planned], known: Mapping[str, Row]) -> None:
        self._folder, self._plan, self._known = folder, plan, known
        self._written = time.monotonic()

    def write(self, pause: float, *, parquet: bool = False) -> bool:
        """Write it, unless that was done less than a `pause` [s] ago; whether as Parquet too."""
        if time.monotonic() - self._written < pause:
            return False
        rows = [row for each in self._plan if (row := self._known.get(key_of(each.setting))) is not None]
        if not rows:
            return False
        with replacing(self._folder / TABLE) as stream:
            stream.write(csv_text(rows).encode("utf-8", errors="backslashreplace"))
        self._written = time.monotonic()
        return parquet and write_parquet(rows, self._folder / PARQUET)

    def clear(self) -> None:
        """Remove what an earlier sweep has left.

        Raises
        ------
        RecordingError
            Where it may not be removed.
        """
        for name in (TABLE, PARQUET):
            remove(self._folder / name)


def _clear(recording: Path) -> None:
    """Remove what an earlier try has left."""
    if refuse_existing(recording, overwrite=True):
        shutil.rmtree(recording)
