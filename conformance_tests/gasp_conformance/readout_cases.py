"""What can be read off a session, kept by it, and taken up again: each case returns what it measured."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import capability_oracles as exact
from gasp_conformance.bounds import place_rounding, rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.core_cases import SPACING, read_fields, swaying_block
from gasp_conformance.observables import angular_momentum
from gasp_conformance.specimens import NO_GRAVITY, lone_points, specimen
from gasp_conformance.subject import Journal, Subject, finite_state
from gasp_conformance.wall_cases import stiff_material
from gasp_core.contract import (
    Drive,
    Driven,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Impulse,
    Material,
    NeoHookean,
    Pinned,
    PointCloud,
    PointProblem,
    PointState,
    Rigid,
    SphereShape,
    Status,
    ViewingSession,
)

__all__ = [
    "Carried",
    "Collision",
    "Gradients",
    "Resumption",
    "Spinning",
    "Velocities",
    "affine_gradients",
    "COLLIDING_WIDTH",
    "block_sways",
    "bodies_collide",
    "driven_block",
    "flown_velocities",
    "resumed_run",
    "spinning_plate",
    "tracers_carried",
    "unequal_body_sways",
]

Array = NDArray[Any]

_CORNER = np.array([0.37, -0.21, 0.11])
COLLIDING_WIDTH = 2 * SPACING
"""Of the blocks that run into each other [m]."""
_ACCURACY = EngineAccuracy(spacing=SPACING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocities:
    """How velocities compare with what they are velocities of; each error beside what may be left of it [m/s].

    Parameters
    ----------
    start, start_allowed
        From those given, at the start.
    fall, fall_allowed
        From v0 + g t, in free fall.
    sway, sway_allowed
        From central differences of positions, of a body that sways; allowed is how much forward differences are from
        backward ones.
    """

    start: float
    start_allowed: float
    fall: float
    fall_allowed: float
    sway: float
    sway_allowed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Gradients:
    """Largest errors of deformation gradients in affine flow and at the start, and what may be left of them."""

    flow: float
    flow_allowed: float
    start: float
    start_allowed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """Momentum of a system on which nothing acts from outside.

    Parameters
    ----------
    center_error
        Distance of the centre of mass from uniform motion, over the mean distance points go.
    exchanged
        Change of one part's momentum, over what it was.
    nearest
        Least distance [m] along x from the part's centre on to that of the rest.
    """

    center_error: float
    exchanged: float
    nearest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Spinning:
    """Relative change of angular momentum, the largest in a run, and what affine transfers may hide of it."""

    change: float
    hidden: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumption:
    """A run that goes on, and the same taken up from a checkpoint: their last states, and the substeps taken."""

    whole: PointState
    resumed: PointState
    begun_at: float
    untouched: PointState
    substeps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """Largest distances of tracers from where a flow carries them [m], and what may be left of them."""

    uniform: float
    uniform_allowed: float
    turning: float
    turning_allowed: float


def flown_velocities(subject: Subject) -> Velocities:
    """Lone points of any material fall freely; a block sways."""
    wanted = frozenset({Field.VELOCITIES})
    gravity, time = np.array([3.1, -4.3, -8.2]), 0.2
    kinds = sorted(subject.descriptor.capabilities.materials, key=lambda kind: kind.kind)
    fall = replace(
        lone_points([specimen(kind) for kind in kinds], 8 * SPACING, 3, 0.8, SPACING, seed=4), gravity=tuple(gravity)
    )
    journal = Journal()
    first, last = subject.states(fall, _ACCURACY, [0.0, time], wanted, journal)
    given = fall.points.initial_velocities
    speed = float(np.linalg.norm(given, axis=1).max()) + float(np.linalg.norm(gravity)) * time
    rounded = speed * rounding(subject, journal.substep_count)

    block = swaying_block(subject)
    tick = 2e-3
    start, before, now, after = subject.states(block, _ACCURACY, [0.0, 0.1 - tick, 0.1, 0.1 + tick], wanted)
    forward = (after.positions - now.positions) / tick
    backward = (now.positions - before.positions) / tick
    resolution = place_rounding(subject, 0, float(np.abs(now.positions).max()), 0.0) / tick
    starts = [_apart(first.velocities, given)]
    # What is rigid has of a sway only what moves it as a whole.
    if not isinstance(block.materials[0], Rigid):
        starts.append(_apart(start.velocities, block.points.initial_velocities))
    return Velocities(
        start=max(starts),
        start_allowed=speed * rounding(subject, 0),
        fall=_apart(last.velocities, given + gravity * time),
        # Some schemes know velocities half a substep early or late.
        fall_allowed=float(np.linalg.norm(gravity)) * journal.largest_substep + rounded,
        sway=_apart(now.velocities, (forward + backward) / 2),
        sway_allowed=_apart(forward, backward) + resolution,
    )


def _apart(found: Array | None, expected: Array) -> float:
    assert found is not None, "a declared field was asked for and not shown"
    assert found.shape == expected.shape, f"shape {found.shape}, expected {expected.shape}"
    return float(np.linalg.norm((found - expected).reshape(len(found), -1), axis=1).max())


def affine_gradients(subject: Subject) -> Gradients:
    """A block so soft that nothing holds it is thrown with v = A (x - centre): F = I + A t at every point.

    Where no elastic solid is declared, of which alone F is known, the block only flies: F = I.
    """
    cells, time = 3, 0.1
    wanted = frozenset({Field.DEFORMATION_GRADIENTS})
    declared = subject.descriptor.capabilities.materials
    solid = next((kind for kind in (Elastic, NeoHookean) if kind in declared), None)
    gradient = np.array([[0.4, -0.7, 0.2], [0.5, -0.3, 0.6], [-0.1, 0.3, 0.2]]) if solid else np.zeros((3, 3))
    block = box_of_points(_CORNER, (cells, cells, cells), SPACING)
    material: Material = (
        # E / rho = 1e-8 m^2/s^2: stress moves nothing by a millionth of a millimetre in this time.
        solid(density=1000.0, youngs_modulus=1e-5, poissons_ratio=0.3) if solid else stiff_material(subject)
    )
    velocities = (block - block.mean(axis=0)) @ gradient.T + [0.3, 0.1, -0.2]
    problem = PointProblem(points=cloud_of([block], [velocities], SPACING), materials=(material,), gravity=NO_GRAVITY)
    journal = Journal()
    first, last = subject.states(problem, _ACCURACY, [0.0, time], wanted, journal)
    identity = np.broadcast_to(np.eye(3), (len(block), 3, 3))
    rate = float(np.linalg.norm(gradient, 2))
    return Gradients(
        flow=_apart(last.deformation_gradients, identity + gradient * time),
        # Affine transfers take the gradient of a substep before: rate^2 t dt; at free surfaces, a cell of the strain.
        flow_allowed=rate**2 * time * journal.largest_substep
        + rate * time / cells
        + rounding(subject, journal.substep_count),
        start=_apart(first.deformation_gradients, identity),
        start_allowed=rounding(subject, 0),
    )


def unequal_body_sways(subject: Subject) -> Collision:
    """A body of unequal points, light and heavy, stretches and spins without weight: its centre goes straight."""
    problem = swaying_block(subject)
    points, (material,) = problem.points, problem.materials
    generator = np.random.default_rng(2)
    heavy = points.reference_positions[:, 0] > points.reference_positions[:, 0].mean()
    unequal = PointCloud(
        reference_positions=points.reference_positions,
        initial_velocities=points.initial_velocities,
        reference_volumes=points.reference_volumes * generator.uniform(0.4, 1.6, len(points)),
        material_ids=heavy.astype(np.int32),
        body_ids=points.body_ids,
    )
    materials = (material, replace(material, density=4 * material.density))
    return _watched(subject, PointProblem(points=unequal, materials=materials, gravity=NO_GRAVITY), heavy, 0.3)


def block_sways(subject: Subject) -> Collision:
    """A block stretches, spins and drifts without weight; its one half is watched."""
    problem = replace(swaying_block(subject), gravity=NO_GRAVITY)
    across = problem.points.reference_positions[:, 0]
    return _watched(subject, problem, across > across.mean(), 0.3)


def bodies_collide(subject: Subject) -> Collision:
    """A light block runs head-on into a heavy one, while both drift."""
    cells, gap = 2, 2 * SPACING
    width = COLLIDING_WIDTH
    light = box_of_points(_CORNER, (cells, cells, cells), SPACING)
    heavy = light + [width + gap, 0.0, 0.0]
    cloud = cloud_of([light, heavy], [[1.2, 0.1, -0.2], [0.2, 0.1, -0.2]], SPACING)
    material = stiff_material(subject)
    problem = PointProblem(
        points=PointCloud(
            reference_positions=cloud.reference_positions,
            initial_velocities=cloud.initial_velocities,
            reference_volumes=cloud.reference_volumes,
            material_ids=cloud.body_ids,
            body_ids=cloud.body_ids,
        ),
        materials=(material, replace(material, density=3 * material.density)),
        gravity=NO_GRAVITY,
    )
    return _watched(subject, problem, cloud.body_ids == 0, 0.5)


def _watched(subject: Subject, problem: PointProblem, part: Array, time: float) -> Collision:
    """Run a problem on which nothing acts from outside; `part` is the body whose momentum is watched."""
    masses, points = problem.masses, problem.points
    total = float(masses.sum())
    drift = masses @ points.initial_velocities / total
    start = masses @ points.reference_positions / total
    journal = Journal()
    error = 0.0
    times = np.linspace(0, time, 11)[1:]
    rest, nearest = ~part, math.inf
    centers = [masses[part] @ points.reference_positions[part] / masses[part].sum()]
    for state in subject.states(problem, _ACCURACY, times, (), journal):
        assert len(state.positions) == len(points), f"{len(points)} points went in, {len(state.positions)} came back"
        center = masses @ state.positions / total
        error = max(error, float(np.linalg.norm(center - start - drift * state.time)))
        centers.append(masses[part] @ state.positions[part] / masses[part].sum())
        other = masses[rest] @ state.positions[rest] / masses[rest].sum()
        nearest = min(nearest, float(other[0] - centers[-1][0]))
    # Of the part's own velocity, seen from the common centre.
    before = (centers[1] - centers[0]) / times[0] - drift
    after = (centers[-1] - centers[-2]) / (times[-1] - times[-2]) - drift
    way = float(masses @ np.linalg.norm(points.initial_velocities, axis=1)) / total * time
    return Collision(
        center_error=error / way,
        exchanged=float(np.linalg.norm(after - before) / np.linalg.norm(before)),
        nearest=nearest,
    )


def spinning_plate(subject: Subject) -> Spinning:
    """A plate, eight cells a side, spins freely and stretches and shrinks as it does."""
    cells = 8
    spacing = 1.0 / cells
    plate = box_of_points(_CORNER, (cells, cells, 1), spacing)
    arm = plate - plate.mean(axis=0)
    velocities = np.cross([0.0, 0.0, 1.0], arm) + 0.2 * arm * [1.0, 1.0, 0.0]
    material = stiff_material(subject)
    problem = PointProblem(points=cloud_of([plate], [velocities], spacing), materials=(material,), gravity=NO_GRAVITY)
    masses = problem.masses
    inertia = float(masses @ np.sum(arm[:, :2] ** 2, axis=1))
    start = float(angular_momentum(masses, plate, velocities)[2])
    times = np.linspace(0, 0.4, 21)[1:]
    change = swing = 0.0
    for state in subject.states(problem, EngineAccuracy(spacing=spacing), times, {Field.VELOCITIES}):
        assert state.velocities is not None
        now = float(angular_momentum(masses, state.positions, state.velocities)[2])
        change = max(change, abs(now / start - 1))
        away = state.positions - state.positions.mean(axis=0)
        swing = max(swing, abs(float(masses @ np.sum(away[:, :2] ** 2, axis=1)) / inertia - 1))
    # The points' own affine fields hold a share dx^2 / (2 r_g^2), r_g^2 = a^2/6 of a square, of what turns; as long as
    # the plate turns as it did, it stays there. How fast it turns changes as its moment of inertia does, and at its rim
    # by as much again.
    return Spinning(change=change, hidden=2 * 3 * spacing**2 * swing)


def driven_block(subject: Subject) -> PointProblem:
    """A swaying block with one drive of each kind that is declared: what holds and what strikes is kept, too."""
    drives: list[Drive] = [
        Pinned(region=HalfSpace(point=tuple(_CORNER + 0.5 * SPACING), normal=(0.0, 0.0, 1.0)), start=0.02),
        Driven(
            region=SphereShape(center=tuple(_CORNER + 3 * SPACING), radius=SPACING), velocity=(0.3, 0.0, 0.2), end=0.1
        ),
        Impulse(region=SphereShape(center=tuple(_CORNER), radius=9.0), impulse=(0.02, 0.0, 0.01), start=0.03),
    ]
    declared = subject.descriptor.capabilities.drives
    return replace(swaying_block(subject), drives=tuple(drive for drive in drives if type(drive) in declared))


def resumed_run(subject: Subject, problem: PointProblem) -> Resumption:
    """A run whose checkpoint at half time is written as plain arrays and read again."""
    shown = read_fields(subject)
    half, end = 0.07, 0.15
    with subject.open(problem, _ACCURACY, shown) as session:
        substeps = session.advance_to(half).substep_count
        kept = dict(session.checkpoint())
        frozen = {name: np.array(array) for name, array in kept.items()}
        substeps += session.advance_to(end).substep_count
        whole = finite_state(session, shown)
    for name, array in frozen.items():
        assert np.array_equal(kept[name], array, equal_nan=True), f"the checkpoint's {name} changed as the run went on"
    with _reopened(subject, problem, _through_a_file(frozen)) as session:
        begun_at = session.time
        untouched = finite_state(session, shown)
        report = session.advance_to(end)
        assert report.status is Status.OK, report.warnings
        resumed = finite_state(session, shown)
    return Resumption(whole=whole, resumed=resumed, begun_at=begun_at, untouched=untouched, substeps=substeps)


def _through_a_file(arrays: Mapping[str, Array]) -> Mapping[str, Array]:
    """The arrays as they come back from a file that holds nothing but numbers."""
    file = io.BytesIO()
    np.savez(file, **dict(arrays))
    file.seek(0)
    with np.load(file, allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def _reopened(subject: Subject, problem: PointProblem, checkpoint: Mapping[str, Array]) -> Any:
    options = subject.descriptor.options
    return subject.engine.open(
        problem,
        device=subject.device,
        precision=subject.precision,
        seed=0,
        accuracy=_ACCURACY,
        options=None if options is None else options(),
        restart=checkpoint,
    )


def tracers_carried(subject: Subject) -> Carried:
    """Tracers within a stiff block that drifts, and within one that drifts and turns."""
    spacing, time = SPACING, 0.3
    block = box_of_points(_CORNER, (4, 4, 4), spacing)
    center = block.mean(axis=0)
    velocity, spin = np.array([0.6, -0.2, 0.4]), np.array([0.5, -0.4, 1.0])
    # At no point of the block, and not near its surface.
    tracers = center + np.random.default_rng(6).uniform(-0.1, 0.1, (5, 3))
    errors: list[float] = []
    allowed: list[float] = []
    for turning in (False, True):
        spins = spin if turning else np.zeros(3)
        cloud = cloud_of([block], [velocity + np.cross(spins, block - center)], spacing)
        problem = PointProblem(
            points=PointCloud(
                reference_positions=cloud.reference_positions,
                initial_velocities=cloud.initial_velocities,
                reference_volumes=cloud.reference_volumes,
                material_ids=cloud.material_ids,
                body_ids=cloud.body_ids,
                tracer_positions=tracers,
            ),
            materials=(stiff_material(subject),),
            gravity=NO_GRAVITY,
        )
        journal = Journal()
        (state,) = subject.states(problem, _ACCURACY, [time], {Field.TRACER_POSITIONS}, journal)
        place = exact.rigid_motion(tracers, center, velocity, spins, time)
        errors.append(_apart(state.tracer_positions, place))
        rate, reach = float(np.linalg.norm(spins)), 0.2
        travel = (float(np.linalg.norm(velocity)) + rate * reach) * time
        rounded = place_rounding(subject, journal.substep_count, float(np.abs(place).max()), travel)
        # Euler's rule on a circle, and the block's own swelling as it turns: rho w^2 a^2 / E, twice that as it sets in.
        stiffness = getattr(problem.materials[0], "youngs_modulus", math.inf)
        swelling = 2 * problem.materials[0].density * (rate * 0.35) ** 2 / stiffness
        allowed.append(reach * (rate**2 * time * journal.largest_substep / 2 + swelling) + rounded)
    return Carried(uniform=errors[0], uniform_allowed=allowed[0], turning=errors[1], turning_allowed=allowed[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a session hands out on its device, against what it reads out.

    Parameters
    ----------
    misshapen
        Numbers more or fewer than were read, over all looks.
    apart
        Largest difference, over the largest number that was read.
    """

    misshapen: int
    apart: float


def viewed(subject: Subject, field: Field) -> View:
    """A block that sways, looked at where it is at the start and after each of three advances."""
    misshapen, apart = 0, 0.0
    with subject.open(swaying_block(subject), _ACCURACY, frozenset({field})) as session:
        for time in (0.0, 0.01, 0.025, 0.04):
            session.advance_to(time)
            read: Array = getattr(finite_state(session, frozenset({field})), field.value)
            seen = np.from_dlpack(cast(ViewingSession, session).view(field)).astype(np.float64)
            if seen.shape != read.shape:
                misshapen += abs(seen.size - read.size) or 1
                continue
            apart = max(apart, float(np.abs(seen - read).max()) / max(float(np.abs(read).max()), 1e-300))
    return View(misshapen=misshapen, apart=apart)
