"""Makes the finer run that settings are measured by, and the three that tell how far to trust it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from gasp_core.accuracy.trajectories import distance
from gasp_core.contract import Precision
from gasp_core.errors import AccuracyError
from gasp_core.recording.reader import Recording
from gasp_core.scene.model import Scene
from gasp_core.studies.runs import Backend, Limits, Outcome, Run, RunStatus, carry_out
from gasp_core.studies.tradeoff.reference_solution import Refined
from gasp_core.studies.tradeoff.richardson import remainder_of
from gasp_core.studies.tradeoff.settings import Setting, scene_with

__all__ = ["RUNS", "expected_order", "ladder", "refine"]

RUNS = 4
STEP = 1.5
"""Ratio of resolutions: 2 would be safer to take differences of, and cost three times as much."""


def ladder(settings: Sequence[Setting], precisions: Sequence[Precision]) -> tuple[Setting, ...]:
    """Settings of all vertices, from coarse to fine; the finest is 1.5 times finer than any that is asked for.

    In float64 where the engine has it; three at the first substep fraction that is asked for, and the finest again at
    half of that.
    """
    finest = max(setting.resolution for setting in settings)
    resolutions = [max(2, round(finest / STEP)), finest, max(round(finest * STEP), finest + 1)]
    if resolutions[0] >= resolutions[1]:
        raise AccuracyError(
            f"a finest resolution of {finest} leaves nothing coarser to estimate an error from: ask for at least 3"
        )
    precision = Precision.FLOAT64 if Precision.FLOAT64 in precisions else precisions[0]
    steps = [
        Setting(resolution=resolution, precision=precision, substep_fraction=settings[0].substep_fraction)
        for resolution in resolutions
    ]
    return (*steps, replace(steps[-1], substep_fraction=steps[-1].substep_fraction / 2))


def expected_order(scene: Scene) -> float:
    """Of convergence: 2 for smooth motion, 1 where matter meets something or is held, for that is found to a cell."""
    alone = sum(not item.static for item in scene.objects) == 1
    bounded = scene.colliders or scene.drives or scene.domain is not None
    return 2.0 if alone and not bounded else 1.0


def refine(
    scene: Scene,
    steps: Sequence[Setting],
    folder: Path,
    *,
    trust_code: bool,
    limits: Limits | None,
    backend: Backend | None,
    finished: Callable[[Outcome], None],
) -> Refined:
    """Make the runs of `ladder`; the recording of the last is left in `folder`.

    Raises
    ------
    AccuracyError
        Where one of them did not complete: nothing could be measured by it.
    """
    runs = [
        Run(key=step.key, scene=scene_with(scene, step), out=folder / f"{step.key}.gasp", trust_code=trust_code)
        for step in steps
    ]
    outcomes = carry_out(runs, limits=limits, backend=backend, finished=finished)
    for step, outcome in zip(steps, outcomes):
        if outcome.ending is not RunStatus.COMPLETE:
            raise AccuracyError(
                f"the truth cannot be made: all vertices at resolution {step.resolution} in {step.precision.value}"
                f" {outcome.ending.value} ({outcome.reason}): ask for lower resolutions, or name a closed form as truth"
            )
    coarse, middle, fine, halved = (Recording.open(run.out) for run in runs)
    left = remainder_of(
        (1 / steps[0].resolution, 1 / steps[1].resolution, 1 / steps[2].resolution),
        distance(coarse, middle).rms_share,
        distance(middle, fine).rms_share,
        distance(fine, halved).rms_share,
        expected_order(scene),
    )
    for run in runs[:-1]:
        shutil.rmtree(run.out)
    return Refined(
        recording=halved,
        resolutions=(steps[0].resolution, steps[1].resolution, steps[2].resolution),
        precision=steps[-1].precision.value,
        substep_fraction=steps[-1].substep_fraction,
        left=left,
    )
