"""What rigid bodies get wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Field, PointProblem, PointState, Rigid, StepReport
from mutants.base import Mutant, Session, mutant

Array = NDArray[Any]


def _world(session: Any) -> Any:
    """The rigid bodies behind a session of the right engine; None where it has none."""
    side = getattr(session.inner, "_rigid", None) or session.inner._held
    return getattr(side, "world", None)


def _with_restitution(problem: PointProblem, restitution: float) -> PointProblem:
    changed = [replace(one, restitution=restitution) if isinstance(one, Rigid) else one for one in problem.materials]
    return replace(problem, materials=tuple(changed))


class Hollow(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        world = _world(self)
        if world is not None:
            world.bodies = replace(world.bodies, moments=world.bodies.moments * 5 / 3)


@mutant("hollow-balls", {"material:rigid[roll][ball]": "way / closed form - 1"})
class HollowBalls(Mutant):
    """The mass of a rigid body is in its skin."""

    session = Hollow


@mutant("rolls-on-cubes", {"material:rigid[roll][ball]": "way / closed form - 1"})
class RollsOnCubes(Mutant):
    """What a rigid body's surface is, where that is known, is not heard."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, hints=())


@mutant(
    "icy-floors",
    {"material:rigid[roll][cylinder]": "way / closed form - 1", "material:sand[heap]": "speed / that of its fall"},
)
class IcyFloors(Mutant):
    """Everything slides on walls whatever their friction is."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, colliders=tuple(replace(wall, friction=0.0) for wall in problem.colliders))


@mutant("dead-balls", {"restitution": "speeds' ratio - e"})
class DeadBalls(Mutant):
    """Nothing bounces."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_restitution(problem, 0.0)


@mutant("lively-balls", {"restitution": "restitution 0: speeds' ratio - e"})
class LivelyBalls(Mutant):
    """Everything bounces."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_restitution(problem, 0.9)


class Unmoved(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        world = _world(self)
        if world is not None:
            meet = world._met

            def unmoved(*given: Any) -> tuple[Array, Array]:
                return given[5], meet(*given)[1]

            world._met = unmoved


@mutant(
    "rigid-bodies-feel-nothing",
    {
        "material:rigid[collide]": "they did not meet|change of momentum",
        "rigid-parts[fly]": "change of momentum|farther apart",
        "material:rigid[sand]": "deeper than in a liquid",
        "material:rigid[water]": "deeper than Archimedes has it",
    },
)
class RigidBodiesFeelNothing(Mutant):
    """What they meet takes their momentum, and they keep it."""

    session = Unmoved


class Creeping(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        world = _world(self)
        if world is not None:
            meet = world._met

            def creeping(*given: Any) -> tuple[Array, Array]:
                velocities, nodes = meet(*given)
                return velocities + np.array([2e-3, 0, 0, 0, 0, 0]), nodes

            world._met = creeping


@mutant("rigid-bodies-creep", {"material:rigid[stack]": "creep / size"})
class RigidBodiesCreep(Mutant):
    """What rests wanders off by two millimetres a second."""

    session = Creeping


class Winding(Session):
    def advance_to(self, time: float) -> StepReport:
        report = super().advance_to(time)
        world = _world(self)
        if world is not None:
            world.state = replace(world.state, spins=1.001 * world.state.spins)
        return report


@mutant("rigid-bodies-wind-up", {"material:rigid[spin]": "kinetic energy / start - 1"})
class RigidBodiesWindUp(Mutant):
    """What spins does so faster and faster."""

    session = Winding


class Summed(Session):
    def read(self, fields: frozenset[Field]) -> PointState:
        state = super().read(fields)
        if _world(self) is None:
            return state
        middle = state.positions.mean(axis=0)
        # As much as Euler's rule on a circle makes of it: every step leaves the circle along its tangent.
        return replace(state, positions=middle + (1 + 1e-4 * self.time) * (state.positions - middle))


@mutant("rigid-bodies-grow", {"material:rigid[spin]": "change of distances / size"})
class RigidBodiesGrow(Mutant):
    """Their rotation is summed up and never made one again."""

    session = Summed


@mutant(
    "parts-fall-off",
    {"rigid-parts[hang]": "stretch / closed form - 1", "rigid-parts[fly]": "farther apart"},
)
class PartsFallOff(Mutant):
    """Rigid parts of bodies that deform are bodies like others."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, rigid_parts={})


class Straying(Session):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        side = getattr(self.inner, "_rigid", None)
        if side is not None:
            nothing = np.zeros(0, dtype=np.int64)
            welds = replace(side.welds, rows=nothing, parts=nothing, starts=np.zeros((0, 3)))
            self.inner._rigid = replace(side, welds=welds)


@mutant("parts-stray", {"rigid-parts[fly]": "farther apart"})
class PartsStray(Mutant):
    """Velocities alone hold rigid parts, and nobody looks where they are."""

    session = Straying
