"""What rigid bodies do that keep their shape: they roll, bounce, hand on what they have, and spin for long."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_conformance.body_cases import best_rotation
from gasp_conformance.clouds import box_of_points, cloud_of, point_volume
from gasp_conformance.observables import kinetic_energy
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_conformance.wall_cases import floor_of
from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    EngineAccuracy,
    Field,
    Material,
    PointProblem,
    Rigid,
    Side,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.stepping.body_shape import BodyShape

__all__ = [
    "Bounce",
    "Cradle",
    "Lying",
    "Roll",
    "balls_hand_on",
    "block_lies_in",
    "block_spins_on",
    "body_bounces",
    "body_rolls",
]

Array = NDArray[Any]

GRAVITY = 9.81
_SPACING = 0.05
_CELLS = 4
_RADIUS = _CELLS * _SPACING / 2
_FINE = 16
"""Nodes of the shape to a radius."""
_WAY = 1.0
"""To be rolled [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Roll:
    """A round body on a slope.

    Parameters
    ----------
    way
        Over the closed form's.
    stepping
        What Euler's rule adds to that way: a step over the time it takes.
    """

    way: float
    stepping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounce:
    """A ball that falls onto a floor and comes up again.

    Parameters
    ----------
    ratio
        Of the speeds after and before.
    stepping
        What of a speed a step takes or gives: the fall of a step over the speed of the impact.
    """

    ratio: float
    stepping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cradle:
    """Three equal balls in a row, the first of which runs into the others, with restitution 1.

    Parameters
    ----------
    speeds : (3,)
        Over that of the first at the start.
    energy
        Over that of the start.
    momentum
        Its change, over that of the start.
    substep_count
        Steps it took.
    """

    speeds: Array
    energy: float
    momentum: float
    substep_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Lying:
    """A rigid cube in matter that flows.

    Parameters
    ----------
    sinking
        How much deeper it is than a liquid of the matter's weight would have it [cells].
    within
        How deep in it the deepest point of the matter is [cells].
    """

    sinking: float
    within: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cylinder:
    """A lying cylinder, its axis along y."""

    kind: ClassVar[str] = "cylinder"
    center: tuple[float, float, float]
    radius: float
    half_length: float

    def signed_distance(self, positions: Array) -> Array:
        """See `gasp_core.contract.Shape`."""
        x, y, z = (positions - np.asarray(self.center)).T
        beyond = np.stack([np.hypot(x, z) - self.radius, np.abs(y) - self.half_length])
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=0) + np.minimum(beyond.max(axis=0), 0.0)

    def outward_normal(self, positions: Array) -> Array:
        """See `gasp_core.contract.Shape`; across the axis, but where an end is nearer."""
        arms = positions - np.asarray(self.center)
        around = arms * [1.0, 0.0, 1.0]
        aside = np.abs(arms[:, 1]) - self.half_length > np.hypot(arms[:, 0], arms[:, 2]) - self.radius
        around[aside] = [0.0, 1.0, 0.0] * np.sign(arms[aside])
        length = np.linalg.norm(around, axis=1, keepdims=True)
        return np.where(length > 0, around / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])


def _round(shape: str, place: tuple[float, float, float], body: int) -> tuple[Array, BodyShape]:
    """Points of a ball or a lying cylinder, and its surface."""
    x, y, z = place
    half = _RADIUS if shape == "ball" else 2 * _RADIUS
    box = box_of_points((x - _RADIUS, y - half, z - _RADIUS), (_CELLS, round(2 * half / _SPACING), _CELLS), _SPACING)
    region: Any = SphereShape(center=place, radius=_RADIUS)
    if shape == "cylinder":
        region = _Cylinder(center=place, radius=_RADIUS, half_length=half)
    low, high = np.subtract(place, (_RADIUS, half, _RADIUS)), np.add(place, (_RADIUS, half, _RADIUS))
    field = SignedDistanceField.sampled(region, tuple(low), tuple(high), _RADIUS / _FINE)
    return box[region.signed_distance(box) <= 0], BodyShape(body=body, shape=field)


def _inertia_share(points: Array) -> float:
    """I / (m R^2) about y of cubes that stand at points (N, 3)."""
    arms = points - points.mean(axis=0)
    return float((arms[:, [0, 2]] ** 2).sum(axis=1).mean() + point_volume(_SPACING) ** (2 / 3) / 6) / _RADIUS**2


