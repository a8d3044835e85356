"""Matter that flows far: whether the step decides where it goes, and what becomes of a liquid's volume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import Subject
from gasp_core.contract import Collider, EngineAccuracy, Field, Fluid, HalfSpace, Material, PointProblem

__all__ = ["Slosh", "heights_in_two_steps", "tank_sloshes"]

Array = NDArray[Any]

_GRAVITY = 9.81
_QUARTER = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Slosh:
    """What a tank is like some time after a column of water broke in it.

    Parameters
    ----------
    level_error
        By how much the mean height is below that of still water, in grid cells, or above what it is at most while water
        swings.
    kinetic_energy
        What is left of the energy that was set free, as a share.
    outside
        The share of points that are more than a third of a cell behind a wall.
    """

    level_error: float
    kinetic_energy: float
    outside: float


def heights_in_two_steps(subject: Subject, material: Material, friction: float) -> tuple[float, float]:
    """Mean height [m] of a block that fell apart on a floor: in the whole stable step, and in a quarter of it."""
    cells = 4
    side, fall, duration = 0.32, 0.05, 0.35
    spacing = side / cells
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=friction)
    block = box_of_points((0.013, 0.021, fall), (cells, cells, cells), spacing)
    problem = PointProblem(
        points=cloud_of([block], [np.zeros(3)], spacing),
        materials=(material,),
        colliders=(floor,),
        gravity=(0.0, 0.0, -_GRAVITY),
    )
    heights: list[float] = []
    for fraction in (1.0, _QUARTER):
        accuracy = EngineAccuracy(spacing=spacing, substep_fraction=fraction)
        (state,) = subject.states(problem, accuracy, [duration])
        heights.append(float(state.positions[:, 2].mean()))
    return heights[0], heights[1]


def tank_sloshes(subject: Subject, material: Fluid) -> Slosh:
    """A column of water breaks in a closed tank, a metre wide, of walls that water may leave."""
    cells, duration = 12, 6.0
    width, depth, height = 1.0, 0.25, 1.0
    spacing = width / cells
    column = box_of_points((0.0, 0.0, 0.0), (cells // 2, cells // 4, cells // 2), spacing)
    planes = [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, height), (0.0, 0.0, -1.0)),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ((width, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.0, depth, 0.0), (0.0, -1.0, 0.0)),
    ]
    problem = PointProblem(
        points=cloud_of([column], [np.zeros(3)], spacing),
        materials=(material,),
        colliders=tuple(Collider(shape=HalfSpace(point=point, normal=normal)) for point, normal in planes),
        gravity=(0.0, 0.0, -_GRAVITY),
    )
    # The first swing, a metre there and back at sqrt(g H), takes 1.3 s: two of them at the end.
    times = np.append(duration / 4, np.linspace(duration - 2.6, duration, 27)[1:])
    _, *states = subject.states(problem, EngineAccuracy(spacing=spacing), times, {Field.VELOCITIES})
    # Twice as wide, half as high; it sinks a little under its own weight.
    level = 0.25
    still = oracles.fluid_column_heights(
        column[:, 2] / 2, level, material.density, _GRAVITY, material.bulk_modulus
    ).mean()
    swing = float(np.mean([(state.velocities**2).sum(axis=1).mean() for state in states])) / (2 * _GRAVITY)
    mean = float(np.mean([state.positions[:, 2].mean() for state in states]))
    places = states[-1].positions
    behind = np.maximum(-places, places - [width, depth, height]).max(axis=1)
    return Slosh(
        # Of a wave as much is raised as is moving; currents raise nothing.
        level_error=max(still - mean, mean - swing - still, 0.0) / spacing,
        kinetic_energy=swing / float(column[:, 2].mean() - still),
        outside=float((behind > spacing / 3).mean()),
    )
