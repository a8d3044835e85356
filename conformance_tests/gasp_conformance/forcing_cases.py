"""Drives, wind and the domain's edge: each case runs blocks through one of them beside its closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import capability_oracles as exact
from gasp_conformance import oracles
from gasp_conformance.bounds import place_rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.specimens import NO_GRAVITY, lone_points, plain_material, resting_block
from gasp_conformance.subject import Journal, Subject
from gasp_conformance.wall_cases import stiff_material
from gasp_core.contract import (
    BoxShape,
    Domain,
    DomainPolicy,
    Driven,
    EngineAccuracy,
    HalfSpace,
    Impulse,
    Pinned,
    PointProblem,
    SphereShape,
    Status,
    StepReport,
    Wind,
)

__all__ = [
    "Deviation",
    "Edge",
    "Grip",
    "Push",
    "clamped_at_edge",
    "driven_block",
    "driven_round",
    "driven_twice",
    "expanding_domain",
    "pinned_block",
    "pushed_block",
    "pushed_points",
    "stopped_at_edge",
    "wind_on_block",
]

Array = NDArray[Any]

_SPACING = 0.1
_HERE = np.array([0.37, 0.21, 0.11])
_AWAY = _HERE + [3.0, 0.0, 0.0]
_AROUND = BoxShape(center=tuple(_HERE + 0.1), half_extents=(0.8, 0.8, 0.8))
"""Far wider than what is at `_HERE`: nothing of it, and no node it speaks to, is outside."""
_BALL = SphereShape(center=tuple(_HERE + 0.1), radius=3.0)
_BESIDE = _HERE + [2.75, 2.75, 0.0]
"""Not in the ball, by seven cells, but in the box around it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Largest distance from a closed form [m], and what substeps and rounding may leave of it."""

    error: float
    allowed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Grip:
    """Deviations of what a drive grips: before, during and after its time; and of what is not in its region."""

    before: Deviation
    during: Deviation
    after: Deviation
    bystander: Deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """Deviations of the centre of a pushed body, before and after, and of a body beside it [m]; and of the velocity it
    gained, relative."""

    before: Deviation
    after: Deviation
    gained: Deviation
    bystander: Deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """How a run at the domain's edge went.

    Parameters
    ----------
    reports
        Of every advance, the last one included.
    stopped_at
        The session's time when it ended [s].
    crossed_at
        When free flight crosses the edge [s].
    outside
        Farthest that a point was beyond the edge [m] in any state read.
    reach
        Farthest that free flight would have been [m].
    free_error
        Deviation of the points that stay clear of the edge.
    finite
        Whether what could be read at the end was.
    """

    reports: tuple[StepReport, ...]
    stopped_at: float
    crossed_at: float
    outside: float
    reach: float
    free_error: Deviation
    finite: bool


def _round_region(subject: Subject) -> BoxShape | SphereShape:
    """A ball that one of two blocks is in, or the box around that, where an engine knows no balls as regions."""
    return _BALL if SphereShape in subject.descriptor.capabilities.region_shapes else _AROUND


def _two_blocks(subject: Subject, velocity: Any, **scene: Any) -> tuple[PointProblem, Array, Array]:
    """One block within `_AROUND` and `_BALL`, one in neither, both thrown alike."""
    blocks = [box_of_points(corner, (2, 2, 2), _SPACING) for corner in (_HERE, _BESIDE)]
    problem = PointProblem(
        points=cloud_of(blocks, [velocity, velocity], _SPACING), materials=(stiff_material(subject),), **scene
    )
    return problem, blocks[0], blocks[1]


def _distance(found: Array, expected: Array) -> float:
    return float(np.linalg.norm(found - expected, axis=-1).max())


def _snapshots(subject: Subject, problem: PointProblem, times: list[float]) -> tuple[list[Array], float, float]:
    """Positions at `times`, the largest substep [s], and what rounding may leave of them [m]."""
    journal = Journal()
    states = subject.states(problem, EngineAccuracy(spacing=_SPACING), times, (), journal)
    positions = [state.positions for state in states]
    reach = max(float(np.abs(each).max()) for each in positions)
    # Nothing here turns back, but for what falls and is held.
    travel = _distance(positions[-1], problem.points.reference_positions)
    return positions, journal.largest_substep, place_rounding(subject, journal.substep_count, reach, travel)


def pinned_block(subject: Subject) -> Grip:
    """A falling block is held from 0.1 s to 0.2 s, and falls anew."""
    start, end = 0.1, 0.2
    gravity = np.array([1.0, -2.0, -9.0])
    pull = float(np.linalg.norm(gravity))
    problem, held, free = _two_blocks(
        subject,
        (0.0, 0.0, 0.0),
        gravity=tuple(gravity),
        drives=(Pinned(region=_round_region(subject), start=start, end=end),),
    )
    times = [start, 0.5 * (start + end), end, 0.3]
    places, step, rounded = _snapshots(subject, problem, times)
    count = len(held)
    fallen = held + gravity * start**2 / 2
    late = 0.3 - end
    # A substep that reaches into the window, or out of it, is off by a substep's travel at the speed of that time.
    return Grip(
        before=Deviation(
            error=_distance(places[0][:count], fallen),
            allowed=1.05 * oracles.euler_fall_error(pull, start, step) + rounded,
        ),
        during=Deviation(
            error=max(_distance(each[:count], places[0][:count]) for each in places[1:3]),
            allowed=pull * start * step + rounded,
        ),
        after=Deviation(
            error=_distance(places[3][:count], places[2][:count] + gravity * late**2 / 2),
            allowed=1.05 * oracles.euler_fall_error(pull, late, step) + pull * late * step + rounded,
        ),
        bystander=Deviation(
            error=max(_distance(each[count:], free + gravity * t**2 / 2) for each, t in zip(places, times)),
            allowed=1.05 * oracles.euler_fall_error(pull, 0.3, step) + rounded,
        ),
    )


def driven_block(subject: Subject) -> Grip:
    """A falling block is taken along and turned from 0.05 s to 0.35 s, and falls anew from there."""
    start, end, late = 0.05, 0.35, 0.45
    velocity, spin = np.array([0.5, -0.2, 0.3]), np.array([0.4, -0.8, 1.6])
    center = _HERE + 0.1
    # A body that is let go without weight goes on as it was driven: only its fall tells when the drive ended.
    gravity = np.array([1.0, -2.0, -9.0])
    pull = float(np.linalg.norm(gravity))
    drive = Driven(
        region=_AROUND,
        start=start,
        end=end,
        velocity=tuple(velocity),
        angular_velocity=tuple(spin),
        center=tuple(center),
    )
    problem, taken, free = _two_blocks(subject, (0.0, 0.0, 0.0), gravity=tuple(gravity), drives=(drive,))
    times = [start, 0.2, end, late]
    places, step, rounded = _snapshots(subject, problem, times)
    count = len(taken)
    rate = float(np.linalg.norm(spin))
    reach = float(np.linalg.norm(taken - center, axis=1).max())
    speed = float(np.linalg.norm(velocity)) + rate * reach
    errors = [
        _distance(place[:count], exact.rigid_motion(places[0][:count], center, velocity, spin, time - start))
        for place, time in zip(places[1:3], times[1:3])
    ]
    released = places[2][:count].mean(axis=0)
    thrown = velocity + np.cross(spin, released - center - velocity * (end - start))
    fall = late - end
    onward = released + thrown * fall + gravity * fall**2 / 2
    return Grip(
        before=Deviation(
            error=_distance(places[0][:count], taken + gravity * start**2 / 2),
            allowed=1.05 * oracles.euler_fall_error(pull, start, step) + rounded,
        ),
        during=Deviation(
            error=max(errors),
            # Euler's rule spirals outwards on a circle by r w^2 t dt / 2; the grip closes within a substep, in which
            # matter moves as it did before.
            allowed=reach * rate**2 * (end - start) * step / 2 + (speed + pull * start) * step + rounded,
        ),
        after=Deviation(
            error=_distance(places[3][:count].mean(axis=0), onward),
            allowed=1.05 * oracles.euler_fall_error(pull, fall, step) + (speed + pull * fall) * step + rounded,
        ),
        bystander=Deviation(
            error=max(_distance(each[count:], free + gravity * t**2 / 2) for each, t in zip(places, times)),
            allowed=1.05 * oracles.euler_fall_error(pull, late, step) + rounded,
        ),
    )


def driven_round(subject: Subject) -> Deviation:
    """A block is taken round an axis ten cells away, three times: each time it comes back to where it was.

    Held to the tangents it would go outward by pi w dt of the radius in every turn, and grow as much.
    """
    turn = 0.4
    spin = np.array([0.0, 0.0, 2 * math.pi / turn])
    center = _HERE + [1.1, 0.1, 0.1]
    drive = Driven(region=_AROUND, angular_velocity=tuple(spin), center=tuple(center))
    block = box_of_points(_HERE, (2, 2, 2), _SPACING)
    problem = PointProblem(
        points=cloud_of([block], [np.cross(spin, block - center)], _SPACING),
        materials=(stiff_material(subject),),
        gravity=NO_GRAVITY,
        drives=(drive,),
    )
    places, step, _ = _snapshots(subject, problem, [turn, 2 * turn, 3 * turn])
    reach = float(np.linalg.norm((block - center)[:, :2], axis=1).max())
    speed = float(np.linalg.norm(spin)) * reach
    far, way = float(np.abs(center).max()) + reach, 3 * turn * speed
    rounded = place_rounding(subject, math.ceil(3 * turn / step), far, way)
    return Deviation(
        error=max(_distance(place, block) for place in places),
        # The grip closes within a substep, in which matter goes straight on: off its circle by the second power of the
        # way, and as fast as it should be but for the direction.
        allowed=speed * step * float(np.linalg.norm(spin)) * step + rounded,
    )


def driven_twice(subject: Subject) -> Deviation:
    """Two drives hold a block, of which the one that stands first begins last: it goes with the other, which wins."""
    start, middle, end = 0.05, 0.15, 0.35
    first, second = np.array([-0.3, 0.4, 0.2]), np.array([0.5, -0.2, 0.3])
    drives = (
        Driven(region=_AROUND, start=middle, velocity=tuple(first)),
        Driven(region=_AROUND, start=start, velocity=tuple(second)),
    )
    gravity = np.array([1.0, -2.0, -9.0])
    problem, taken, _ = _two_blocks(subject, (0.0, 0.0, 0.0), gravity=tuple(gravity), drives=drives)
    times = [start, middle, 0.5 * (middle + end), end]
    places, step, rounded = _snapshots(subject, problem, times)
    count = len(taken)
    errors = [
        _distance(place[:count], places[0][:count] + second * (time - start)) for place, time in zip(places, times)
    ]
    speed = float(np.linalg.norm(second))
    # The grip closes within a substep, in which matter moves as it did before.
    fallen = float(np.linalg.norm(gravity)) * start
    return Deviation(error=max(errors), allowed=(speed + fallen) * step + rounded)


def pushed_block(subject: Subject) -> Push:
    """Half of a block is struck at 0.1 s, without weight: the whole goes off with the impulse over its mass."""
    start, late = 0.1, 0.4
    impulse = np.array([2.0, -1.0, 3.0])
    # Through the middle of the block that is struck; the other one is below it.
    half = HalfSpace(point=tuple(_HERE + 0.1), normal=(1.0, 0.0, 0.0))
    blocks = [box_of_points(corner, (2, 2, 2), _SPACING) for corner in (_HERE, _AWAY)]
    problem = PointProblem(
        points=cloud_of(blocks, [np.zeros(3), np.zeros(3)], _SPACING),
        materials=(stiff_material(subject),),
        gravity=NO_GRAVITY,
        drives=(Impulse(region=half, start=start, impulse=tuple(impulse)),),
    )
    middle = 0.25
    places, step, rounded = _snapshots(subject, problem, [start, middle, late])
    count = len(blocks[0])
    change = impulse / problem.masses[:count].sum()
    before = blocks[0].mean(axis=0)
    errors = [
        float(np.linalg.norm(place[:count].mean(axis=0) - before - change * (time - start)))
        for place, time in zip(places[1:], (middle, late))
    ]
    # However late within a substep it was struck, it goes uniformly from then on.
    velocity = (places[2][:count] - places[1][:count]).mean(axis=0) / (late - middle)
    return Push(
        before=Deviation(error=_distance(places[0][:count], blocks[0]), allowed=rounded),
        after=Deviation(error=max(errors), allowed=float(np.linalg.norm(change)) * step + rounded),
        gained=Deviation(
            error=float(np.linalg.norm(velocity - change) / np.linalg.norm(change)),
            allowed=2 * rounded / (late - middle) / float(np.linalg.norm(change)),
        ),
        bystander=Deviation(error=max(_distance(each[count:], blocks[1]) for each in places), allowed=rounded),
    )


def pushed_points(subject: Subject) -> Deviation:
    """Of 27 lone points of unequal mass the lower ones are struck at 0.1 s: all of these by the same velocity."""
    start, late = 0.1, 0.4
    impulse = np.array([0.02, -0.01, 0.03])
    problem = lone_points([plain_material(subject.descriptor.capabilities)], 8 * _SPACING, 3, 0.2, _SPACING, seed=5)
    points = problem.points
    places, velocities = points.reference_positions, points.initial_velocities
    # Between two layers of points, which move by a tenth of the way to it.
    height = float(places[:, 2].min()) + 4 * _SPACING
    region = HalfSpace(point=(0.0, 0.0, height), normal=(0.0, 0.0, 1.0))
    problem = replace(problem, drives=(Impulse(region=region, start=start, impulse=tuple(impulse)),))
    struck = places[:, 2] < height
    change = struck[:, None] * impulse / problem.masses[struck].sum()
    (found,), step, rounded = _snapshots(subject, problem, [late])
    return Deviation(
        error=_distance(found, places + velocities * late + change * (late - start)),
        allowed=float(np.linalg.norm(change, axis=1).max()) * step + rounded,
    )


def wind_on_block(subject: Subject) -> Grip:
    """A drifting block is blown upon from 0.1 s to 0.5 s, and drifts on as fast as it then is."""
    start, end, late, drag = 0.1, 0.5, 0.7, 3.0
    velocity, air = np.array([0.1, 0.4, -0.3]), np.array([1.0, -0.6, 0.5])
    wind = Wind(region=_round_region(subject), start=start, end=end, velocity=tuple(air), drag=drag)
    problem, blown, free = _two_blocks(subject, velocity, gravity=NO_GRAVITY, force_fields=(wind,))
    times = [start, 0.3, end, late]
    places, step, rounded = _snapshots(subject, problem, times)
    count = len(blown)
    begun = blown + velocity * start
    errors = [
        _distance(place[:count], begun + exact.carried_by_wind(velocity, air, drag, time - start))
        for place, time in zip(places[1:3], times[1:3])
    ]
    slip = float(np.linalg.norm(air - velocity))
    # Euler's rule, explicit or implicit, is off by k dt / 2 of the difference in speed at most, for as long as the
    # wind blows, and by half a substep's change of speed; windows begin and end within a substep.
    stepping = slip * (drag * (end - start) / 2 + 1) * step
    final = air + (velocity - air) * np.exp(-drag * (end - start))
    return Grip(
        before=Deviation(error=_distance(places[0][:count], begun), allowed=rounded),
        during=Deviation(error=max(errors), allowed=stepping + rounded),
        after=Deviation(
            error=_distance(places[3][:count], places[2][:count] + final * (late - end)),
            allowed=slip * drag * step * (late - end) / 2 + slip * step + rounded,
        ),
        bystander=Deviation(
            error=max(_distance(each[count:], free + velocity * time) for each, time in zip(places, times)),
            allowed=rounded,
        ),
    )


def _leaver(subject: Subject, policy: DomainPolicy) -> tuple[PointProblem, int, float]:
    """27 lone points, of which one leaves a domain; its row, and when it does [s]."""
    problem = lone_points([plain_material(subject.descriptor.capabilities)], 8 * _SPACING, 3, 0.2, _SPACING, seed=3)
    points = problem.points
    row = int(np.argmax(points.reference_positions @ [1.0, 0.1, 0.01]))
    velocities = points.initial_velocities.copy()
    velocities[row] = [2.0, 0.0, 0.0]
    edge = float(points.reference_positions[row, 0]) + 0.3
    low = points.reference_positions.min(axis=0) - 1.0
    high = points.reference_positions.max(axis=0) + 1.0
    high[0] = edge
    moved = PointProblem(
        points=type(points)(
            reference_positions=points.reference_positions,
            initial_velocities=velocities,
            reference_volumes=points.reference_volumes,
            material_ids=points.material_ids,
            body_ids=points.body_ids,
        ),
        materials=problem.materials,
        gravity=NO_GRAVITY,
        domain=Domain(lower=tuple(low), upper=tuple(high), policy=policy),
    )
    return moved, row, 0.3 / 2.0


def _run_to_edge(subject: Subject, policy: DomainPolicy) -> tuple[Edge, int]:
    problem, row, crossed_at = _leaver(subject, policy)
    points, domain = problem.points, problem.domain
    assert domain is not None
    others = np.arange(len(points)) != row
    reports: list[StepReport] = []
    outside, error, magnitude, substeps = -np.inf, 0.0, 0.0, 0
    end = 0.4
    with subject.open(problem, EngineAccuracy(spacing=_SPACING)) as session:
        positions = points.reference_positions
        for time in np.linspace(0, end, 9)[1:].tolist():
            report = session.advance_to(time)
            reports.append(report)
            substeps += report.substep_count
            positions = session.read(frozenset()).positions
            free = points.reference_positions + points.initial_velocities * session.time
            outside = max(outside, float((positions - np.asarray(domain.upper)).max()))
            error = max(error, _distance(positions[others], free[others]))
            magnitude = max(magnitude, float(np.abs(free).max()))
            if report.status is not Status.OK:
                break
        stopped_at = session.time
    return (
        Edge(
            reports=tuple(reports),
            stopped_at=stopped_at,
            crossed_at=crossed_at,
            outside=outside,
            reach=(end - crossed_at) * 2.0,
            free_error=Deviation(error=error, allowed=place_rounding(subject, substeps, magnitude, 0.2 * end)),
            finite=bool(np.isfinite(positions).all()),
        ),
        row,
    )


def stopped_at_edge(subject: Subject) -> tuple[Edge, int]:
    """Of 27 lone points one leaves a domain that stops; the run, and the point's row."""
    return _run_to_edge(subject, DomainPolicy.STOP)


def clamped_at_edge(subject: Subject) -> tuple[Edge, int]:
    """Of 27 lone points one meets the edge of a domain that clamps; the run, and the point's row."""
    return _run_to_edge(subject, DomainPolicy.CLAMP)


def expanding_domain(subject: Subject) -> Deviation:
    """A block falls through the floor of a first guess, as if nothing were there."""
    domain = Domain(lower=tuple(_HERE - 0.15), upper=tuple(_HERE + 0.35), policy=DomainPolicy.EXPAND)
    gravity = np.array([3.0, -4.0, -8.0])
    problem = resting_block(subject, _HERE, 2, _SPACING, gravity=tuple(gravity), domain=domain)
    times = [0.2, 0.4, 0.6]
    places, step, rounded = _snapshots(subject, problem, times)
    start = problem.points.reference_positions
    pull = float(np.linalg.norm(gravity))
    return Deviation(
        error=max(_distance(place, start + gravity * t**2 / 2) for place, t in zip(places, times)),
        allowed=1.05 * oracles.euler_fall_error(pull, times[-1], step) + rounded,
    )
