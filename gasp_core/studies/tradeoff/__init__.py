"""Error against time: one scene, one engine, many settings.

`tradeoff` runs a scene at each resolution, fraction of cores, precision and substep fraction, each run in a process of
its own, measures how far it is from a truth and how long it takes, and says which settings no other one beats.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Sequence
from pathlib import Path

from gasp_core.discovery.registry import discover
from gasp_core.errors import AccuracyError, RecordingError
from gasp_core.io.atomic import replacing
from gasp_core.processes.scratch import clear_left_over
from gasp_core.progress import counting
from gasp_core.recording.writer import refuse_existing
from gasp_core.scene.model import Scene, engine_notes
from gasp_core.scene.named_code import refuse_untrusted
from gasp_core.studies.runs import Backend, Limits
from gasp_core.studies.tradeoff.machine import load, machine
from gasp_core.studies.tradeoff.measuring import measure
from gasp_core.studies.tradeoff.plot import pictures
from gasp_core.studies.tradeoff.reference_solution import ClosedForm, load_truth
from gasp_core.studies.tradeoff.refining import RUNS, ladder, refine
from gasp_core.studies.tradeoff.report import Row, Tradeoff, cautions, rows_of
from gasp_core.studies.tradeoff.settings import Setting, default_resolutions, grid, scene_with

__all__ = ["ClosedForm", "Row", "Setting", "Tradeoff", "default_resolutions", "grid", "load_truth", "tradeoff"]

_RESULT = "tradeoff"
_TRUTH = "truth"


def tradeoff(
    scene: Scene,
    settings: Sequence[Setting],
    out: Path,
    *,
    engine: str | None = None,
    device: str | None = None,
    name: str = "scene",
    repeats: int = 3,
    truth: ClosedForm | None = None,
    seed: int = 0,
    keep: bool = False,
    overwrite: bool = False,
    trust_code: bool = False,
    time_limit: float | None = None,
    limits: Limits | None = None,
    backend: Backend | None = None,
    progress: bool | None = None,
) -> Tradeoff:
    """Measure the trade of a scene.

    Parameters
    ----------
    scene
        What happens.
    settings
        See `grid`.
    out
        Folder for tradeoff.json, .csv, .png and .svg, and for recordings while they are needed.
    engine, device
        Instead of the scene's, see `Scene.with_engine`.
    name
        What to call the scene.
    repeats
        Timed runs of each setting, after one that is not timed. Nine and more give intervals to rely on.
    truth
        A closed form; None: a finer run, see `ladder`.
    seed
        Of the order of runs, and of the bootstrap.
    keep
        Keep the recordings of the truth and of one run of each setting, in `out`/recordings.
    overwrite
        Replace a result that is at `out`.
    trust_code
        Import the functions that motions of the scene name by text, see `simulate`.
    time_limit
        Wall time [s] of each run after which it is given up; None: as `limits` says.
    limits
        Of each run; None: none.
    backend
        Who makes the runs, see `gasp_core.studies.runs.chosen_backend`, where `out` can be seen from; None: this
        machine, one at a time. Times of runs that share a machine, or are of several, compare badly.
    progress
        Show a bar; None: where stderr is a terminal.

    Raises
    ------
    AccuracyError
        Where nothing can be measured: no setting, no truth, no run that completed.
    UnknownEngineError, PluginLoadError, DuplicateEngineError
        Where there is no such engine.
    RecordingError
        Where there is a result at `out` already.
    """
    refuse_untrusted(scene, trust_code)
    if not settings:
        raise AccuracyError("no settings are named: there is nothing to measure")
    if repeats < 1:
        raise AccuracyError(f"repeats must be at least 1, found {repeats!r}: without one nothing is timed")
    limits = limits or Limits()
    if time_limit is not None:
        limits = dataclasses.replace(limits, seconds=time_limit)
    descriptor = discover().descriptor(engine or scene.engine.name)
    asked, scene = scene, scene.with_engine(descriptor, device=device)
    # As a setting has it: that names the precision itself.
    notes = engine_notes(asked, scene_with(scene, settings[0]), descriptor)
    steps = () if truth is not None else ladder(settings, descriptor.capabilities.precisions)
    recordings = _prepared(out, overwrite)
    surroundings = machine()
    try:
        total = (0 if truth is not None else RUNS) + len(settings) * (1 + repeats)
        with counting(progress, "runs", total) as counted:
            measured_by = truth or refine(
                scene,
                steps,
                recordings / _TRUTH,
                trust_code=trust_code,
                limits=limits,
                backend=backend,
                finished=lambda outcome: counted(),
            )
            found = measure(
                scene,
                settings,
                measured_by,
                recordings,
                repeats=repeats,
                seed=seed,
                keep=keep,
                trust_code=trust_code,
                limits=limits,
                backend=backend,
                finished=counted,
            )
    except BaseException:
        _tidy(out, recordings, keep)
        raise
    surroundings["load_afterwards"] = load()
    rows = rows_of(found, measured_by.remainder, seed)
    if not any(row.error is not None for row in rows):
        _tidy(out, recordings, keep)
        first = rows[0]
        raise AccuracyError(f"none of {len(rows)} settings could be run: {first.ending.value}: {first.reason}")
    known = next(own.engine for own in found if own.engine is not None)
    result = Tradeoff(
        scene=name,
        engine={"name": known.name, "version": known.version, "device": known.device, "options": known.options},
        rows=rows,
        truth=measured_by.description(),
        machine=surroundings,
        notes=(*notes, *cautions(rows)),
    )
    texts = {"json": result.json_text().encode(), "csv": result.csv_text().encode()}
    for ending, content in {**texts, **pictures(result)}.items():
        with replacing(out / f"{_RESULT}.{ending}") as stream:
            stream.write(content)
    _tidy(out, recordings, keep)
    return result


def _prepared(out: Path, overwrite: bool) -> Path:
    """The folder for recordings, empty; nothing that is not ours is touched."""
    if (out / f"{_RESULT}.json").exists() and not overwrite:
        raise RecordingError(f"{out}: there is a result already: choose another --out, or say --overwrite")
    recordings = out / "recordings"
    if recordings.exists():
        if not overwrite:
            raise RecordingError(f"{recordings}: is left from before: choose another --out, or say --overwrite")
        clear_left_over(".", recordings)
        strange = [path.name for path in recordings.iterdir() if not _is_ours(path)]
        if strange:
            raise RecordingError(
                f"{recordings}: holds {strange[0]}, which is not of gasp tradeoff: choose another --out"
            )
        shutil.rmtree(recordings)
    try:
        recordings.mkdir(parents=True)
    except OSError as error:
        raise RecordingError(
            f"{out}: cannot be written: {error.strerror or error}: choose a folder that is writable and has room"
        ) from None
    return recordings


def _is_ours(path: Path) -> bool:
    if path.name == _TRUTH and path.is_dir():
        clear_left_over(".", path)
        return all(_is_ours(entry) for entry in path.iterdir())
    return path.suffix == ".gasp" and path.is_dir() and refuse_existing(path, overwrite=True)


def _tidy(out: Path, recordings: Path, keep: bool) -> None:
    """Take away recordings that nobody asked for, and the folder where nothing is left in it."""
    if not keep:
        shutil.rmtree(recordings, ignore_errors=True)
        if not any(out.iterdir()):
            out.rmdir()
