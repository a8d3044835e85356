"""V16: what must not change the answer: turning, shifting, renumbering, splitting points, other units, a second run.

No closed form is needed, so the scenes may be as irregular as one likes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from gasp_conformance import oracles
from gasp_conformance.scenes import shared_scene, thrown_block
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import Elastic, EngineAccuracy, HalfSpace, Pinned, PointProblem

__all__ = [
    "ACROSS_THE_GRID",
    "AFTER_CONTACT",
    "FAR_BODY",
    "SOLVER_TOLERANCE",
    "SMOOTH",
    "Change",
    "Departure",
    "departure_after_contact",
    "departure_held",
    "departure_of_modes",
    "departure_smooth",
]

Array = NDArray[Any]

SOLVER_TOLERANCE = 1e-12
"""Asked of engines that iterate: what they leave undone in hundreds of substeps is then far below what a fault does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A problem, the accuracy to run it with, and when it ends [s]."""

    problem: PointProblem
    accuracy: EngineAccuracy
    end: float


Back = Callable[[Array], Array]
"""Positions (N', 3) [m] of a changed trial, as those of the unchanged one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Something that must not change the answer.

    Parameters
    ----------
    name
        Of the check's parameter.
    apply
        The changed trial, and the way back from its positions.
    """

    name: str
    apply: Callable[[Trial], tuple[Trial, Back]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """Largest distance of a point from where it was without the change, over the body's size; substeps taken."""

    distance: float
    substep_count: int


def _with_points(trial: Trial, **arrays: ArrayLike) -> Trial:
    return replace(trial, problem=replace(trial.problem, points=replace(trial.problem.points, **arrays)))


def _with_rows(trial: Trial, rows: Array, share: float = 1.0) -> Trial:
    """These rows of the points, each with that share of its volume."""
    points = trial.problem.points
    return _with_points(
        trial,
        reference_positions=points.reference_positions[rows],
        initial_velocities=points.initial_velocities[rows],
        reference_volumes=points.reference_volumes[rows] * share,
        material_ids=points.material_ids[rows],
        body_ids=points.body_ids[rows],
    )


def _again() -> Change:
    """Nothing."""
    return Change(name="second run", apply=lambda trial: (trial, lambda positions: positions))


def _turn(name: str, rotation_vector: Sequence[float]) -> Change:
    """About the origin by a vector [rad]; a floor in z = 0 is turned into itself by turns about z."""
    matrix = Rotation.from_rotvec(rotation_vector).as_matrix()
    # Quarter turns are to be exact: their cosines and sines are whole numbers.
    whole = np.round(matrix)
    matrix = whole if np.allclose(matrix, whole, atol=1e-12) else matrix

    def apply(trial: Trial) -> tuple[Trial, Back]:
        points = trial.problem.points
        x, y, z = matrix @ np.asarray(trial.problem.gravity)
        turned = _with_points(
            trial,
            reference_positions=points.reference_positions @ matrix.T,
            initial_velocities=points.initial_velocities @ matrix.T,
        )
        turned = replace(turned, problem=replace(turned.problem, gravity=(x, y, z)))
        return turned, lambda positions: positions @ matrix

    return Change(name=name, apply=apply)


def _shift(name: str, cells: Sequence[float]) -> Change:
    """By so many grid cells along each axis; along the floor if there is one."""

    def apply(trial: Trial) -> tuple[Trial, Back]:
        offset = np.asarray(cells) * trial.accuracy.spacing_for(trial.problem.points.size)
        moved = _with_points(trial, reference_positions=trial.problem.points.reference_positions + offset)
        return moved, lambda positions: positions - offset

    return Change(name=name, apply=apply)


def _renumber(seed: int) -> Change:
    """The points in another order."""

    def apply(trial: Trial) -> tuple[Trial, Back]:
        order = np.random.default_rng(seed).permutation(len(trial.problem.points))
        return _with_rows(trial, order), lambda positions: positions[np.argsort(order)]

    return Change(name="order of points", apply=apply)


def _split() -> Change:
    """Every point as two at the same place, each of half its volume."""

    def apply(trial: Trial) -> tuple[Trial, Back]:
        rows = np.repeat(np.arange(len(trial.problem.points)), 2)
        return _with_rows(trial, rows, 0.5), lambda positions: positions[::2]

    return Change(name="duplicated points", apply=apply)


def _company(name: str, cells: float) -> Change:
    """A copy of all bodies so many cells along x, which meets nothing of the others."""

    def apply(trial: Trial) -> tuple[Trial, Back]:
        count = len(trial.problem.points)
        both = _with_rows(trial, np.tile(np.arange(count), 2))
        points = both.problem.points
        away = np.outer(np.arange(2 * count) >= count, (cells, 0.0, 0.0))
        offset = away * trial.accuracy.spacing_for(trial.problem.points.size)
        others = (np.arange(2 * count) >= count) * (1 + int(points.body_ids.max()))
        both = _with_points(
            both,
            reference_positions=points.reference_positions + offset,
            body_ids=points.body_ids + others,
        )
        return both, lambda positions: positions[:count]

    return Change(name=name, apply=apply)


def _units(factor: float) -> Change:
    """L -> s L, E -> s E, t -> sqrt(s) t at one density and gravity: the equations of motion stay what they are."""

    def apply(trial: Trial) -> tuple[Trial, Back]:
        points, root = trial.problem.points, math.sqrt(factor)
        scaled = _with_points(
            trial,
            reference_positions=points.reference_positions * factor,
            initial_velocities=points.initial_velocities * root,
            reference_volumes=points.reference_volumes * factor**3,
        )
        (material,) = trial.problem.materials
        assert isinstance(material, Elastic)
        stiffened = replace(material, youngs_modulus=material.youngs_modulus * factor)
        spacing, substep = trial.accuracy.spacing, trial.accuracy.substep
        assert spacing is not None and substep is not None
        larger = Trial(
            problem=replace(scaled.problem, materials=(stiffened,)),
            accuracy=replace(trial.accuracy, spacing=spacing * factor, substep=substep * root),
            end=trial.end * root,
        )
        return larger, lambda positions: positions / factor

    return Change(name=f"units of {factor:g} m", apply=apply)


_QUARTER = math.pi / 2
FAR_BODY = _company("a body far away", 20)
_AFTER_ALL = (
    FAR_BODY,
    _turn("quarter turn about z", (0.0, 0.0, _QUARTER)),
    _shift("shift by whole cells", (5, -3, 0)),
    _renumber(seed=16),
    _split(),
    _again(),
    _units(10.0),
)

SMOOTH = (
    *_AFTER_ALL,
    _turn("quarter turn about y", (0.0, _QUARTER, 0.0)),
    # x to y to z to x: every axis takes the place of another.
    _turn("axes exchanged", tuple(np.full(3, 2 * math.pi / 3 / math.sqrt(3)))),
)
"""Leaves smooth motion what it is, up to rounding."""

AFTER_CONTACT = _AFTER_ALL
"""Leaves a block on a floor in z = 0 what it is, up to rounding."""

ACROSS_THE_GRID = (
    _turn("turn by 0.7 rad", (0.3, 0.5, 0.4)),
    _shift("shift by parts of cells", (0.31, 0.17, -0.43)),
)
"""Changes how the body lies in the grid, and with that what the grid is off by."""


def _smooth_trial(cells: int) -> Trial:
    scene = shared_scene("v16_smooth")
    problem = scene.problem(cells)
    places = problem.points.reference_positions
    arm = places - places.mean(axis=0)
    # On top of its rigid motion: stretch along x, squeeze along y and z, and shear, so that no direction is special.
    rate = scene.numbers["stretch_rate"] * np.array([[1.0, 0.4, 0.0], [0.0, -0.5, 0.3], [0.2, 0.0, -0.5]])
    trial = Trial(
        problem=problem,
        accuracy=replace(scene.accuracy(cells), substep=scene.fixed_substep(cells)),
        end=scene.numbers["substeps"] * scene.fixed_substep(scene.cells[0]),
    )
    return _with_points(trial, initial_velocities=problem.points.initial_velocities + arm @ rate.T)


def _departure(subject: Subject, trial: Trial, change: Change) -> Departure:
    journal = Journal()
    trial = replace(trial, accuracy=replace(trial.accuracy, solver_tolerance=SOLVER_TOLERANCE))
    changed, back = change.apply(trial)
    (plain,) = subject.states(trial.problem, trial.accuracy, [trial.end], (), journal)
    (other,) = subject.states(changed.problem, changed.accuracy, [changed.end])
    distance = np.linalg.norm(back(other.positions) - plain.positions, axis=1).max()
    return Departure(distance=float(distance) / trial.problem.points.size, substep_count=journal.substep_count)


def departure_smooth(subject: Subject, change: Change, cells: int) -> Departure:
    """A block of no symmetry turns, stretches and wobbles without weight, with and without the change."""
    return _departure(subject, _smooth_trial(cells), change)


def departure_held(subject: Subject, change: Change, cells: int) -> Departure:
    """The same block, which a region holds that its lowest points lie against and none is in."""
    trial = _smooth_trial(cells)
    places = trial.problem.points.reference_positions
    under = HalfSpace(point=(0.0, 0.0, float(places[:, 2].min()) - 0.01 * trial.problem.points.size), normal=(0, 0, 1))
    held = replace(trial.problem, drives=(Pinned(region=under),))
    return _departure(subject, replace(trial, problem=held), change)


def departure_of_modes(subject: Subject, change: Change, cells: int) -> Departure:
    """A cube rings in the first mode of every axis (V3 three times over), with and without the change."""
    scene = shared_scene("v16_modes")
    material = scene.material
    assert isinstance(material, Elastic)
    frequency = oracles.bar_frequency(scene.length, oracles.bar_speed(material.youngs_modulus, material.density))
    (cube,) = scene.places(cells)
    along = (cube - scene.bodies[0].corner) / scene.length
    velocities = scene.numbers["amplitude"] * 2 * np.pi * frequency * np.cos(np.pi * along)
    trial = Trial(
        problem=scene.problem(cells, [velocities]),
        accuracy=replace(scene.accuracy(cells), substep=scene.fixed_substep(cells)),
        end=scene.numbers["periods"] / frequency,
    )
    return _departure(subject, trial, change)


def departure_after_contact(subject: Subject, change: Change, cells: int) -> Departure:
    """A spinning block is thrown obliquely onto a floor with friction, with and without the change."""
    throw = thrown_block(shared_scene("thrown_block").material, cells)
    return _departure(subject, Trial(problem=throw.problem, accuracy=throw.accuracy, end=throw.end), change)
