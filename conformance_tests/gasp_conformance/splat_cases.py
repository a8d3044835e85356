"""A cloud as a splat gives it: a shell of triangles, most of them slivers, unevenly spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.clouds import ball_of_points
from gasp_conformance.specimens import plain_material
from gasp_conformance.subject import Subject
from gasp_conformance.wall_cases import floor_of
from gasp_conformance.watched_runs import WatchedRun, watch_run
from gasp_core.contract import Collider, EngineAccuracy, PointCloud, PointProblem

__all__ = ["Dropped", "slivers_fall", "slivers_on_a_ball"]

Array = NDArray[Any]

GRAVITY = 9.81
_CELLS = 8
_RADIUS = 0.25
_SPACING = 2 * _RADIUS / _CELLS
_HEIGHT = 0.2
"""[m], of the fall; it takes 0.2 s."""
_TIMES = np.linspace(0, 0.4, 21)[1:]
_BUDGET = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Dropped:
    """A shell of slivers that falls on a floor.

    Parameters
    ----------
    run
        With as many substeps a frame as it may take.
    flight_error
        Largest distance from free fall before it lands [m].
    euler_error
        What symplectic Euler with the largest substep explains of it [m].
    limit
        How many that were: twice what a ball of evenly spaced points takes.
    """

    run: WatchedRun
    flight_error: float
    euler_error: float
    limit: int


def slivers_on_a_ball(count: int, radius: float, seed: int) -> Array:
    """Vertices (3 count, 3) [m] of triangles on a ball about the origin, as of flat Gaussians.

    Their longer sides are from a thousandth to a third of the radius, and each triangle is up to a thousand times
    shorter one way than the other; a quarter of them lies within a tenth of the radius of one point.
    """
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals[: count // 4] = [1.0, 0.0, 0.0] + 0.05 * normals[: count // 4]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first = np.cross(normals, rng.normal(size=(count, 3)))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    long = radius * 10 ** rng.uniform(-3, -0.5, (count, 1))
    short = long * 10 ** rng.uniform(-3, 0, (count, 1))
    centers = radius * normals
    return np.stack([centers, centers + long * first, centers + short * np.cross(normals, first)], axis=1).reshape(
        -1, 3
    )


def _problem(subject: Subject, positions: Array, volumes: Array) -> PointProblem:
    lowest = positions[:, 2].min()
    return PointProblem(
        points=PointCloud(
            reference_positions=positions + [0.013, 0.021, _HEIGHT - lowest],
            initial_velocities=np.zeros_like(positions),
            reference_volumes=volumes,
            material_ids=np.zeros(len(positions)),
            body_ids=np.zeros(len(positions)),
        ),
        materials=(plain_material(subject.descriptor.capabilities),),
        colliders=(Collider(shape=floor_of(subject), friction=0.3),),
    )


def slivers_fall(subject: Subject) -> Dropped:
    """A shell of 120 slivers falls and lands; some points stand for a thousand times the volume of others."""
    ball = ball_of_points((0.0, 0.0, 0.0), _CELLS, _SPACING)
    even = _problem(subject, ball, np.full(len(ball), (_SPACING / 2) ** 3))
    slivers = slivers_on_a_ball(120, _RADIUS, seed=11)
    shares = 10 ** np.random.default_rng(12).uniform(-3, 0, len(slivers))
    volume = 4 / 3 * np.pi * _RADIUS**3
    uneven = _problem(subject, slivers, volume * shares / shares.sum())

    plain = watch_run(subject, even, EngineAccuracy(spacing=_SPACING), _TIMES)
    limit = _BUDGET * max((report.substep_count for report in plain.reports), default=1)
    run = watch_run(subject, uneven, EngineAccuracy(spacing=_SPACING, substep_limit=limit), _TIMES)

    # Contact is felt from up to a cell and a half above the floor.
    lands = np.sqrt(2 * max(_HEIGHT - 1.5 * _SPACING, 0.0) / GRAVITY)
    error = 0.0
    for state in run.states:
        if state.time <= lands:
            exact = oracles.free_fall(uneven.points.reference_positions, np.zeros(3), uneven.gravity, state.time)
            error = max(error, float(np.abs(state.positions - exact).max()))
    largest = max((report.largest_substep for report in run.reports), default=0.0)
    return Dropped(
        run=run,
        flight_error=error,
        euler_error=oracles.euler_fall_error(GRAVITY, float(lands), largest),
        limit=limit,
    )
