"""The runs of a comparison: one an engine."""

from __future__ import annotations

import contextlib
import dataclasses
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from gasp_core.contract import Precision
from gasp_core.discovery.registry import discover
from gasp_core.discovery.status import engine_rows
from gasp_core.errors import PluginLoadError, RecordingError, SceneError, UnknownEngineError
from gasp_core.progress import counting
from gasp_core.recording import Recording
from gasp_core.scene.model import Scene, engine_notes
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, carry_out

__all__ = ["chosen_engines", "notes_of", "run_all", "runs_of"]

_GLANCE = 0.5
"""Seconds between looks at how many frames there are."""


def chosen_engines(names: Sequence[str] | None) -> list[str]:
    """The engines asked for; those that are ready where none is named.

    Raises
    ------
    UnknownEngineError
        Where one is of no plugin that is installed, or none is ready. One that is installed and broken is let pass: it
        will be a row that says so.
    SceneError
        Where one is named twice, or the list is empty.
    """
    registry = discover()
    if names is None:
        ready = [row.name for row in engine_rows(registry) if row.status == "ready"]
        if not ready:
            raise UnknownEngineError(
                'no engine is ready: install one, e.g. pip install gasp-warp-mpm, and see "gasp engines"'
            )
        return ready
    if not names:
        raise SceneError("no engine was named: name at least one, or leave the choice out for all that are ready")
    for index, name in enumerate(names):
        if name in names[:index]:
            raise SceneError(f'engine "{name}" is named twice: name each once')
        if name not in registry.offers:
            # Whoever mistypes a name should know before the others have run for an hour.
            with contextlib.suppress(PluginLoadError):
                registry.offer(name)
    return list(names)


def runs_of(
    scene: Scene,
    engines: Sequence[str],
    folder: Path,
    *,
    device: str | None = None,
    precision: Precision | None = None,
) -> list[Run]:
    """The scene as each engine runs it, `Scene.with_engine`; with a broken one's name in it, that will say why."""
    known = discover().engines
    runs: list[Run] = []
    for name in engines:
        if name in known:
            own = scene.with_engine(known[name], device=device, precision=precision)
        else:
            own = dataclasses.replace(scene, engine=dataclasses.replace(scene.engine, name=name))
        runs.append(Run(key=name, scene=own, out=folder / f"{name}.gasp"))
    return runs


def notes_of(scene: Scene, runs: Sequence[Run]) -> tuple[str, ...]:
    """What each run of `runs_of` could not keep of the scene; nothing is known of a broken engine."""
    known = discover().engines
    return tuple(note for run in runs if run.key in known for note in engine_notes(scene, run.scene, known[run.key]))


def run_all(
    runs: Sequence[Run],
    *,
    at_once: int,
    time_limit: float | None,
    limits: Limits | None,
    backend: Backend | None,
    begun: Callable[[], None],
    progress: bool | None,
) -> list[Outcome]:
    """Carry them out, with a bar over the frames of all."""
    with _frames_counted(runs, progress) as (watch, done):

        def room_made() -> None:
            begun()
            watch()

        return carry_out(
            runs,
            at_once=at_once,
            time_limit=time_limit,
            limits=limits,
            backend=backend,
            begun=room_made,
            finished=lambda outcome: done(outcome.key),
        )


@contextmanager
def _frames_counted(
    runs: Sequence[Run], progress: bool | None
) -> Generator[tuple[Callable[[], None], Callable[[str], None]]]:
    """Show how many frames there are.

    Gives a function to call once nothing older is where they go, and one to call with the key of a run that will make
    no more.
    """
    missing = {run.key: run.scene.frame_count for run in runs}
    lock, stop = threading.Lock(), threading.Event()
    with counting(progress, "frame", sum(missing.values())) as advance:

        def left(key: str, frames: int) -> None:
            with lock:
                for _ in range(missing[key] - frames):
                    advance()
                missing[key] = min(missing[key], frames)

        def look() -> None:
            while not stop.wait(_GLANCE):
                # What is at an address is not asked for every so often: those count once they have ended.
                for run in [run for run in runs if not run.address]:
                    with contextlib.suppress(RecordingError):
                        left(run.key, run.scene.frame_count - Recording.open(run.out).frame_count)

        watcher = threading.Thread(target=look, daemon=True)
        try:
            yield watcher.start, lambda key: left(key, 0)
        finally:
            stop.set()
            if watcher.ident is not None:
                watcher.join()
