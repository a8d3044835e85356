"""What bodies do to each other: blocks that slide, part, pass, stay on each other, and collide."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.observables import kinetic_energy
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_conformance.wall_cases import floor_of, stiff_material
from gasp_core.contract import (
    BodyContact,
    Collider,
    ContactCondition,
    EngineAccuracy,
    Field,
    Material,
    PointProblem,
)

__all__ = [
    "CELLS",
    "Collision",
    "Parting",
    "Ride",
    "Stack",
    "best_rotation",
    "blocks_collide",
    "blocks_pass",
    "blocks_ride",
    "blocks_slide",
    "blocks_stack",
]

Array = NDArray[Any]

GRAVITY = 9.81
CELLS = 8
"""Along a block that slides."""
_SPACING = 0.05
_SLAB, _BLOCK, _STACKED = (16, 5, 3), (CELLS, 3, 3), (4, 4, 4)
_SPEED = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ride:
    """A block that slides on a slab, slower and slower.

    Parameters
    ----------
    deceleration
        While it slides, over the closed form's.
    way
        Where it rests, over the closed form's.
    late
        What may be missing of the deceleration, relative, because the weight has to arrive first.
    """

    deceleration: float
    way: float
    late: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting:
    """Two blocks that are near each other and have no reason to touch.

    Parameters
    ----------
    way
        Of the one that moves, over that of uniform motion.
    other
        Largest way of the other, over the same.
    """

    way: float
    other: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    """Three blocks on each other, at rest.

    Parameters
    ----------
    creep
        Largest way of a block's centre along the floor, over its size.
    sinking
        How deep the lowest points are in what they lie on, over those of the start [cells].
    height
        By how much the top is lower than squeezed by its weight, or higher [cells].
    heating
        Largest kinetic energy of the second half over that of the first.
    """

    creep: float
    sinking: float
    height: float
    heating: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """Two blocks that run into each other askew, one of them spinning.

    Parameters
    ----------
    momentum
        Change of the sum of momenta, over one block's.
    energy
        Largest kinetic energy over that of the start.
    exchanged
        How much of the first block's momentum it gave away, over what it had.
    substep_count
        Steps it took.
    """

    momentum: float
    energy: float
    exchanged: float
    substep_count: int


def blocks_slide(
    subject: Subject,
    friction: float,
    contacts: Mapping[tuple[int, int], BodyContact],
    materials: Sequence[Material] | None = None,
) -> list[Ride]:
    """Two blocks, each on a slab of its own, started at 1 m/s, the first to the left and the second to the right.

    Parameters
    ----------
    friction
        Of all bodies.
    contacts
        `PointProblem.pair_contacts`; slabs are bodies 0 and 2, the blocks on them 1 and 3.
    materials
        Of the four bodies; None: the plainest, stiff.
    """
    bodies: list[Array] = []
    velocities: list[tuple[float, float, float]] = []
    for row, way in enumerate((-1.0, 1.0)):
        aside = row * (_SLAB[1] + 4) * _SPACING
        bodies.append(box_of_points((0.0, aside, 0.0), _SLAB, _SPACING))
        start = (_SLAB[0] - _BLOCK[0]) / 2 * _SPACING
        bodies.append(box_of_points((start, aside + _SPACING, _SLAB[2] * _SPACING), _BLOCK, _SPACING))
        velocities += [(0.0, 0.0, 0.0), (way * _SPEED, 0.0, 0.0)]
    own = materials or [stiff_material(subject)] * 4
    problem = PointProblem(
        points=cloud_of(bodies, velocities, _SPACING, range(4)),
        materials=tuple(own),
        # Rough enough for the slabs to stay where they are.
        colliders=(Collider(shape=floor_of(subject), friction=2 * friction + 1),),
        body_contact=BodyContact(friction=friction),
        pair_contacts=contacts,
        gravity=(0.0, 0.0, -GRAVITY),
    )
    stop = _SPEED / (friction * GRAVITY)
    sliding = 0.7 * stop
    *_, during = subject.states(problem, _accuracy(), [sliding])
    resting = list(subject.states(problem, _accuracy(), [stop * more for more in (1.2, 1.3, 1.4)]))
    height = (_SLAB[2] + _BLOCK[2]) * _SPACING
    rides: list[Ride] = []
    for slab, way in ((0, -1.0), (2, 1.0)):
        gone = way * _relative(problem, [during], slab)[0, 0]
        rest = way * _relative(problem, resting, slab)[:, 0].mean()
        rides.append(
            Ride(
                deceleration=2 * (_SPEED * sliding - gone) / sliding**2 / (friction * GRAVITY),
                way=float(rest) / (_SPEED * stop / 2),
                late=2 * max(_settling(material, height) for material in own) / sliding,
            )
        )
    return rides


def _relative(problem: PointProblem, states: list[Any], lower: int) -> Array:
    """Way (T, 3) [m] of a block's centre on the slab of number `lower`, from the start on."""
    ids, start = problem.points.body_ids, problem.points.reference_positions
    ways = [[(state.positions - start)[ids == body].mean(axis=0) for body in (lower, lower + 1)] for state in states]
    return np.array([block - slab for slab, block in ways])


