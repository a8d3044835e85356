"""What they make of the knobs, and of what they cannot do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gasp_reference_mpm.engine import ReferenceMpm
from gasp_reference_mpm.plugin import CAPABILITIES
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gasp_core.contract import EngineAccuracy, PointProblem
from gasp_core.errors import SceneError
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


@mutant("substep-ignored", {"substep-obeyed": "substeps of time in"})
class SubstepIgnored(Mutant):
    """A fixed substep is not taken."""

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        return replace(accuracy, substep=None)


@mutant("limit-ignored", {"error-kinds": "1000 substeps, 10 allowed"})
class LimitIgnored(Mutant):
    """A frame may cost what it will."""

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        return replace(accuracy, substep_limit=10**9)


@mutant(
    "tolerance-in-metres-a-second",
    {"V16[units of 10 m]": "distance / size"},
    slow=["V16[units of 10 m]"],
)
class ToleranceInMetresASecond(Mutant):
    """It says that it iterates, and does so to a micrometre a second, whatever tolerance is asked for."""

    declares = replace(CAPABILITIES, iterates=True)

    def problem(self, problem: PointProblem) -> PointProblem:
        points = problem.points
        return replace(problem, points=replace(points, initial_velocities=np.round(points.initial_velocities, 6)))


@mutant("cells-never-below-a-centimetre", {"scale": "distance / size"})
class CellsNeverBelowACentimetre(Mutant):
    """Its grid has a smallest spacing in metres."""

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        return replace(accuracy, spacing=max(0.01, accuracy.spacing_for(problem.points.size)))


@mutant("steps-by-the-nearest", {"slivers": "substep_limit"})
class StepsByTheNearest(Mutant):
    """Its step is the time that sound takes from the nearest point to the next, as of a mesh."""

    def accuracy(self, accuracy: EngineAccuracy, problem: PointProblem) -> EngineAccuracy:
        positions = problem.points.reference_positions
        if accuracy.substep is not None or len(positions) < 2:
            return accuracy
        nearest = float(cKDTree(positions).query(positions, k=2)[0][:, 1].min())
        spacing = accuracy.spacing_for(problem.points.size)
        share = min(1.0, max(nearest / (spacing / 2), 1e-3))
        return replace(accuracy, substep_fraction=accuracy.substep_fraction * share)


@mutant("refuses-nothing", {"refusals": "an empty checkpoint is accepted"})
class RefusesNothing(Mutant):
    """What cannot be done is quietly done otherwise."""

    def open(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None = None,
        **choices: Any,
    ) -> Session:
        try:
            return super().open(problem, accuracy=accuracy, restart=restart, **choices)
        except SceneError:
            return super().open(problem, accuracy=replace(accuracy, substep=None), **choices)


@mutant("believes-its-checkpoint", {"refusals": r"a checkpoint whose \w+ is not finite is accepted"})
class BelievesItsCheckpoint(Mutant):
    """What is no number in a checkpoint counts as zero."""

    def open(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None = None,
        **choices: Any,
    ) -> Session:
        if restart is not None:
            numbers = {name: array for name, array in restart.items() if np.asarray(array).dtype.kind in "biuf"}
            restart = {**restart, **{name: np.nan_to_num(array) for name, array in numbers.items()}}
        return super().open(problem, accuracy=accuracy, restart=restart, **choices)


@mutant("bare-errors", {"error-kinds": "ends with a bare KeyError"})
class BareErrors(Mutant):
    """What it cannot use ends in whatever Python says."""

    def open(
        self,
        problem: PointProblem,
        *,
        accuracy: EngineAccuracy,
        restart: Mapping[str, Array] | None = None,
        **choices: Any,
    ) -> Session:
        if restart is not None:
            restart = {
                name: restart[name] for name in ReferenceMpm().open(problem, accuracy=accuracy, **choices).checkpoint()
            }
        return super().open(problem, accuracy=accuracy, restart=restart, **choices)
