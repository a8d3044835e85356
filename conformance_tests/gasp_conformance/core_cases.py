"""What every engine has to do, whatever it models: each case runs something and returns what it measured.

Everything here is free flight or the sway of one small body, of a material that the engine itself declares: no wall,
no drive, no field that has to be declared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.bounds import place_rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.specimens import block_problem, lone_points, plain_material, specimen
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import (
    MATERIALS,
    SHAPES,
    BoxShape,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Drive,
    Driven,
    EngineAccuracy,
    Field,
    ForceField,
    HalfSpace,
    Impulse,
    Material,
    Pinned,
    PointCloud,
    PointProblem,
    PointState,
    Precision,
    Shape,
    SignedDistanceField,
    SphereShape,
    Wind,
)
from gasp_core.contract.capabilities import check_supported
from gasp_core.errors import UnsupportedSceneError

__all__ = [
    "FRAME",
    "SPACING",
    "Flight",
    "block_falls",
    "difference",
    "lone_points_fly",
    "read_fields",
    "states_differ",
    "swaying_block",
    "undeclared_and_accepted",
]

Array = NDArray[Any]

SPACING = 0.1
"""Of the grid [m], for engines that have one."""
FRAME = 0.05
"""Between two looks [s]."""
_CORNER = (0.37, -0.21, 0.11)
"""No whole number of cells from anything."""
_TILTED = (3.1, -4.3, -8.2)
"""Gravity [m/s^2] of which no two components can be taken for each other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A flight beside its closed form.

    Parameters
    ----------
    error
        Largest distance from the closed form [m].
    stepping
        What symplectic Euler with the largest substep would be off by [m].
    rounding
        What rounding may add [m].
    """

    error: float
    stepping: float
    rounding: float


def read_fields(subject: Subject) -> frozenset[Field]:
    """Everything the engine declares that it can show, but tracers, which have to be there first."""
    return (subject.descriptor.capabilities.output_fields | {Field.POSITIONS}) - {Field.TRACER_POSITIONS}


def block_falls(subject: Subject, gravity: Sequence[float], times: Sequence[float], substep: float) -> Flight:
    """A block thrown at 1.6 m/s, under any gravity, in substeps of `substep` [s]."""
    velocity = np.array([1.1, -0.6, 0.9])
    problem = block_problem(subject, _CORNER, 2, SPACING, velocity, gravity=tuple(gravity))
    start = problem.points.reference_positions
    journal = Journal()
    error = reach = 0.0
    accuracy = EngineAccuracy(spacing=SPACING, substep=substep)
    for state in subject.states(problem, accuracy, times, (), journal):
        exact = oracles.free_fall(start, velocity, problem.gravity, state.time)
        error = max(error, float(np.linalg.norm(state.positions - exact, axis=1).max()))
        reach = max(reach, float(np.abs(exact).max()))
    end, pull = times[-1], float(np.linalg.norm(gravity))
    travel = float(np.linalg.norm(velocity)) * end + pull * end**2 / 2
    return Flight(
        error=error,
        stepping=oracles.euler_fall_error(pull, end, journal.largest_substep),
        rounding=place_rounding(subject, journal.substep_count, reach, travel),
    )


def lone_points_fly(subject: Subject, order: Array | None = None) -> tuple[Flight, Array]:
    """64 points, each a body of its own with its own velocity and of any declared material, fly apart for 0.25 s.

    Returns
    -------
    The flight, and the positions (64, 3) [m] at its end, row by row in the order given, `order` undone.
    """
    kinds = sorted(subject.descriptor.capabilities.materials, key=lambda kind: kind.kind)
    problem = lone_points([specimen(kind) for kind in kinds], 8 * SPACING, 4, 0.8, SPACING, seed=11)
    points = problem.points
    rows = np.arange(len(points)) if order is None else order
    problem = replace(problem, points=_reordered(points, rows))
    time = 0.25
    journal = Journal()
    (state,) = subject.states(problem, EngineAccuracy(spacing=SPACING), [time], (), journal)
    positions = np.empty_like(state.positions)
    positions[rows] = state.positions
    exact = points.reference_positions + points.initial_velocities * time
    flight = Flight(
        error=float(np.linalg.norm(positions - exact, axis=1).max()),
        stepping=0.0,
        rounding=place_rounding(subject, journal.substep_count, float(np.abs(exact).max()), 0.8 * time),
    )
    return flight, positions


def _reordered(points: PointCloud, rows: Array) -> PointCloud:
    return PointCloud(
        reference_positions=points.reference_positions[rows],
        initial_velocities=points.initial_velocities[rows],
        reference_volumes=points.reference_volumes[rows],
        material_ids=points.material_ids[rows],
        body_ids=points.body_ids[rows],
    )


def swaying_block(subject: Subject, cells: int = 3, seed: int = 7, heaviness: float = 1.0) -> PointProblem:
    """A block of scattered points that spins, stretches and falls: nothing about it is symmetric or at rest."""
    generator = np.random.default_rng(seed)
    block = box_of_points(_CORNER, (cells, cells, cells), SPACING)
    block = block + generator.uniform(-0.15, 0.15, block.shape) * SPACING
    arm = block - block.mean(axis=0)
    velocities = np.cross([0.7, -1.1, 1.9], arm) + arm * [0.8, -0.5, 0.3] + [0.4, 0.2, -0.3]
    material = plain_material(subject.descriptor.capabilities)
    return PointProblem(
        points=cloud_of([block], [velocities], SPACING),
        materials=(replace(material, density=material.density * heaviness),),
        gravity=_TILTED,
    )


def states_differ(one: PointState, other: PointState) -> list[str]:
    """Names of the arrays in which two states are not equal bit for bit."""
    names = [field.name for field in fields(one) if field.name != "time"]
    return [name for name in names if not _same(getattr(one, name), getattr(other, name))]


def _same(one: Array | None, other: Array | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.shape == other.shape and one.tobytes() == other.tobytes()


def difference(one: PointState, other: PointState) -> float:
    """Largest distance of a point between two states [m]; infinite where one of them is not a number."""
    distance = np.linalg.norm(one.positions - other.positions, axis=1)
    return float(distance.max()) if np.isfinite(distance).all() else float("inf")


def undeclared_and_accepted(subject: Subject) -> tuple[int, list[str]]:
    """How many things the engine does not declare, and which of them the comparison before opening lets pass."""
    descriptor = subject.descriptor
    can = descriptor.capabilities
    asked = 0
    accepted: list[str] = []

    def ask(what: str, problem: PointProblem, **run: Any) -> None:
        nonlocal asked
        asked += 1
        try:
            check_supported(problem, descriptor, **run)
        except UnsupportedSceneError as refusal:
            if descriptor.name not in str(refusal):
                accepted.append(f"{what} (refused without naming {descriptor.name})")
        else:
            accepted.append(what)

    plain = block_problem(subject, _CORNER, 1, SPACING, (0.0, 0.0, 0.0))
    for what, changed in _undeclared_scenes(subject, plain):
        ask(what, changed)
    for field in set(Field) - can.output_fields - {Field.POSITIONS}:
        ask(f"field {field.value}", plain, fields=frozenset({field}))
    for precision in set(Precision) - set(can.precisions):
        ask(f"precision {precision.value}", plain, precision=precision)
    ask("a device that nobody has", plain, device="gasp-conformance-no-such-device")
    if not can.checkpoints:
        ask("checkpoints", plain, checkpoints=True)
    return asked, accepted


@dataclass(frozen=True, slots=True, kw_only=True)
class _Unobtainium(Material):
    """No engine can know it."""

    kind = "unobtainium"


def _undeclared_scenes(subject: Subject, plain: PointProblem) -> list[tuple[str, PointProblem]]:
    """Scenes that differ from a plain one by one thing that the engine does not declare."""
    can = subject.descriptor.capabilities
    ball = SphereShape(center=(5.0, 5.0, 5.0), radius=1.0)
    scenes: list[tuple[str, PointProblem]] = []
    for kind in {*MATERIALS.values(), _Unobtainium} - can.materials:
        scenes.append((f"material {kind.kind}", replace(plain, materials=(specimen(kind),))))
    for kind in {*SHAPES.values(), SignedDistanceField} - can.collider_shapes:
        contact = next(iter(can.contact_conditions), ContactCondition.SEPARATE)
        collider = Collider(shape=_shape(kind), contact=contact)
        scenes.append((f"collider {kind.kind}", replace(plain, colliders=(collider,))))
    for contact in set(ContactCondition) - can.contact_conditions:
        shape = _shape(next(iter(can.collider_shapes), HalfSpace))
        collider = Collider(shape=shape, contact=contact)
        scenes.append((f"contact {contact.value}", replace(plain, colliders=(collider,))))
    drives: list[Drive] = [Pinned(region=ball), Driven(region=ball), Impulse(region=ball)]
    for drive in drives:
        if type(drive) not in can.drives:
            scenes.append((f"drive {drive.kind}", replace(plain, drives=(drive,))))
    forces: list[ForceField] = [Wind()]
    for force in forces:
        if type(force) not in can.force_fields:
            scenes.append((f"force field {force.kind}", replace(plain, force_fields=(force,))))
    for policy in set(DomainPolicy) - can.domain_policies:
        domain = Domain(lower=(-9.0, -9.0, -9.0), upper=(9.0, 9.0, 9.0), policy=policy)
        scenes.append((f"domain policy {policy.value}", replace(plain, domain=domain)))
    if not can.carries_tracers:
        points = plain.points
        marked = PointCloud(
            reference_positions=points.reference_positions,
            initial_velocities=points.initial_velocities,
            reference_volumes=points.reference_volumes,
            material_ids=points.material_ids,
            body_ids=points.body_ids,
            tracer_positions=points.reference_positions[:1],
        )
        scenes.append(("tracers", replace(plain, points=marked)))
    return scenes


def _shape(kind: type[Any]) -> Shape:
    if kind is BoxShape:
        return BoxShape(center=(5.0, 5.0, 5.0), half_extents=(1.0, 1.0, 1.0))
    if kind is SphereShape:
        return SphereShape(center=(5.0, 5.0, 5.0), radius=1.0)
    if kind is SignedDistanceField:
        ball = SphereShape(center=(5.0, 5.0, 5.0), radius=1.0)
        return SignedDistanceField.sampled(ball, (4.0, 4.0, 4.0), (6.0, 6.0, 6.0), 0.2)
    return HalfSpace(point=(0.0, 0.0, -9.0), normal=(0.0, 0.0, 1.0))