def _accuracy() -> EngineAccuracy:
    return EngineAccuracy(spacing=_SPACING)


def _settling(material: Any, height: float) -> float:
    """How long pressure takes through so much matter [s]; nothing where it is rigid."""
    stiffness = getattr(material, "youngs_modulus", None) or getattr(material, "bulk_modulus", math.inf)
    return height / math.sqrt(stiffness / material.density)


def blocks_pass(subject: Subject, gap: float, velocity: tuple[float, float, float]) -> Parting:
    """A block above another one, `gap` [cells] away from it, that moves at `velocity` [m/s] for 0.1 s; no weight."""
    lower = box_of_points((0.0, 0.0, 0.0), (4, 4, 3), _SPACING)
    upper = box_of_points((0.0, 0.0, (3 + gap) * _SPACING), (4, 4, 3), _SPACING)
    problem = PointProblem(
        points=cloud_of([lower, upper], [(0.0, 0.0, 0.0), velocity], _SPACING),
        materials=(stiff_material(subject),),
        body_contact=BodyContact(friction=0.5),
        gravity=NO_GRAVITY,
    )
    time, speed = 0.1, float(np.linalg.norm(velocity))
    (state,) = subject.states(problem, _accuracy(), [time])
    moved = state.positions - problem.points.reference_positions
    own = problem.points.body_ids == 1
    return Parting(
        way=float(moved[own].mean(axis=0) @ velocity) / (speed * speed * time),
        other=float(np.linalg.norm(moved[~own].mean(axis=0))) / (speed * time),
    )


def blocks_ride(subject: Subject, contact: ContactCondition, velocity: tuple[float, float, float]) -> Array:
    """Two blocks on each other without weight, the upper one started at `velocity` [m/s], for 0.1 s.

    Returns
    -------
    How far the two faces that touched have moved apart, (3,) [cells], in the frame that turns with the lower block.
    """
    cells = (CELLS, 4, 3)
    lower = box_of_points((0.0, 0.0, 0.0), cells, _SPACING)
    upper = box_of_points((0.0, 0.0, 3 * _SPACING), cells, _SPACING)
    problem = PointProblem(
        points=cloud_of([lower, upper], [(0.0, 0.0, 0.0), velocity], _SPACING),
        materials=(stiff_material(subject),),
        body_contact=BodyContact(contact=contact),
        gravity=NO_GRAVITY,
    )
    (state,) = subject.states(problem, _accuracy(), [0.1])
    start, ids = problem.points.reference_positions, problem.points.body_ids
    turned = best_rotation(start[ids == 0], state.positions[ids == 0])
    faces: list[Array] = []
    for body, face in ((0, start[ids == 0, 2].max()), (1, start[ids == 1, 2].min())):
        rows = (ids == body) & (start[:, 2] == face)
        faces.append(state.positions[rows].mean(axis=0) @ turned - start[rows].mean(axis=0))
    return (faces[1] - faces[0]) / _SPACING


def best_rotation(before: Array, after: Array) -> Array:
    """The rotation (3, 3) that brings points before (N, 3) nearest to those after, about their centres (Kabsch)."""
    u, _, vt = np.linalg.svd((after - after.mean(axis=0)).T @ (before - before.mean(axis=0)))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return u @ flip @ vt


