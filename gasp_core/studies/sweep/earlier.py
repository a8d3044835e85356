"""Rows that are there already: which still hold, which are measured anew, and which are of something else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gasp_core.errors import RecordingError
from gasp_core.progress import Shown, tell
from gasp_core.recording import Recording
from gasp_core.studies.sweep.measures import Measures
from gasp_core.studies.sweep.planning import Planned, key_of
from gasp_core.studies.sweep.table import DONE, Ledger, Row

__all__ = ["RUNS", "address_of", "is_kept", "keep_row", "ledger_of", "measured_anew", "measured_digest", "recording_of"]

LEDGER, RUNS = "sweep.jsonl", "runs"


def ledger_of(
    out: Path, plan: Sequence[Planned], scenes: Mapping[str, str], overwrite: bool
) -> tuple[Ledger, list[Row]]:
    """The rows that are there, none of them of another scene, and those of them that were asked for something else.

    The recordings of these are there. `scenes` are digests of scenes alone, by keys of settings.

    Raises
    ------
    RecordingError
        Where there are rows of another scene, or some that were asked for something else and left no recording.
    """
    path = out / LEDGER
    ledger = Ledger(path, anew=overwrite)
    digests = {key_of(each.setting): each.digest for each in plan}
    last = {key_of(row.setting): row for row in ledger.rows}
    others = [
        (key, row)
        for row in ledger.rows
        if row.status in DONE and row.scene and digests.get(key := key_of(row.setting)) not in (None, "", row.scene)
    ]
    of_another = list({key: row for key, row in others if scenes[key] not in (row.made_of, row.scene)}.values())
    asked_otherwise = [row for key, row in others if last[key] is row]
    gone = [row for row in asked_otherwise if not _is_there(out, key_of(row.setting), row)]
    then = ": choose another --out, or make all of them anew with --overwrite"
    if of_another:
        raise RecordingError(
            f"{path}: {len(of_another)} of its rows are of another scene, or of files, measures or a reference that are"
            f" others now, the first that of {_told(of_another[0])}{then}"
        )
    if gone:
        raise RecordingError(
            f"{path}: {len(gone)} of its rows were asked for other observables, or distances from another reference,"
            " and no recordings lie beside it (--keep) that could be asked now, the first that of"
            f" {_told(gone[0])}{then}"
        )
    return ledger, [row for row in asked_otherwise if row.columns.get("frames")]


def measured_anew(
    rows: Sequence[Row], plan: Sequence[Planned], measures: Measures, out: Path, progress: Shown
) -> Iterator[Row]:
    """The same runs with what is to be measured now, as their recordings tell it."""
    if rows:
        tell(progress, f"rows that are measured anew, from their recordings: {len(rows):,}")
    digests = {key_of(each.setting): each.digest for each in plan}
    for row in rows:
        key = key_of(row.setting)
        yield row.measured_anew(digests[key], measures(Recording.open(recording_of(out, key))))


def measured_digest(digest: str, measures: Measures, reference: str) -> str:
    """Of a scene and of what is asked of its run; as it is, where nothing is that not all are asked for."""
    if not digest or measures == Measures():
        return digest
    asked = [(own.name, own.text) for own in measures.observables]
    return hashlib.sha256(json.dumps([digest, asked, reference]).encode()).hexdigest()


def is_kept(out: Path, row: Row, *, keep: bool, address: str) -> bool:
    """Whether the recording of a row that is there is where it is to be kept, if it is; without a frame there is none.

    Whether it still is at an address, the row is believed: whoever asks need not be one who may look there.
    """
    if not row.columns.get("frames"):
        return True
    if address:
        return row.columns.get("recording") == address
    return not keep or (recording_of(out, key_of(row.setting)) / "zarr.json").is_file()


def address_of(folder: str, key: str, digest: str) -> str:
    """Of a recording, if it is kept at one: sweeps of other scenes may lie beside it."""
    return f"{folder}/{key}-{digest[:12]}.gasp" if folder else ""


def recording_of(out: Path, key: str) -> Path:
    """Where a recording is kept that is kept in the folder."""
    return out / RUNS / f"{key}.gasp"


def keep_row(ledger: Ledger, known: dict[str, Row], row: Row) -> None:
    """Add a row, on the disk as well."""
    ledger.add(row)
    known[key_of(row.setting)] = row


def _is_there(out: Path, key: str, row: Row) -> bool:
    """Whether the recording of a row was kept in the folder; without a frame there is none to be asked."""
    kept = row.columns.get("recording") == f"{RUNS}/{key}.gasp" and (recording_of(out, key) / "zarr.json").is_file()
    return kept or not row.columns.get("frames")


def _told(row: Row) -> str:
    return ", ".join(row.setting.changes) or "no settings"
