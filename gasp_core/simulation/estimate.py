"""How long a run will take, told from its first moments, which are run for real.

What a frame costs and what a substep costs are measured apart: the frames of the trial are short, and a stopwatch is
held to the engine.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from numpy.typing import NDArray

from gasp_core.contract import (
    EngineAccuracy,
    EngineDescriptor,
    EngineSession,
    Fluid,
    Material,
    PointEngine,
    PointProblem,
    Precision,
    Sand,
    StepReport,
)
from gasp_core.engines.passing_session import PassingSession
from gasp_core.processes.usage import usage_so_far
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import laws_of
from gasp_core.simulation.driver import simulate_part
from gasp_core.simulation.engine_choice import choose_engine

__all__ = ["EITHER_WAY", "Estimate", "estimate_run", "first_moments"]

Array = NDArray[Any]

_SHORTER = 8
"""Times that the frames of a trial are shorter."""
_FRAMES = 6
"""Of a trial, the one at time 0 not included. The first costs what only first things do."""
_LATER = 2.0
"""Substeps of a whole run over those that it would take if all went on as it begins: matter that is hit, stretched or
fast wants smaller ones. It was 1.4 to 3.3 in the elastic scenes of benchmarks/run_estimates.py."""
_LATER_OF: Mapping[type[Material], float] = {Fluid: 3.0, Sand: 1.3}
"""The same of what is otherwise: 3.1 for a splash of water, 1.1 for sand there."""
EITHER_WAY = 2.0
"""Factor by which an estimate may be off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What a run will take.

    Parameters
    ----------
    engine, device, precision
        That runs it.
    points, gaussians
        That the engine moves, and that follow them.
    spacing
        Of the engine's grid [m].
    cells
        Along the largest object.
    frames
        Of the whole run, the one at time 0 included.
    substeps
        Of the whole run, about.
    substep
        Size of the first ones [s].
    start_seconds
        Until the first frame: splats are read, points made and led through all frames, the engine built.
    engine_seconds, frame_seconds
        In substeps; in all that is done once a frame, filming included where that is asked for.
    memory
        Largest so far [bytes].
    disk
        Of the whole recording [bytes].
    notes
        What a run would say.
    """

    engine: str
    device: str
    precision: str
    points: int
    gaussians: int
    spacing: float
    cells: int
    frames: int
    substeps: int
    substep: float
    start_seconds: float
    engine_seconds: float
    frame_seconds: float
    memory: int
    disk: int
    notes: tuple[str, ...]

    @property
    def seconds(self) -> float:
        """In all, to a factor of `EITHER_WAY`."""
        return self.start_seconds + self.engine_seconds + self.frame_seconds


def first_moments(scene: Scene) -> Scene:
    """The scene, ended after a few short frames."""
    frame_rate = _SHORTER * scene.frame_rate
    return dataclasses.replace(scene, frame_rate=frame_rate, duration=_FRAMES / frame_rate)


def estimate_run(
    scene: Scene,
    folder: Path,
    engine: str | tuple[EngineDescriptor, PointEngine] | None = None,
    *,
    device: str | None = None,
    precision: Precision | None = None,
    isolate: bool | None = None,
    trust_code: bool = False,
    recorded: Callable[[int], None] | None = None,
) -> Estimate:
    """Run the first moments of a scene and tell what all of it will take.

    Parameters
    ----------
    scene
        All of it.
    folder
        Where the recording of `first_moments` is made.
    engine, device, precision, isolate, trust_code
        As of `simulate`.
    recorded
        Called with the number of each frame of `first_moments`; what it takes counts.

    Raises
    ------
    GaspError
        As `simulate`.
    """
    begin = perf_counter()
    set_up, chosen = choose_engine(scene, engine, isolate, device, precision)
    timed = _TimedEngine(chosen.opened(set_up.engine))
    ends: list[float] = []
    led: list[float] = []

    def done(frame: int) -> None:
        if recorded is not None:
            recorded(frame)
        ends.append(perf_counter())

    # The process of its own, where one is asked for, is that of the engine that is handed over.
    handed_over = dataclasses.replace(set_up.engine, isolate=False, frame_limit=None)
    set_up = dataclasses.replace(set_up, engine=handed_over)
    trial = simulate_part(
        first_moments(set_up),
        set_up,
        (chosen.descriptor, timed),
        folder,
        trust_code=trust_code,
        progress=False,
        recorded=done,
        led=lambda frame: led.append(perf_counter()),
    )
    # Where motions drive the points is asked for every frame of a run before its first one.
    leading = (led[-1] - led[0]) / (len(led) - 1) if led else 0.0
    first, *rest = timed.advances
    in_engine = sum(advance.seconds for advance in rest)
    substeps = sum(advance.report.substep_count for advance in rest)
    frames = scene.frame_count - 1
    starting = ends[0] - begin + max(first.seconds - in_engine / len(rest), 0.0)
    # Of the short frames that were run, in the whole run's time.
    trials = frames * _SHORTER / len(rest)
    later = max(
        (_LATER_OF.get(type(law), _LATER) for item in scene.objects for law in laws_of(item)),
        default=_LATER,
    )
    return Estimate(
        engine=trial.engine.name,
        device=trial.engine.device,
        precision=trial.engine.precision,
        points=timed.points,
        gaussians=int(trial.moving.sum()),
        spacing=trial.header.spacing,
        cells=int(timed.accuracy.resolution),
        frames=scene.frame_count,
        substeps=round(later * trials * substeps),
        substep=max(advance.report.largest_substep for advance in rest),
        start_seconds=starting + (frames - _FRAMES) * leading,
        engine_seconds=later * trials * in_engine,
        frame_seconds=frames * (ends[-1] - ends[1] - in_engine) / len(rest),
        memory=usage_so_far().peak_bytes,
        disk=_disk(folder, scene.frame_count),
        notes=trial.notes,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Advance:
    seconds: float
    report: StepReport


class _TimedEngine:
    """A `PointEngine` with a stopwatch held to its sessions."""

    def __init__(self, engine: PointEngine) -> None:
        self._engine = engine
        self.advances: list[_Advance] = []
        self.points = 0
        self.accuracy = EngineAccuracy()

    def open(
        self,
        problem: PointProblem,
        *,
        device: str,
        precision: Precision,
        seed: int,
        accuracy: EngineAccuracy,
        options: Any,
        restart: Mapping[str, Array] | None = None,
    ) -> EngineSession:
        """The engine's own session, timed."""
        self.points, self.accuracy = len(problem.points), accuracy
        session = self._engine.open(
            problem, device=device, precision=precision, seed=seed, accuracy=accuracy, options=options, restart=restart
        )
        return _TimedSession(session, self.advances)


class _TimedSession(PassingSession):
    """An `EngineSession` that tells how long each advance takes."""

    def __init__(self, session: EngineSession, advances: list[_Advance]) -> None:
        super().__init__(session)
        self._advances = advances

    def advance_to(self, time: float) -> StepReport:
        begin = perf_counter()
        report = self._session.advance_to(time)
        self._advances.append(_Advance(seconds=perf_counter() - begin, report=report))
        return report


def _disk(folder: Path, frames: int) -> int:
    """Of a recording [bytes] with so many frames, by that of a trial."""
    sizes = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    each = sum(size for path, size in sizes.items() if path.relative_to(folder).parts[0] in ("frames", "commits"))
    return sum(sizes.values()) + round(each / (_FRAMES + 1) * (frames - _FRAMES - 1))