def blocks_stack(subject: Subject, duration: float, materials: Sequence[Material] | None = None) -> Stack:
    """Three cubes of four cells on each other and on a floor, let go at rest; for `duration` [s].

    They are of these materials, the lowest first; None: of the plainest, stiff.
    """
    size = _STACKED[2] * _SPACING
    bodies = [box_of_points((0.0, 0.0, number * size), _STACKED, _SPACING) for number in range(3)]
    own = materials or [stiff_material(subject)] * 3
    problem = PointProblem(
        points=cloud_of(bodies, [(0.0, 0.0, 0.0)] * 3, _SPACING, range(3)),
        materials=tuple(own),
        colliders=(Collider(shape=floor_of(subject), friction=0.5),),
        body_contact=BodyContact(friction=0.5),
        gravity=(0.0, 0.0, -GRAVITY),
    )
    can = subject.descriptor.capabilities.output_fields
    fields = {Field.VELOCITIES} & can
    journal = Journal()
    states = list(subject.states(problem, _accuracy(), np.linspace(0, duration, 21)[1:], fields, journal))
    start, ids = problem.points.reference_positions, problem.points.body_ids
    creep, sinking = 0.0, 0.0
    for state in states:
        moved = state.positions - start
        creep = max(creep, *(float(np.linalg.norm(moved[ids == body, :2].mean(axis=0))) / size for body in range(3)))
        for body in range(3):
            rows = np.flatnonzero(ids == body)
            rows = rows[start[rows, 2] == start[rows, 2].min()]
            under = moved[(ids == body - 1) & (start[:, 2] > (body - 0.25) * size), 2] if body else np.zeros(1)
            sinking = max(sinking, float(under.mean() - moved[rows, 2].min()) / _SPACING)
    top = start[:, 2] == start[:, 2].max()
    # A column that its own weight squeezes swings between nothing and twice rho g H^2 / (2 E).
    squeezed = max(
        material.density * GRAVITY * (3 * size) ** 2 / getattr(material, "youngs_modulus", math.inf) for material in own
    )
    lowest = min(float((state.positions - start)[top, 2].mean()) for state in states)
    highest = max(float((state.positions - start)[top, 2].mean()) for state in states)
    energies = [float(problem.masses @ np.sum(state.velocities**2, axis=1)) for state in states if fields]
    half = len(energies) // 2
    # Rigid bodies stand still but for a share of what gravity gives in a step.
    nothing = float(problem.masses.sum()) * (0.01 * GRAVITY * journal.largest_substep) ** 2
    return Stack(
        creep=creep,
        sinking=sinking,
        height=max(-lowest - squeezed, highest) / _SPACING,
        heating=max(energies[half:]) / max(nothing, *energies[:half]) if half else 0.0,
    )


def blocks_collide(subject: Subject, materials: Sequence[Material] | None = None) -> Collision:
    """A spinning block runs into another one at 2 m/s, off its middle and with friction, and leaves it again.

    They are of these materials, the one at rest first; None: of the plainest, stiff.
    """
    resting = box_of_points((0.0, 0.0, 0.0), (4, 4, 4), _SPACING)
    flying = box_of_points((-0.24, 0.06, 0.03), (4, 4, 4), _SPACING)
    spin = np.cross([0.0, 3.0, 5.0], flying - flying.mean(axis=0))
    problem = PointProblem(
        points=cloud_of([resting, flying], [(0.0, 0.0, 0.0), np.array([2.0, -0.2, 0.0]) + spin], _SPACING, range(2)),
        materials=tuple(materials or [stiff_material(subject)] * 2),
        body_contact=BodyContact(friction=0.4),
        gravity=NO_GRAVITY,
    )
    masses, start = problem.masses, problem.points.initial_velocities
    own = problem.points.body_ids == 1
    scale = float(np.linalg.norm(masses[own] @ start[own]))
    journal = Journal()
    states = subject.states(problem, _accuracy(), np.linspace(0, 0.15, 16)[1:], {Field.VELOCITIES}, journal)
    momentum, energy, exchanged = 0.0, 0.0, 0.0
    for state in states:
        momentum = max(momentum, float(np.linalg.norm(masses @ (state.velocities - start))) / scale)
        energy = max(energy, kinetic_energy(masses, state.velocities) / kinetic_energy(masses, start))
        exchanged = float(np.linalg.norm(masses[own] @ (state.velocities - start)[own])) / scale
    return Collision(momentum=momentum, energy=energy, exchanged=exchanged, substep_count=journal.substep_count)