def body_rolls(subject: Subject, shape: str, slope: float, friction: float) -> Roll:
    """A ball or a cylinder, let go on a slope [rad], which goes down it for a metre.

    It rolls with g sin / (1 + I / m R^2), which is 5/7 and 2/3 of g sin for bodies without cubes, up to a slope of
    tan = mu (1 + m R^2 / I); beyond that it slips and goes with g (sin - mu cos).
    """
    points, surface = _round(shape, (0.0, 0.0, _RADIUS), 0)
    problem = PointProblem(
        points=cloud_of([points], [(0.0, 0.0, 0.0)], _SPACING),
        materials=(Rigid(density=500.0),),
        colliders=(Collider(shape=floor_of(subject), friction=friction),),
        gravity=(GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope)),
        hints=(surface,),
    )
    share = _inertia_share(points)
    pull = GRAVITY * math.sin(slope)
    rolling = pull / (1 + share)
    if math.tan(slope) > friction * (1 + 1 / share):
        rolling = pull - friction * GRAVITY * math.cos(slope)
    time = math.sqrt(2 * _WAY / rolling)
    journal = Journal()
    (state,) = subject.states(problem, EngineAccuracy(spacing=_SPACING), [time], (), journal)
    gone = float((state.positions - points).mean(axis=0)[0])
    return Roll(way=gone / _WAY, stepping=journal.largest_substep / time)


def body_bounces(subject: Subject, restitution: float) -> Bounce:
    """A ball that falls onto a floor from three radii above it."""
    height = 3 * _RADIUS
    points, surface = _round("ball", (0.0, 0.0, _RADIUS + height), 0)
    problem = PointProblem(
        points=cloud_of([points], [(0.0, 0.0, 0.0)], _SPACING),
        materials=(Rigid(density=500.0, restitution=restitution),),
        colliders=(Collider(shape=floor_of(subject)),),
        gravity=(0.0, 0.0, -GRAVITY),
        hints=(surface,),
    )
    speed = math.sqrt(2 * GRAVITY * height)
    fall = speed / GRAVITY
    # Half of the time that it takes to the top, or would with all of its speed.
    since = 0.5 * (restitution or 1.0) * speed / GRAVITY
    journal = Journal()
    (state,) = subject.states(problem, EngineAccuracy(spacing=_SPACING), [fall + since], (), journal)
    risen = float((state.positions - points).mean(axis=0)[2]) + height
    found = risen + 0.5 * GRAVITY * since**2 if restitution else max(risen, 0.0)
    return Bounce(ratio=found / (speed * since), stepping=GRAVITY * journal.largest_substep / speed)


def balls_hand_on(subject: Subject) -> Cradle:
    """Newton's cradle of three, a tenth of a cell between them, without weight."""
    gap = 0.1 * _SPACING
    places = [(-4 * _RADIUS, 0.0, 0.0), (0.0, 0.0, 0.0), (2 * _RADIUS + gap, 0.0, 0.0)]
    balls = [_round("ball", place, number) for number, place in enumerate(places)]
    problem = PointProblem(
        points=cloud_of([points for points, _ in balls], [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)], _SPACING),
        materials=(Rigid(density=500.0, restitution=1.0),),
        body_contact=BodyContact(),
        gravity=NO_GRAVITY,
        hints=tuple(surface for _, surface in balls),
    )
    masses, start, ids = problem.masses, problem.points.initial_velocities, problem.points.body_ids
    journal = Journal()
    accuracy = EngineAccuracy(spacing=_SPACING)
    *_, state = subject.states(problem, accuracy, [0.1, 4 * _RADIUS], {Field.VELOCITIES}, journal)
    given = masses @ start
    return Cradle(
        speeds=np.array([state.velocities[ids == body, 0].mean() for body in range(3)]),
        energy=kinetic_energy(masses, state.velocities) / kinetic_energy(masses, start),
        momentum=float(np.linalg.norm(masses @ state.velocities - given) / np.linalg.norm(given)),
        substep_count=journal.substep_count,
    )


