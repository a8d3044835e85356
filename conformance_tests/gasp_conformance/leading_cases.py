"""Points that are led along trajectories: a block that swings beside one that falls, and a bar held by its end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.bounds import place_rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.specimens import NO_GRAVITY, plain_material
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import EngineAccuracy, PointProblem, Trajectories

__all__ = ["FREE_CELLS", "SPACING", "Lag", "Led", "led_block", "shaken_bar"]

Array = NDArray[Any]

SPACING = 0.1
_SINGLE = float(np.finfo(np.float32).eps) / 2
FREE_CELLS = 8
"""Of the bar, beyond the end that is led."""
_LED_CELLS = 3
_THICK = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Led:
    """Largest distances [m] of led points from where they are led, at its moments and between, and of others from their
    fall; and what rounding, the cubic between moments and substeps leave of them."""

    at_moments: float
    at_moments_allowed: float
    between: float
    between_allowed: float
    bystander: float
    bystander_allowed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """How a bar sags in the frame of its end.

    Parameters
    ----------
    deflection
        Largest of its tip where the end stands and there is weight [m].
    difference
        Largest from that where there is no weight and the end is led along the parabola of its fall, upwards [m].
    """

    deflection: float
    difference: float


def led_block(subject: Subject) -> Led:
    """A block is turned forth and back about an axis beside it, in weight; another one falls."""
    corner, away = np.array([0.37, 0.21, 0.11]), np.array([3.0, 0.0, 0.0])
    blocks = [box_of_points(corner, (2, 2, 2), SPACING), box_of_points(corner + away, (2, 2, 2), SPACING)]
    pivot, rate, amplitude, end = corner - [0.3, 0.0, 0.0], 9.0, 0.8, 0.3
    times = np.linspace(0.0, end, 13)
    count, gravity = len(blocks[0]), np.array([1.0, -2.0, -9.0])

    def places(time: float) -> Array:
        angle = amplitude * math.sin(rate * time)
        x, y, z = (blocks[0] - pivot).T
        turned = (math.cos(angle) * x + math.sin(angle) * z, y, math.cos(angle) * z - math.sin(angle) * x)
        return np.stack(turned, axis=1) + pivot

    moves = np.array([places(time) - places(0.0) for time in times])
    problem = PointProblem(
        points=cloud_of(blocks, [(0.0, 0.0, 0.0)] * 2, SPACING),
        materials=(plain_material(subject.descriptor.capabilities),),
        gravity=tuple(gravity),
        trajectories=Trajectories(rows=np.arange(count), times=times, displacements=moves),
    )
    journal = Journal()
    asked = np.sort(np.concatenate([times[1:], (times[1:] + times[:-1]) / 2]))
    states = list(subject.states(problem, EngineAccuracy(spacing=SPACING), list(asked), (), journal))
    off = np.array([np.linalg.norm(s.positions[:count] - places(t), axis=1).max() for s, t in zip(states, asked)])
    reach = max(float(np.abs(state.positions).max()) for state in states)
    # It is put where it is led at every step: nothing adds up.
    rounded = place_rounding(subject, 1, reach, 0.0) + 4 * _SINGLE * float(np.abs(moves).max())
    fall = [blocks[1] + gravity * t**2 / 2 for t in asked]
    strength, step = float(np.linalg.norm(gravity)), journal.largest_substep
    return Led(
        at_moments=float(off[1::2].max()),
        at_moments_allowed=rounded,
        between=float(off[::2].max()),
        between_allowed=_between(float(np.linalg.norm(blocks[0] - pivot, axis=1).max()), rate, amplitude, times[1])
        + rounded,
        bystander=max(float(np.abs(s.positions[count:] - way).max()) for s, way in zip(states, fall)),
        bystander_allowed=1.05 * oracles.euler_fall_error(strength, end, step)
        + place_rounding(subject, journal.substep_count, reach, strength * end**2 / 2),
    )


def _between(arm: float, rate: float, amplitude: float, step: float) -> float:
    """What a cubic between moments leaves of a swing [m].

    Slopes of parabolas are off by step^2 / 3 |x'''| at most, each of which moves the cubic by 4/27 of a step, and one
    with the right slopes is off by step^4 / 384 |x''''|. Of x = r exp(i a sin wt) no derivative is larger than
    r w^n T_n(a), T_n(a) = sum_k S(n, k) a^k (Faa di Bruno).
    """
    third = arm * rate**3 * (amplitude + 3 * amplitude**2 + amplitude**3)
    fourth = arm * rate**4 * (amplitude + 7 * amplitude**2 + 6 * amplitude**3 + amplitude**4)
    return 8 / 27 * step * step**2 / 3 * third + step**4 / 384 * fourth


def shaken_bar(subject: Subject, youngs_modulus: float, density: float) -> Lag:
    """A bar from one end of which to the other the same is seen, whether it is lifted or weighs (d'Alembert)."""
    corner = np.array([0.013, 0.007, 0.021])
    bar = box_of_points(corner, (_LED_CELLS + FREE_CELLS, _THICK, _THICK), SPACING)
    rows = np.flatnonzero(bar[:, 0] < corner[0] + _LED_CELLS * SPACING)
    length, thick = FREE_CELLS * SPACING, _THICK * SPACING
    # Euler and Bernoulli: a weight by which it hangs by a twentieth of its length, and half of its first period.
    weight = 0.05 * length * 8 * youngs_modulus * thick**2 / (12 * density * length**4)
    end = math.pi / (1.0149 * math.sqrt(youngs_modulus / density) * thick / length**2)
    times = np.linspace(0.0, end, 9)
    lift = np.array([0.3, -0.2, 1.0])
    lift *= weight / np.linalg.norm(lift)
    ways = lift * times[:, None] ** 2 / 2
    tips: list[Array] = []
    for moves, gravity in ((ways, NO_GRAVITY), (0 * ways, tuple(-lift))):
        problem = PointProblem(
            points=cloud_of([bar], [(0.0, 0.0, 0.0)], SPACING),
            materials=(plain_material(subject.descriptor.capabilities),),
            gravity=gravity,
            trajectories=Trajectories(
                rows=rows, times=times, displacements=np.repeat(moves[:, None], len(rows), axis=1)
            ),
        )
        states = subject.states(problem, EngineAccuracy(spacing=SPACING), list(times[1:]), (), Journal())
        tip = bar[:, 0] > bar[:, 0].max() - SPACING / 2
        tips.append(
            np.array([(state.positions - bar)[tip].mean(axis=0) - way for state, way in zip(states, moves[1:])])
        )
    lifted, hung = tips
    return Lag(
        deflection=float(np.linalg.norm(hung, axis=1).max()),
        difference=float(np.linalg.norm(lifted - hung, axis=1).max()),
    )
