"""What a sweep will take, told from the first moments of a few of its runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from gasp_core.processes.scratch import scratch_folder
from gasp_core.simulation.estimate import Estimate, estimate_run
from gasp_core.studies.sweep.planning import Planned

__all__ = ["Preview", "previewed"]

_PROCESS = 2.5
"""Seconds that a run takes beside what it does: its interpreter, its imports, its end (docs/cluster.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """Of all runs.

    Parameters
    ----------
    runs
        How many there are.
    refused
        Settings whose scene is none, and why.
    tried
        How many were begun, spread evenly over the list.
    points
        That engines move, of those: the fewest and the most.
    seconds
        Wall time of all, `at_once` at a time, to a factor of `gasp_core.simulation.estimate.EITHER_WAY`.
    memory [bytes]
        Of one run, the most of those that were tried.
    disk [bytes]
        Of all recordings, where they are kept.
    """

    runs: int
    refused: tuple[Planned, ...]
    tried: int
    points: tuple[int, int]
    seconds: float
    memory: int
    disk: int


def previewed(plan: Sequence[Planned], *, at_once: int, tries: int = 3, trust_code: bool = False) -> Preview:
    """Begin a few runs of a plan, where nobody looks.

    Parameters
    ----------
    plan
        See `planned`; one of them at least has a scene.
    at_once
        Runs at a time.
    tries
        How many are begun.
    trust_code
        As for `simulate`.

    Raises
    ------
    GaspError
        As `simulate`.
    """
    scenes = [each.scene for each in plan if each.scene is not None]
    rows = np.unique(np.linspace(0, len(scenes) - 1, min(tries, len(scenes))).round().astype(int))
    found: list[Estimate] = []
    with scratch_folder("gasp-preview-") as folder:
        for row in rows:
            found.append(estimate_run(scenes[row], folder / f"{row}.gasp", trust_code=trust_code))
    return Preview(
        runs=len(plan),
        refused=tuple(each for each in plan if each.scene is None),
        tried=len(found),
        points=(min(each.points for each in found), max(each.points for each in found)),
        seconds=fmean(each.seconds + _PROCESS for each in found) * math.ceil(len(scenes) / at_once),
        memory=max(each.memory for each in found),
        disk=round(fmean(each.disk for each in found) * len(scenes)),
    )
