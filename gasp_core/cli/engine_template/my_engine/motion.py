"""The physics: rigid bodies in free flight, as pure functions over arrays. Your own solver takes the place of this.

Every body is moved by its centre and a turn about it; its points go where these take them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem

__all__ = ["Bodies", "Motion", "allowed_step", "bodies_of", "flown", "places", "pushed", "velocities"]

Array = NDArray[Any]

_TURN = 0.2
"""Radians of a step at most, before `EngineAccuracy.substep_fraction`; nothing else limits a step in free flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bodies:
    """What stays as it is: N points, B bodies.

    Parameters
    ----------
    rows : (N,)
        Which body a point belongs to.
    masses : (N,) [kg]
    arms : (N, 3) [m]
        From the centre of the body, before it turns.
    totals : (B,) [kg]
    mobilities : (B, 3, 3) [1/(kg m^2)]
        Inverse of the inertia, before the body turns; 0 about an axis that all of its points lie on.
    """

    rows: Array
    masses: Array
    arms: Array
    totals: Array
    mobilities: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What a step changes.

    Parameters
    ----------
    centers : (B, 3) [m]
    speeds : (B, 3) [m/s]
        Of the centres.
    turns : (B, 4)
        Unit quaternions, scalar first.
    spins : (B, 3) [kg m^2/s]
        Angular momenta about the centres.
    """

    centers: Array
    speeds: Array
    turns: Array
    spins: Array


def bodies_of(problem: PointProblem) -> tuple[Bodies, Motion]:
    """The bodies of a problem, and how they begin: with the momentum and the angular momentum of their points."""
    points, masses = problem.points, problem.masses
    _, first, rows = np.unique(points.body_ids, return_index=True, return_inverse=True)
    count = len(first)
    totals = _summed(masses, rows, count)
    # From a place of its own, so that a body far from the origin is as exact as one at it.
    origins = points.reference_positions[first]
    offsets = points.reference_positions - origins[rows]
    middles = _summed(masses[:, None] * offsets, rows, count) / totals[:, None]
    arms = offsets - middles[rows]
    momenta = masses[:, None] * points.initial_velocities
    squares = (arms**2).sum(axis=1)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None, :]
    inertia = _summed(masses[:, None, None] * squares, rows, count)
    bodies = Bodies(
        rows=rows,
        masses=masses,
        arms=arms,
        totals=totals,
        mobilities=np.linalg.pinv(inertia, rcond=1e-9, hermitian=True),
    )
    motion = Motion(
        centers=origins + middles,
        speeds=_summed(momenta, rows, count) / totals[:, None],
        turns=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        spins=_summed(np.cross(arms, momenta), rows, count),
    )
    return bodies, motion


def allowed_step(bodies: Bodies, motion: Motion) -> float:
    """The longest step [s] that is still accurate; inf where nothing turns."""
    fastest = float(np.linalg.norm(_rates(bodies, motion.turns, motion.spins), axis=1).max())
    return _TURN / fastest if fastest > 0 else np.inf


def flown(bodies: Bodies, motion: Motion, gravity: Array, step: float) -> Motion:
    """The motion `step` [s] later: a parabola is exact, and turning is of second order, by its rate half-way."""
    half = _turned_on(motion.turns, _rates(bodies, motion.turns, motion.spins), step / 2)
    return Motion(
        centers=motion.centers + step * motion.speeds + step**2 / 2 * gravity,
        speeds=motion.speeds + step * gravity,
        turns=_turned_on(motion.turns, _rates(bodies, half, motion.spins), step),
        spins=motion.spins,
    )


def pushed(bodies: Bodies, motion: Motion, struck: Array, change: Array) -> Motion:
    """The motion once the points `struck`, (N,) of bool, have each been given the velocity `change`, (3,) [m/s]."""
    count = len(bodies.totals)
    given = (bodies.masses * struck)[:, None] * change
    arms = _rotated(motion.turns[bodies.rows], bodies.arms)
    return replace(
        motion,
        speeds=motion.speeds + _summed(given, bodies.rows, count) / bodies.totals[:, None],
        spins=motion.spins + _summed(np.cross(arms, given), bodies.rows, count),
    )


def places(bodies: Bodies, motion: Motion) -> Array:
    """Where the points are, (N, 3) [m]."""
    return motion.centers[bodies.rows] + _rotated(motion.turns[bodies.rows], bodies.arms)


def velocities(bodies: Bodies, motion: Motion) -> Array:
    """Of the points, (N, 3) [m/s]."""
    arms = _rotated(motion.turns[bodies.rows], bodies.arms)
    rates = _rates(bodies, motion.turns, motion.spins)
    return motion.speeds[bodies.rows] + np.cross(rates[bodies.rows], arms)


def _rates(bodies: Bodies, turns: Array, spins: Array) -> Array:
    """Angular velocities, (B, 3) [rad/s]."""
    own = _rotated(turns * [1, -1, -1, -1], spins)
    return _rotated(turns, np.einsum("bij,bj->bi", bodies.mobilities, own))


def _rotated(turns: Array, vectors: Array) -> Array:
    """Vectors (N, 3) turned by unit quaternions (N, 4)."""
    across = 2 * np.cross(turns[:, 1:], vectors)
    return vectors + turns[:, :1] * across + np.cross(turns[:, 1:], across)


def _turned_on(turns: Array, rates: Array, step: float) -> Array:
    """Unit quaternions (B, 4) after `step` [s] of turning at `rates` (B, 3) [rad/s]."""
    scalars, vectors = turns[:, :1], turns[:, 1:]
    on = np.hstack([-(rates * vectors).sum(axis=1, keepdims=True), scalars * rates + np.cross(rates, vectors)])
    further = turns + step / 2 * on
    return further / np.linalg.norm(further, axis=1, keepdims=True)


def _summed(values: Array, rows: Array, count: int) -> Array:
    """Sums (B, ...) of what points (N, ...) have, body by body."""
    sums = np.zeros((count, *values.shape[1:]))
    np.add.at(sums, rows, values)
    return sums