def block_lies_in(subject: Subject, material: Material, density: float, time: float) -> Lying:
    """A rigid cube of four cells in a box of matter that flows, as deep in it as the same weight of a liquid is.

    Parameters
    ----------
    material
        What it lies in.
    density
        Of the cube [kg/m^3].
    time
        When it is looked at [s].
    """
    width, depth, side = 8, 5, 4
    share = density / material.density
    top = depth * _SPACING
    low = top - share * side * _SPACING
    bed = box_of_points((0.0, 0.0, 0.0), (width, width, depth), _SPACING)
    cube = box_of_points(((width - side) / 2 * _SPACING, (width - side) / 2 * _SPACING, low), (side,) * 3, _SPACING)
    middle = cube.mean(axis=0)
    bed = bed[np.abs(bed - middle).max(axis=1) > side * _SPACING / 2]
    half = width * _SPACING / 2
    problem = PointProblem(
        points=cloud_of([bed, cube], [(0.0, 0.0, 0.0)] * 2, _SPACING, range(2)),
        materials=(material, Rigid(density=density)),
        colliders=(
            Collider(shape=BoxShape(center=(half, half, 2.0), half_extents=(half, half, 2.0)), side=Side.INSIDE),
        ),
        body_contact=BodyContact(),
        gravity=(0.0, 0.0, -GRAVITY),
    )
    own = problem.points.body_ids == 1
    *_, state = subject.states(problem, EngineAccuracy(spacing=_SPACING), np.linspace(time / 4, time, 4))
    place = state.positions[own].mean(axis=0)
    turn = best_rotation(cube, state.positions[own])
    inside = np.abs((state.positions[~own] - place) @ turn).max(axis=1)
    return Lying(
        sinking=float(middle[2] - place[2]) / _SPACING,
        within=float(side / 2 - inside.min() / _SPACING),
    )


def block_spins_on(subject: Subject, turns: float, substeps: int) -> tuple[float, float, int]:
    """A block with three moments of inertia that spins and tumbles on, without weight.

    Returns
    -------
    Largest change of a distance between points, over the size; largest change of kinetic energy, relative; and how many
    steps it took.
    """
    block = box_of_points((0.0, 0.0, 0.0), (5, 3, 1), _SPACING)
    # Between the axes: such a body does not turn about one line.
    spin = np.array([6.0, 9.0, 12.0])
    problem = PointProblem(
        points=cloud_of([block], [np.cross(spin, block - block.mean(axis=0))], _SPACING),
        materials=(Rigid(density=700.0),),
        gravity=NO_GRAVITY,
    )
    time = turns * 2 * math.pi / float(np.linalg.norm(spin))
    journal = Journal()
    accuracy = EngineAccuracy(spacing=_SPACING, substep=time / substeps)
    far = block[[0, -1]]
    size = float(np.linalg.norm(np.ptp(block, axis=0)))
    before = [np.linalg.norm(block - one, axis=1) for one in far]
    # A share of the energy is not seen: that of the cubes' own spin. What is seen goes back and forth with it.
    change, energies = 0.0, list[float]()
    masses = problem.masses
    own = point_volume(_SPACING) ** (2 / 3) / 6
    for state in subject.states(problem, accuracy, np.linspace(0, time, 21)[1:], {Field.VELOCITIES}, journal):
        after = [np.linalg.norm(state.positions - state.positions[row], axis=1) for row in (0, -1)]
        change = max(change, *(float(np.abs(a - b).max()) / size for a, b in zip(after, before)))
        energies.append(_energy(masses, state.positions, state.velocities, own))
    first = _energy(masses, block, problem.points.initial_velocities, own)
    return change, max(abs(energy / first - 1) for energy in energies), journal.substep_count


def _energy(masses: Array, positions: Array, velocities: Array, own: float) -> float:
    """Kinetic energy [J] of points that move as a rigid body, and of the spin that each has about itself."""
    arms = positions - positions.mean(axis=0)
    moving = velocities - velocities.mean(axis=0)
    # v = w x r gives the spin back by least squares: sum (|r|^2 I - r r^T) w = sum r x v.
    squares = arms.T @ arms
    spin = np.linalg.solve(np.trace(squares) * np.eye(3) - squares, np.cross(arms, moving).sum(axis=0))
    return kinetic_energy(masses, velocities) + 0.5 * float(masses.sum()) * own * float(spin @ spin)
