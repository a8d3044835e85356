"""A block that meets a floor faster than sound in it, run through the contract; it measures and does not judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gasp_conformance import oracles
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.subject import Subject
from gasp_conformance.wall_cases import floor_of
from gasp_conformance.watched_runs import WatchedRun, watch_run
from gasp_core.contract import Collider, Elastic, EngineAccuracy, Metal, NeoHookean, PointProblem, PointState

__all__ = ["Impact", "block_meets_floor"]

_SIDE, _CELLS = 0.3, 4
_CRUSHED = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """What became of the block.

    Parameters
    ----------
    run
        As far as it came.
    thickness
        Of its smallest extent at the last frame, over its side.
    energy
        Its largest kinetic energy, over that of the throw and of the fall.
    crushed
        The share of points without a volume, or inside out, at the last frame; 0 where the engine shows none.
    """

    run: WatchedRun
    thickness: float
    energy: float
    crushed: float


def block_meets_floor(subject: Subject, material: Elastic | NeoHookean | Metal, mach: float) -> Impact:
    """A block is thrown at a floor, at `mach` times the speed of sound along a bar, and watched while it rings."""
    spacing, gravity = _SIDE / _CELLS, 9.81
    sound = oracles.bar_speed(material.youngs_modulus, material.density)
    speed = mach * sound
    # Two cells above the floor, which nothing feels from so far.
    block = box_of_points((0.011, 0.007, 2 * spacing), (_CELLS,) * 3, spacing)
    problem = PointProblem(
        points=cloud_of([block], [np.array([0.0, 0.0, -speed])], spacing),
        materials=(material,),
        colliders=(Collider(shape=floor_of(subject)),),
        gravity=(0.0, 0.0, -gravity),
    )
    duration = 2 * spacing / speed + 3 * _SIDE / sound
    run = watch_run(subject, problem, EngineAccuracy(spacing=spacing), np.linspace(0, duration, 25)[1:])
    last = run.states[-1]
    given = speed**2 + 2 * gravity * float(block[:, 2].max())
    return Impact(
        run=run,
        thickness=float(np.ptp(last.positions, axis=0).min() / np.ptp(block[:, 0])),
        energy=max(_square_speed(state) for state in run.states) / given,
        crushed=_crushed(last),
    )


def _square_speed(state: PointState) -> float:
    return 0.0 if state.velocities is None else float((state.velocities**2).sum(axis=1).mean())


def _crushed(state: PointState) -> float:
    if state.deformation_gradients is None:
        return 0.0
    return float((np.linalg.det(state.deformation_gradients) <= _CRUSHED).mean())
