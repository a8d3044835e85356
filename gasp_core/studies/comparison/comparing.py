"""`compare`: the same scene through several engines."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import platform
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gasp_core.accuracy.trajectories import distance
from gasp_core.contract import Precision
from gasp_core.errors import AccuracyError, RecordingError
from gasp_core.io.atomic import replacing
from gasp_core.progress import counting
from gasp_core.recording import Recording
from gasp_core.recording.addresses import Mirror
from gasp_core.recording.writer import refuse_existing
from gasp_core.reduction.assembly import Assembly
from gasp_core.rendering.camera import check_size
from gasp_core.scene.model import Scene
from gasp_core.scene.named_code import code_of, refuse_untrusted, without_code
from gasp_core.simulation.splat_sources import prepare
from gasp_core.stepping.threads import processors
from gasp_core.studies.comparison.curves import RunCurves, curves_of
from gasp_core.studies.comparison.filming import film_all
from gasp_core.studies.comparison.measures import Comparison, Likeness, Pair, Row
from gasp_core.studies.comparison.page import page_of
from gasp_core.studies.comparison.parting import first_meeting, parting_of
from gasp_core.studies.comparison.running import chosen_engines, notes_of, run_all, runs_of
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, RunStatus, check_limits

__all__ = ["compare"]

_REPORT = "comparison.json"


def compare(
    scene: Scene,
    engines: Sequence[str] | None = None,
    out: str | Path = "scene.compare",
    *,
    name: str | None = None,
    resolution: int | None = None,
    device: str | None = None,
    precision: Precision | None = None,
    at_once: int = 1,
    time_limit: float | None = None,
    limits: Limits | None = None,
    backend: Backend | None = None,
    keep_at: str = "",
    size: tuple[int, int] = (480, 360),
    overwrite: bool = False,
    trust_code: bool = False,
    progress: bool | None = None,
) -> Comparison:
    """Run a scene with several engines, each in a process of its own, and compare what they make of it.

    An engine that cannot do the scene, crashes or diverges is a row of the result like any other. In `out` are then a
    recording and a film of each engine, ``comparison.json`` and ``comparison.html``.

    Parameters
    ----------
    scene
        What happens; options of its engine are used with that engine alone.
    engines
        Names; None: all that are ready.
    out
        Folder.
    name
        Of the scene, for the page; None: that of the folder.
    resolution
        Instead of the scene's.
    device, precision
        Of every engine, instead of the scene's, see `Scene.with_engine`; one that lacks them is unable.
    at_once
        How many engines run at a time; their times are those of runs alone only with 1.
    time_limit
        Wall time [s] of each, after which it is given up; None: as `limits` says.
    limits
        Of each; None: none.
    backend
        Who makes the runs, see `gasp_core.studies.runs.chosen_backend`; None: this machine.
    keep_at
        An address that recordings are kept at, s3://bucket/runs, and read from; what is there under the names of
        engines is replaced with `overwrite` alone. Empty: `out`, which whoever makes them has to see then.
    size [px]
        Of the films and of the pictures that are compared.
    overwrite
        Replace an earlier comparison in `out`.
    trust_code
        Import the functions that motions of the scene name by text, see `simulate`.
    progress
        Show bars; None: on terminals and in notebooks.

    Raises
    ------
    SceneError, SplatFormatError
        Where no engine could run it: a splat cannot be read, a number is impossible.
    UnknownEngineError
        Where no plugin that is installed offers one of them, or none is ready.
    RecordingError
        Where something is in `out` already, or it cannot be written.
    RenderingError
        Where no picture can have that size.
    """
    refuse_untrusted(scene, trust_code)
    names = chosen_engines(engines)
    if resolution is not None:
        scene = scene.with_resolution(resolution)
    # Before anything is started or removed: what is wrong with these is wrong for all.
    check_limits(at_once, time_limit)
    check_size(*size)
    folder = Path(out)
    earlier = _in_the_way(folder, names, overwrite)
    if code_of(scene):
        prepare(without_code(scene))
    assembly = prepare(scene).assembly
    runs = [
        dataclasses.replace(run, trust_code=trust_code, address=f"{keep_at}/{run.key}.gasp" if keep_at else "")
        for run in runs_of(scene, names, folder, device=device, precision=precision)
    ]
    _refuse_taken(runs, overwrite)
    outcomes = run_all(
        runs,
        at_once=at_once,
        time_limit=time_limit,
        limits=limits,
        backend=backend,
        begun=lambda: _make_room(earlier),
        progress=progress,
    )
    recordings, lost = _opened(runs, outcomes)
    filmed = film_all(recordings, folder, size, progress)
    comparison = Comparison(
        scene=folder.stem if name is None else name,
        folder=folder,
        frames_wanted=scene.frame_count,
        frame_rate=scene.frame_rate,
        resolution=int(assembly.accuracy.resolution),
        size=size,
        machine=_machine(at_once),
        rows=tuple(_row(run, outcome, recordings, filmed.films) for run, outcome in zip(runs, outcomes)),
        pairs=_pairs(recordings, filmed.likenesses, assembly, progress),
        notes=(*notes_of(scene, runs), *lost, *_alone(names, recordings), *filmed.notes),
    )
    masses = assembly.problem.masses
    curves: dict[str, RunCurves] = {key: curves_of(recording, masses) for key, recording in recordings.items()}
    page = page_of(comparison, curves)
    with replacing(folder / _REPORT) as stream:
        stream.write(json.dumps(comparison.to_json(), indent=1, ensure_ascii=False, allow_nan=False).encode())
    with replacing(comparison.page) as stream:
        stream.write(page.encode("utf-8", errors="backslashreplace"))
    return comparison


def _opened(runs: Sequence[Run], outcomes: Sequence[Outcome]) -> tuple[dict[str, Recording], list[str]]:
    """Recordings that have frames, and what is to be said of those that did not come to their address."""
    found: dict[str, Recording] = {}
    lost: list[str] = []
    for run, outcome in zip(runs, outcomes):
        if outcome.frame_count == 0:
            continue
        if run.address and outcome.ending is RunStatus.FAILED:
            # What is there may be of an earlier run.
            lost.append(f"{run.key}: {run.address} is not looked at, as its run failed")
            continue
        try:
            found[run.key] = Recording.open(run.address or run.out)
        except RecordingError as error:
            if not run.address:
                raise
            lost.append(f"{run.key}: {error}")
    return found, lost


def _row(run: Run, outcome: Outcome, recordings: Mapping[str, Recording], films: Mapping[str, Path]) -> Row:
    record = recordings[run.key].engine if run.key in recordings else None
    return Row(
        engine=run.key,
        version=record.version if record else "",
        device=record.device if record else "",
        precision=record.precision if record else "",
        outcome=outcome,
        film=films.get(run.key),
    )


def _alone(asked: Sequence[str], recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """A sentence where there is nothing to compare."""
    if len(recordings) > 1:
        return ()
    if len(asked) == 1:
        return ("one engine was asked for, so nothing is compared: name two or more, --engines A,B",)
    who = f"only {next(iter(recordings))} has" if recordings else "no engine has"
    return (f"nothing is compared: {who} frames to show",)


def _pairs(
    recordings: Mapping[str, Recording],
    likenesses: Mapping[tuple[str, str], Likeness],
    assembly: Assembly,
    progress: bool | None,
) -> tuple[Pair, ...]:
    """Every two of them, over the frames that both have."""
    pairs = list(itertools.combinations(recordings, 2))
    meetings: dict[str, float | None] = {}

    def met(name: str) -> float | None:
        if name not in meetings:
            meetings[name] = first_meeting(recordings[name], assembly.problem, assembly.spacing)
        return meetings[name]

    found: list[Pair] = []
    with counting(progress, "distance", len(pairs)) as measured:
        for first, second in pairs:
            apart, parting, reason = None, None, ""
            try:
                apart = distance(recordings[first], recordings[second])
                parting = parting_of(apart, (met(first), met(second)))
            except (AccuracyError, RecordingError) as error:
                reason = str(error)
            found.append(
                Pair(
                    first=first,
                    second=second,
                    distance=apart,
                    likeness=likenesses.get((first, second)),
                    reason=reason,
                    parting=parting,
                )
            )
            measured()
    return tuple(found)


def _in_the_way(folder: Path, names: Sequence[str], overwrite: bool) -> list[Path]:
    """What an earlier comparison left under the names of this one; refused where it is to stay, or somebody else's."""
    report = folder / _REPORT
    earlier = [*names, *(_engines_of(report) if overwrite else [])]
    taken = [report, report.with_suffix(".html")]
    taken += [folder / f"{name}{ending}" for name in dict.fromkeys(earlier) for ending in (".gasp", ".mp4")]
    there = [path for path in taken if path.exists()]
    if there and not overwrite:
        raise RecordingError(
            f"{there[0]}: is there already: choose another folder (--out), or replace what is there (--overwrite)"
        )
    for path in there:
        if path.suffix == ".gasp":
            refuse_existing(path, overwrite)  # somebody else's folder is no recording
        elif path.is_dir():
            raise RecordingError(f"{path}: is a folder, a comparison writes a file there: choose another --out")
    return there


def _refuse_taken(runs: Sequence[Run], overwrite: bool) -> None:
    """Refuse addresses at which something is that is to stay, before anything is run."""
    for run in runs:
        if run.address and not overwrite and Mirror(run.address).exists():
            raise RecordingError(
                f"{run.address}: is there already: choose another address (--keep-at), or replace what is there"
                " (--overwrite)"
            )


def _make_room(there: Sequence[Path]) -> None:
    for path in there:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _engines_of(report: Path) -> list[str]:
    """Engines of an earlier comparison, where it can be read."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        found: Any = json.loads(report.read_text(encoding="utf-8"))
        return [Path(str(row["engine"])).name for row in found["engines"]]
    return []


def _machine(at_once: int) -> str:
    """What the times are of."""
    parts = [platform.system(), platform.machine(), f"{processors()} processors"]
    if at_once > 1:
        parts.append(f"{at_once} engines at a time")
    return ", ".join(part for part in parts if part)
