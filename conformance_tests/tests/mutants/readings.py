"""What they show: not what is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from gasp_reference_mpm.plugin import CAPABILITIES
from numpy.typing import NDArray

from gasp_core.contract import Field, PointProblem, PointState, Precision, StepReport
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


class Showing(Session):
    """Shows something else than what is."""

    def shown(self, state: PointState) -> PointState:
        raise NotImplementedError

    def read(self, fields: frozenset[Field]) -> PointState:
        return self.shown(self.inner.read(fields))


_ROWS = ("positions", "velocities", "deformation_gradients")


class Lending(Showing):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.live: dict[str, Array] = {}

    def shown(self, state: PointState) -> PointState:
        views: dict[str, Array] = {}
        for name in _ROWS:
            array = getattr(state, name)
            if array is not None:
                live = self.live.setdefault(name, np.empty_like(array))
                live[:] = array
                views[name] = live[:]
        return replace(state, **views)


@mutant("buffers-aliased", {"owned-buffers": "share the memory"})
class BuffersAliased(Mutant):
    """What is read is a view of memory that goes on changing."""

    session = Lending


class Sorting(Showing):
    def shown(self, state: PointState) -> PointState:
        order = np.argsort(state.positions[:, 0], kind="stable")
        rows = {name: getattr(state, name) for name in _ROWS}
        return replace(state, **{name: array[order] for name, array in rows.items() if array is not None})


@mutant("rows-shuffled", {"row-identity": "row from where it flies to"})
class RowsShuffled(Mutant):
    """Points are sorted along x for the cache's sake, and never put back."""

    session = Sorting


class Swapping(Showing):
    def shown(self, state: PointState) -> PointState:
        if state.velocities is None:
            return state
        return replace(state, velocities=state.velocities[:, [0, 2, 1]].copy())


@mutant("velocity-axes-swapped", {"field:velocities": "from those given"})
class VelocityAxesSwapped(Mutant):
    """Velocities come back with y for z."""

    session = Swapping


class InKilometresAnHour(Showing):
    def shown(self, state: PointState) -> PointState:
        return state if state.velocities is None else replace(state, velocities=3.6 * state.velocities)


@mutant("velocities-scaled", {"field:velocities": "from those given"})
class VelocitiesScaled(Mutant):
    """Velocities come in km/h."""

    session = InKilometresAnHour


class Transposing(Showing):
    def shown(self, state: PointState) -> PointState:
        if state.deformation_gradients is None:
            return state
        return replace(state, deformation_gradients=np.ascontiguousarray(state.deformation_gradients.swapaxes(1, 2)))


@mutant("deformation-transposed", {"field:deformation_gradients": r"from I \+ A t"})
class DeformationTransposed(Mutant):
    """Deformation gradients are stored by columns and read by rows."""

    session = Transposing


class Spoiling(Showing):
    def shown(self, state: PointState) -> PointState:
        if state.time == 0:
            return state
        positions = state.positions.copy()
        positions[-1, 2] = np.nan
        return replace(state, positions=positions)


_NAN = "is not finite, first in point"


@mutant("one-nan", {"drift": _NAN, "V2": _NAN, "lands-on-time": _NAN, "lifecycle": _NAN, "determinism": _NAN})
class OneNan(Mutant):
    """One coordinate of one point is no number."""

    session = Spoiling


class Single(Showing):
    def shown(self, state: PointState) -> PointState:
        return replace(state, positions=state.positions.astype(np.float32).astype(np.float64))


@mutant("single-precision", {"drift": "largest error", "offset": "distance / size", "precision:float64": "drift error"})
class SinglePrecision(Mutant):
    """Double precision is declared, and places are kept in single."""

    session = Single


class Halving(Showing):
    precision = Precision.FLOAT64

    def shown(self, state: PointState) -> PointState:
        if self.precision is Precision.FLOAT64:
            return state
        return replace(state, positions=state.positions.astype(np.float16).astype(np.float64))


@mutant("half-precision", {"precision:float32": "float32: drift error"})
class HalfPrecision(Mutant):
    """Single precision is declared, and places are kept in half."""

    right_can = False
    declares = replace(CAPABILITIES, precisions=(Precision.FLOAT64, Precision.FLOAT32))
    session = Halving

    def open(self, problem: PointProblem, *, precision: Precision, **choices: Any) -> Session:
        session = super().open(problem, precision=Precision.FLOAT64, **choices)
        session.precision = precision
        return session


class Unscaling(Showing):
    def shown(self, state: PointState) -> PointState:
        with np.errstate(invalid="ignore"):
            corner, size = state.positions.min(axis=0), np.ptp(state.positions, axis=0)
            return replace(state, positions=corner + (state.positions - corner) / size * size)


@mutant("flat-clouds-divide-by-zero", {"degenerate-clouds": "not finite", "few-points": "not finite"})
class FlatCloudsDivideByZero(Mutant):
    """It normalises a cloud by its size along each axis."""

    session = Unscaling


class Noisy(Showing):
    def shown(self, state: PointState) -> PointState:
        noise = np.random.default_rng().integers(-1, 2, state.positions.shape)
        return replace(state, positions=state.positions + noise * np.spacing(state.positions))


@mutant("not-deterministic", {"determinism": "bit for bit", "V16[second run]": "second run"})
class NotDeterministic(Mutant):
    """Bitwise the same is declared, and the last digit is left to chance."""

    session = Noisy


class Racing(Noisy):
    def shown(self, state: PointState) -> PointState:
        return super().shown(state) if len(state.positions) > 10_000 else state


@mutant("many-points-race", {"determinism-of-many": "bit for bit"}, slow=["determinism-of-many"])
class ManyPointsRace(Mutant):
    """Many points are shared out among threads, which add up in whatever order they come."""

    session = Racing


class Late(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.before = self.inner.read(self.engine.declares.output_fields)

    def advance_to(self, time: float) -> StepReport:
        before = self.inner.read(self.engine.declares.output_fields)
        report = self.inner.advance_to(time)
        if report.substep_count:
            self.before = before
        return report

    def read(self, fields: frozenset[Field]) -> PointState:
        now = self.inner.read(fields)
        return replace(
            now, **{name: getattr(self.before, name).copy() for name in _ROWS if getattr(now, name) is not None}
        )


@mutant("a-frame-late", {"drift": "largest error"})
class AFrameLate(Mutant):
    """What is read is the state before the last advance."""

    session = Late


class CarryingNothing(Showing):
    def shown(self, state: PointState) -> PointState:
        return replace(state, tracer_positions=self.problem.points.tracer_positions)


@mutant("tracers-stay", {"tracers": "error in a uniform flow", "field:tracer_positions": "error in a uniform flow"})
class TracersStay(Mutant):
    """Tracers are declared, and stay where they are."""

    session = CarryingNothing


class CarryingAlike(Showing):
    def shown(self, state: PointState) -> PointState:
        points = self.problem.points
        if state.tracer_positions is None or points.tracer_positions is None:
            return state
        travel = (state.positions - points.reference_positions).mean(axis=0)
        return replace(state, tracer_positions=points.tracer_positions + travel)


@mutant("tracers-straight", {"tracers": "error in a turning block"})
class TracersStraight(Mutant):
    """All tracers go with the cloud's mean."""

    session = CarryingAlike


class Unsorted(Session):
    def view(self, field: Field) -> Array:
        return self.inner.view(field)[::-1]


@mutant("views-in-its-own-order", {"view:positions": "distance of positions"})
class ViewsInItsOwnOrder(Mutant):
    """What it hands out on the device is in the order that it keeps, not in the one that was given."""

    session = Unsorted
