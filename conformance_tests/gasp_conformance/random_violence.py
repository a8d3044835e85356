"""What is done to a random cloud on purpose: thrown at a wall, pressed flat, torn in two, spun."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    Collider,
    ContactCondition,
    Driven,
    EngineCapabilities,
    HalfSpace,
    Pinned,
    PointProblem,
    Vector,
)

__all__ = ["VIOLENCE", "Victim"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Victim:
    """A problem, and what one has to know to do something violent to it.

    Parameters
    ----------
    problem
        As it was drawn.
    direction : (3,)
        Along which it happens, a unit vector.
    wave
        Speed of sound [m/s].
    end
        When it is over [s].
    """

    problem: PointProblem
    direction: Array
    wave: float
    end: float

    @property
    def heights(self) -> Array:
        """Of the points along the direction, (N,) [m]."""
        return self.problem.points.reference_positions @ self.direction

    def plane(self, height: float, sign: float) -> HalfSpace:
        """What lies below a height along the direction, with a normal along it, or above, with one against it."""
        x, y, z = (float(value) for value in self.direction * height)
        a, b, c = (float(value) for value in sign * self.direction)
        return HalfSpace(point=(x, y, z), normal=(a, b, c))

    def thrown(self, velocities: Array) -> PointProblem:
        """The problem with other velocities (N, 3) [m/s] at the start."""
        return replace(self.problem, points=replace(self.problem.points, initial_velocities=velocities))


def _impact(rng: np.random.Generator, can: EngineCapabilities, victim: Victim) -> PointProblem | None:
    """Against a wall, at up to ten times the speed of sound."""
    if HalfSpace not in can.collider_shapes or ContactCondition.SEPARATE not in can.contact_conditions:
        return None
    speed = victim.wave * float(0.3 * 30 ** rng.random())
    gap = speed * victim.end * 0.3 * float(rng.random())
    wall = Collider(shape=victim.plane(float(victim.heights.min()) - gap, 1.0), friction=float(rng.choice([0.0, 0.5])))
    thrown = victim.thrown(np.tile(-speed * victim.direction, (len(victim.problem.points), 1)))
    return replace(thrown, colliders=(*thrown.colliders, wall))


def _held_and_drawn(can: EngineCapabilities, victim: Victim, way: float) -> PointProblem | None:
    """The lower quarter of the heights is held, the upper quarter goes a way [heights] along the direction."""
    if not {Pinned, Driven} <= can.drives or HalfSpace not in can.region_shapes:
        return None
    heights = victim.heights
    low, extent = float(heights.min()), float(np.ptp(heights))
    if extent <= 0:
        return None
    x, y, z = (float(value) for value in victim.direction * way * extent / victim.end)
    velocity: Vector = (x, y, z)
    held = Pinned(region=victim.plane(low + extent / 4, 1.0))
    drawn = Driven(region=victim.plane(low + 3 * extent / 4, -1.0), velocity=velocity)
    return replace(victim.problem, drives=(held, drawn))


def _crushing(rng: np.random.Generator, can: EngineCapabilities, victim: Victim) -> PointProblem | None:
    """Between two jaws, to half of what is between them, and until they have passed each other."""
    return _held_and_drawn(can, victim, -float(rng.uniform(0.25, 1.0)))


def _tearing(rng: np.random.Generator, can: EngineCapabilities, victim: Victim) -> PointProblem | None:
    """Drawn to up to four times its length."""
    return _held_and_drawn(can, victim, float(rng.uniform(0.5, 3.0)))


def _spin(rng: np.random.Generator, can: EngineCapabilities, victim: Victim) -> PointProblem | None:
    """About an axis, so that the rim goes at up to three times the speed of sound."""
    arms = victim.problem.points.reference_positions - victim.problem.points.reference_positions.mean(axis=0)
    around = np.cross(victim.direction, arms)
    rim = float(np.linalg.norm(around, axis=1).max())
    if rim <= 0:
        return None
    return victim.thrown(victim.wave * float(0.1 * 30 ** rng.random()) / rim * around)


VIOLENCE: Mapping[str, Callable[[np.random.Generator, EngineCapabilities, Victim], PointProblem | None]] = (
    MappingProxyType({"impact": _impact, "crushing": _crushing, "tearing": _tearing, "spin": _spin})
)
"""By name, what makes another problem of one; None where the engine does not declare what it takes, or nothing can."""
