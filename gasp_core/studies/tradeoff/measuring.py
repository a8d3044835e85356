"""Runs every setting, once to measure its error and then again and again to time it, in an order drawn anew each round.

The first round is not timed: it compiles what has to be compiled and fills the caches of files. Every run is a process
of its own. Recordings are deleted as soon as they are measured.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gasp_core.accuracy.trajectories import TrajectoryDistance
from gasp_core.recording.layout import EngineRecord
from gasp_core.recording.reader import Recording
from gasp_core.scene.model import Scene
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, RunStatus, carry_out
from gasp_core.studies.tradeoff.reference_solution import Truth
from gasp_core.studies.tradeoff.settings import Setting, scene_with

__all__ = ["Measurement", "measure"]


@dataclass(slots=True, kw_only=True)
class Measurement:
    """What was found of a setting so far.

    Parameters
    ----------
    setting
        That was run.
    ending, reason
        Of its runs: the first that did not complete is the last.
    error
        From the truth; None where it did not complete.
    errors
        The rms of all runs [diagonals]; one where all runs gave the same frames.
    timed
        Outcomes of the repeats.
    engine
        As the recording has it; None where there is none.
    points
        That the engine moved.
    """

    setting: Setting
    ending: RunStatus = RunStatus.COMPLETE
    reason: str = ""
    error: TrajectoryDistance | None = None
    errors: list[float] = field(default_factory=list[float])
    timed: list[Outcome] = field(default_factory=list[Outcome])
    engine: EngineRecord | None = None
    points: int = 0
    digest: str = ""


def measure(
    scene: Scene,
    settings: Sequence[Setting],
    truth: Truth,
    folder: Path,
    *,
    repeats: int,
    seed: int,
    keep: bool,
    trust_code: bool,
    limits: Limits | None,
    backend: Backend | None,
    finished: Callable[[], None],
) -> list[Measurement]:
    """Measure settings, in their order.

    Parameters
    ----------
    scene
        With its engine.
    settings, truth
        What is run, and what it is measured by.
    folder
        For recordings, one at a time unless `keep`, which keeps that of the first run of each setting.
    repeats
        Timed runs of each setting, at least 1.
    seed
        Of the orders.
    trust_code
        As for `simulate`.
    limits, backend
        Of the runs, see `carry_out`.
    finished
        Called after each run; for those that need no more repeats it is called as often.

    Raises
    ------
    AccuracyError
        Where an error cannot be measured.
    """
    generator = np.random.default_rng(seed)
    found = {setting.key: Measurement(setting=setting) for setting in settings}

    def drawn(label: str) -> list[Run]:
        left = [own for own in found.values() if own.ending is RunStatus.COMPLETE]
        for _ in range(len(found) - len(left)):
            finished()
        return [
            Run(
                key=left[index].setting.key,
                scene=scene_with(scene, left[index].setting),
                out=folder / f"{left[index].setting.key}{label}.gasp",
                trust_code=trust_code,
            )
            for index in generator.permutation(len(left))
        ]

    def look(outcome: Outcome) -> None:
        _look(found[outcome.key], outcome, truth)
        if outcome.recording is not None and not keep:
            shutil.rmtree(outcome.recording, ignore_errors=True)
        finished()

    def time(outcome: Outcome) -> None:
        own = found[outcome.key]
        _look(own, outcome, truth)
        if outcome.ending is RunStatus.COMPLETE:
            own.timed.append(outcome)
        if outcome.recording is not None:
            shutil.rmtree(outcome.recording, ignore_errors=True)
        finished()

    carry_out(drawn(""), limits=limits, backend=backend, finished=look)
    for repeat in range(repeats):
        carry_out(drawn(f"-{repeat}"), limits=limits, backend=backend, finished=time)
    return list(found.values())


def _look(own: Measurement, outcome: Outcome, truth: Truth) -> None:
    """Take down how a run ended and how far it is from the truth, where its frames are not those of the run before."""
    own.ending, own.reason = outcome.ending, outcome.reason
    if outcome.ending is not RunStatus.COMPLETE:
        return
    assert outcome.recording is not None, "a complete run has a recording"
    run = Recording.open(outcome.recording)
    digest = _digest(run)
    if digest != own.digest:
        error = truth.error_of(run)
        own.error = own.error or error
        own.errors.append(error.rms_share)
    own.digest, own.engine, own.points = digest, run.engine, len(run.start_points)


def _digest(run: Recording) -> str:
    """SHA-256 of the motion in all frames."""
    digest = hashlib.sha256()
    for frame in range(run.frame_count):
        for array in run.displacements(frame):
            digest.update(array.tobytes())
    return digest.hexdigest()
