"""`sweep`: one scene file with many settings."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gasp_core.contract import Precision
from gasp_core.discovery.registry import discover
from gasp_core.errors import GaspError, RecordingError, SceneError
from gasp_core.io.atomic import replacing
from gasp_core.progress import Shown, counting, tell
from gasp_core.recording import Recording
from gasp_core.recording.content import content_digest
from gasp_core.recording.writer import refuse_existing
from gasp_core.scene.file_digests import file_digest
from gasp_core.scene.files import files_of
from gasp_core.scene.loading import load_scene
from gasp_core.scene.model import Scene
from gasp_core.scene.writing import scene_to_toml
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, RunStatus, carry_out
from gasp_core.studies.sweep.alone import alone_in
from gasp_core.studies.sweep.measures import Measures
from gasp_core.studies.sweep.settings import Setting
from gasp_core.studies.sweep.table import DONE, REFUSED, Ledger, Row, csv_text, write_parquet

__all__ = ["Planned", "Sweep", "planned", "sweep"]

LEDGER, TABLE, PARQUET, RUNS = "sweep.jsonl", "sweep.csv", "sweep.parquet", "runs"
_PAUSE = 5.0
"""Seconds between two tables while rows are added."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """A setting, and the scene that it makes.

    Parameters
    ----------
    setting
        What is set.
    scene
        As it is to be run; None where it is none.
    digest
        Of that and of its files.
    reason
        Why it is none.
    """

    setting: Setting
    scene: Scene | None
    digest: str = ""
    reason: str = ""


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


def planned(
    scene: str | Path,
    settings: Sequence[Setting],
    *,
    engine: str | None = None,
    device: str | None = None,
    precision: Precision | None = None,
) -> list[Planned]:
    """The scene of each setting; one that the scene refuses says why.

    Parameters
    ----------
    scene
        Its file.
    settings
        In any order.
    engine, device, precision
        Of all runs, instead of the scenes', see `Scene.with_engine`.

    Raises
    ------
    SceneError
        Where it refuses all of them.
    UnknownEngineError, PluginLoadError
        Where there is no such engine.
    """
    path = Path(scene).absolute()
    registry = discover()
    known: dict[Path, str] = {}
    found: list[Planned] = []
    if engine is not None:
        registry.descriptor(engine)
    for setting in settings:
        try:
            own = load_scene(path, setting.changes)
            descriptor = registry.descriptor(engine or own.engine.name)
            if engine is not None or device is not None or precision is not None:
                own = own.with_engine(descriptor, device=device, precision=precision)
            found.append(Planned(setting=setting, scene=own, digest=_digest(own, known)))
        except GaspError as error:
            found.append(Planned(setting=setting, scene=None, reason=str(error)))
    if not any(each.scene is not None for each in found):
        raise SceneError(found[0].reason if found else "no settings are named: there is nothing to run")
    return found


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
    scenes = {_key(each.setting): each.digest for each in plan}
    plan = [replace(each, digest=_measured(each.digest, measures, reference)) for each in plan]
    with alone_in(out):
        ledger = _ledger(out, plan, scenes, overwrite)
        known = {_key(row.setting): row for row in ledger.rows}
        kept = {
            _key(each.setting)
            for each in plan
            if (row := known.get(_key(each.setting)))
            and row.status in DONE
            and (row.status == REFUSED) == (each.scene is None)
            and _is_kept(out, row, keep=keep, address=_address(keep_at, _key(each.setting), each.digest))
        }
        waiting = {
            _key(each.setting): each for each in plan if each.scene is not None and _key(each.setting) not in kept
        }
        runs = [
            Run(
                key=key,
                scene=each.scene,
                out=_recording(out, key),
                trust_code=trust_code,
                measure=measures,
                keep=keep,
                address=_address(keep_at, key, each.digest),
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
            tell(progress, f"{again:,} rows are there without the recordings that are to be kept: they are made anew")
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
                    if each.scene is None and _key(each.setting) not in kept:
                        _keep(ledger, known, Row.refused(each.setting, each.reason))

            def finished(outcome: Outcome) -> None:
                each = waiting[outcome.key]
                told.add(outcome.key)
                recording = f"{RUNS}/{outcome.key}.gasp" if outcome.recording is not None else ""
                if keep_at and outcome.frame_count:
                    recording = _address(keep_at, outcome.key, each.digest)
                _keep(ledger, known, Row.of(each.setting, each.digest, outcome, recording))
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
        rows=tuple(known[_key(each.setting)] for each in plan),
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
        rows = [row for each in self._plan if (row := self._known.get(_key(each.setting))) is not None]
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
            try:
                (self._folder / name).unlink(missing_ok=True)
            except OSError as error:
                raise RecordingError(f"{self._folder / name}: cannot be removed: {error.strerror or error}") from None


def _keep(ledger: Ledger, known: dict[str, Row], row: Row) -> None:
    ledger.add(row)
    known[_key(row.setting)] = row


def _ledger(out: Path, plan: Sequence[Planned], scenes: Mapping[str, str], overwrite: bool) -> Ledger:
    """The rows that are there, none of them of another scene; `scenes` are digests of those alone, by keys of settings.

    Raises
    ------
    RecordingError
        Where there are others.
    """
    path = out / LEDGER
    ledger = Ledger(path, anew=overwrite)
    digests = {_key(each.setting): each.digest for each in plan}
    last = {_key(row.setting): row for row in ledger.rows if row.status in DONE and row.scene}
    others = {key: row for key, row in last.items() if digests.get(key) not in (None, "", row.scene)}
    if others:
        first = ", ".join(next(iter(others.values())).setting.changes) or "no settings"
        then = ": choose another --out, or make all of them anew with --overwrite"
        if all(row.scene == scenes[key] for key, row in others.items()):
            raise RecordingError(
                f"{path}: {len(others)} of its rows were not asked for what is to be observed now, or for distances"
                f" from a reference, the first that of {first}{then}"
            )
        raise RecordingError(
            f"{path}: {len(others)} of its rows are of another scene, or of files, measures or a reference that are"
            f" others now, the first that of {first}{then}"
        )
    return ledger


def _measured(digest: str, measures: Measures, reference: str) -> str:
    """Of a scene and of what is asked of its run; as it is, where nothing is that not all are asked for."""
    if not digest or measures == Measures():
        return digest
    asked = [(own.name, own.text) for own in measures.observables]
    return hashlib.sha256(json.dumps([digest, asked, reference]).encode()).hexdigest()


def _is_kept(out: Path, row: Row, *, keep: bool, address: str) -> bool:
    """Whether the recording of a row that is there is where it is to be kept, if it is; without a frame there is none.

    Whether it still is at an address, the row is believed: whoever asks need not be one who may look there.
    """
    if not row.columns.get("frames"):
        return True
    if address:
        return row.columns.get("recording") == address
    return not keep or (_recording(out, _key(row.setting)) / "zarr.json").is_file()


def _address(folder: str, key: str, digest: str) -> str:
    """Of a recording, if it is kept at one: sweeps of other scenes may lie beside it."""
    return f"{folder}/{key}-{digest[:12]}.gasp" if folder else ""


def _clear(recording: Path) -> None:
    """Remove what an earlier try has left."""
    if refuse_existing(recording, overwrite=True):
        shutil.rmtree(recording)


def _recording(out: Path, key: str) -> Path:
    return out / RUNS / f"{key}.gasp"


def _key(setting: Setting) -> str:
    """Short, and of these settings alone."""
    text = json.dumps(sorted(setting.values.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest(scene: Scene, known: dict[Path, str]) -> str:
    """Of a scene and the content of its files, each of which is read once."""
    parts = [scene_to_toml(replace(scene, camera=None))]
    for path in files_of(scene):
        if path not in known:
            known[path] = file_digest(path)
        parts.append(known[path])
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
