"""The table of a sweep: a ledger that rows are added to as they come, and what is made of it for others to read.

The ledger is a JSON object a line, written to the disk before the next: whatever ends the process, at most its last
line is torn, which is taken off when it is read.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from gasp_core.errors import RecordingError
from gasp_core.io.atomic import replacing
from gasp_core.studies.runs import Outcome, RunStatus
from gasp_core.studies.sweep.settings import Setting

__all__ = ["DONE", "REFUSED", "Ledger", "Row", "csv_text", "remove", "write_parquet"]

REFUSED = "refused"
"""Status of a row whose scene is none: nothing was run."""
DONE = frozenset({RunStatus.COMPLETE.value, RunStatus.DIVERGED.value, REFUSED})
"""Of rows that another try would not change while the scene is the same; all others are made again."""
_OF_A_RUN = (
    "reason", "frames", "substeps", "wall_seconds", "start_seconds", "run_seconds", "cpu_seconds", "peak_bytes",
)  # fmt: skip
"""Columns that no measure gives."""
_HEAD = b'{"gasp sweep": 1}\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A run of a sweep.

    Parameters
    ----------
    setting
        What was set.
    scene
        Digest of the scene that this makes, of its files, and of what was asked of the run; empty where it makes none.
    made_of
        Of the scene and its files alone; empty in rows that were made before it was told.
    status
        How it ended: of `RunStatus`, or `REFUSED`.
    columns
        All else, by name.
    """

    setting: Setting
    scene: str
    made_of: str = ""
    status: str
    columns: Mapping[str, Any]

    @classmethod
    def of(cls, setting: Setting, scene: str, made_of: str, outcome: Outcome, recording: str) -> Row:
        """The row of a run that was made."""
        columns = {
            "reason": outcome.reason,
            "frames": outcome.frame_count,
            "substeps": outcome.substeps,
            "wall_seconds": round(outcome.wall_seconds, 3),
            "start_seconds": round(outcome.start_seconds, 3),
            "run_seconds": round(outcome.run_seconds, 3),
            "cpu_seconds": round(outcome.cpu_seconds, 3),
            "peak_bytes": outcome.peak_bytes,
            **outcome.found,
            "recording": recording,
        }
        return cls(setting=setting, scene=scene, made_of=made_of, status=outcome.ending.value, columns=columns)

    def measured_anew(self, scene: str, found: Mapping[str, Any]) -> Row:
        """The same run, asked for something else."""
        columns = {name: self.columns[name] for name in _OF_A_RUN if name in self.columns}
        return replace(self, scene=scene, columns={**columns, **found, "recording": self.columns["recording"]})

    @classmethod
    def refused(cls, setting: Setting, reason: str) -> Row:
        """The row of a setting that no scene has."""
        return cls(setting=setting, scene="", status=REFUSED, columns={"reason": reason})

    def cells(self) -> dict[str, Any]:
        """Everything, by column."""
        return {**self.setting.columns(), "status": self.status, **self.columns}


class Ledger:
    """Rows on the disk.

    Parameters
    ----------
    path
        Of the file; it need not be there.
    anew
        Whether rows that are there do not count; they stay until `begin`.

    Raises
    ------
    RecordingError
        Where it is there and is no ledger, or cannot be read.
    """

    def __init__(self, path: Path, *, anew: bool = False) -> None:
        self.path = path
        self.rows: list[Row] = []
        try:
            content = path.read_bytes() if path.exists() else b""
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from None
        end = content.rfind(b"\n") + 1
        if end or not _HEAD.startswith(content):
            self.rows = self._read(content[:end])
        if end < len(content):
            with replacing(path) as stream:
                stream.write(content[:end])
        if anew:
            self.rows = []

    def _read(self, content: bytes) -> list[Row]:
        lines = content.removeprefix(_HEAD).split(b"\n")[:-1]
        try:
            if not content.startswith(_HEAD):
                raise ValueError
            return [_row(json.loads(line)) for line in lines]
        except (ValueError, KeyError, TypeError, AttributeError):
            raise RecordingError(
                f"{self.path}: is no table that gasp sweep wrote, or is damaged: choose another --out"
            ) from None

    def begin(self) -> None:
        """Take away the file with rows that do not count, if there is one.

        Raises
        ------
        RecordingError
            Where it may not be removed.
        """
        if not self.rows:
            remove(self.path)

    def add(self, row: Row) -> None:
        """Write a row, onto the disk.

        Raises
        ------
        RecordingError
            Where that is full, or may not be written.
        """
        line = {
            "setting": dict(row.setting.values), "scene": row.scene, "made_of": row.made_of, "status": row.status,
            "columns": row.columns,
        }  # fmt: skip
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab") as stream:
                if stream.tell() == 0:
                    stream.write(_HEAD)
                stream.write(json.dumps(line).encode() + b"\n")
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise RecordingError(
                f"{self.path}: cannot be written: {error.strerror or error}: choose a folder that is writable and has"
                " room; the same command goes on from there"
            ) from None
        self.rows.append(row)


def remove(path: Path) -> None:
    """Remove a file, if it is there.

    Raises
    ------
    RecordingError
        Where it may not be removed.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be removed: {error.strerror or error}") from None


def _row(line: Any) -> Row:
    setting = cast("dict[str, str]", line["setting"])
    if not isinstance(line["columns"], dict):
        raise TypeError
    return Row(
        setting=Setting(values=dict(setting)),
        scene=str(line["scene"]),
        made_of=str(line.get("made_of", "")),
        status=str(line["status"]),
        columns=cast("dict[str, Any]", line["columns"]),
    )


def _columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """All cells by column: settings, status, then the others in the order in which they come up, None where one has
    none; the reason and the recording last."""
    cells = [row.cells() for row in rows]
    names = list(dict.fromkeys(name for own in cells for name in own))
    of_settings = {name for row in rows for name in row.setting.values}
    last = [name for name in ("recording", "reason") if name in names]
    order = [name for name in names if name in of_settings]
    order += ["status"] + [name for name in names if name not in {*of_settings, "status", *last}] + last
    return {name: [own.get(name) for own in cells] for name in order}


def csv_text(rows: Sequence[Row]) -> str:
    """The table as CSV, a line a run; empty where there is nothing."""
    columns = _columns(rows)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return stream.getvalue()


def write_parquet(rows: Sequence[Row], path: Path) -> bool:
    """The same as Parquet; False where pyarrow is not installed."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return False
    making: Any = pyarrow
    columns = {name: _one_type(values) for name, values in _columns(rows).items()}
    with replacing(path) as stream:
        writing: Any = parquet
        writing.write_table(making.table(columns), stream)
    return True


def _one_type(values: list[Any]) -> list[Any]:
    """A column of one type: numbers as they are, whole ones among others as those; everything as text otherwise."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) < 2:
        return values
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]
