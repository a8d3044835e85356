"""Inputs far from what is usual: each case runs them through the contract and returns what it measured.

No case judges. Matter is 1 m large and elastic unless said otherwise; clouds are small, so that the many substeps that
stiff and fast matter takes stay cheap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_conformance import oracles
from gasp_conformance.bounds import rounding, unit_roundoff
from gasp_conformance.clouds import box_of_points, cloud_of, jittered
from gasp_conformance.observables import damped_oscillation
from gasp_conformance.specimens import NO_GRAVITY, plain_material
from gasp_conformance.subject import Journal, Subject
from gasp_conformance.watched_runs import WatchedRun, watch_run
from gasp_core.contract import (
    BoxShape,
    Collider,
    ContactCondition,
    Domain,
    DomainPolicy,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    Material,
    NeoHookean,
    PointCloud,
    PointProblem,
    PointState,
    Side,
    Status,
)
from gasp_core.errors import EngineDivergedError
from gasp_core.simulation.monitor import inspect, watch_over
from gasp_core.stepping.time_step import rest_bound

__all__ = [
    "CAGE_HIGH",
    "CAGE_LOW",
    "Column",
    "Crush",
    "Edge",
    "Fall",
    "LongRun",
    "Meeting",
    "Unstable",
    "beam_swings",
    "block_crushes_itself",
    "block_leaves_domain",
    "block_storms_about",
    "cages",
    "cloud_falls",
    "clouds_without_volume",
    "column_collapses",
    "column_under_weight",
    "crowded_block",
    "few_points",
    "frame_beyond_budget",
    "heavy_meets_light",
    "heavy_on_light",
    "ringing_flight",
    "tossed_block",
    "unstable_runs",
]

Array = NDArray[Any]

GRAVITY = 9.81
DENSITY = 1000.0
SPACING = 0.25
CAGE_LOW, CAGE_HIGH = -1.0, 2.0
"""Edges of the cages that fast matter is kept in [m]."""
_AWAY = np.array([0.37, 0.21, 0.11])
"""A corner that is no whole number of cells from anything."""
_FRAMES_A_TENTH = 40
"""Of a long run."""
_DOWN = (0.0, 0.0, -GRAVITY)


def _floor(contact: ContactCondition) -> Collider:
    return Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), contact=contact)


def _solid(subject: Subject, density: float, youngs_modulus: float, poissons_ratio: float) -> Material:
    """Elastic matter of whichever law the engine declares; at small strain they are one."""
    law = next((law for law in (Elastic, NeoHookean) if law in subject.descriptor.capabilities.materials), Elastic)
    return law(density=density, youngs_modulus=youngs_modulus, poissons_ratio=poissons_ratio)


def _block(cells: int = 2) -> Array:
    return box_of_points(_AWAY, (cells, cells, cells), 1 / cells)


# Stiffness ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Relative errors of the head's deepest and mean sinking."""

    peak_error: float
    mean_error: float


def _column(subject: Subject, modulus: float, cells: int) -> PointProblem:
    spacing = 1 / cells
    column = box_of_points((_AWAY[0], _AWAY[1], 0.0), (1, 1, cells), spacing)
    return PointProblem(
        points=cloud_of([column], [np.zeros(3)], spacing),
        materials=(_solid(subject, DENSITY, modulus, 0.0),),
        colliders=(_floor(ContactCondition.SLIP),),
        gravity=_DOWN,
    )


def column_under_weight(subject: Subject, modulus: float, cells: int = 8) -> Column:
    """V5 at any stiffness [Pa]: weight sets in on a column on a slip floor; one period of its first mode."""
    problem = _column(subject, modulus, cells)
    z = problem.points.reference_positions[:, 2]
    head = z == z.max()
    period = oracles.column_period(1.0, oracles.bar_speed(modulus, DENSITY))
    # Past the end of the period: the column is slower than the closed form.
    times = np.linspace(0, 1.1 * period, 111)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=1 / cells), times)
    sinking = np.array([0.0, *(float((z - state.positions[:, 2])[head].mean()) for state in states)])
    static = float(oracles.column_deflection(z.max(), 1.0, DENSITY, GRAVITY, modulus))
    # From the top to where it is back there: one period of its own.
    back = 50 + int(np.argmin(sinking[50:]))
    return Column(
        peak_error=float(sinking.max()) / (2 * static) - 1,
        mean_error=float(np.mean((sinking[1 : back + 1] + sinking[:back]) / 2)) / static - 1,
    )


def column_collapses(subject: Subject, modulus: float) -> WatchedRun:
    """A column far too soft [Pa] for its own weight."""
    return watch_run(
        subject, _column(subject, modulus, 4), EngineAccuracy(spacing=SPACING), np.linspace(0, 0.5, 21)[1:]
    )


def frame_beyond_budget(subject: Subject, modulus: float, limit: int) -> WatchedRun:
    """A frame of 0.04 s of matter so stiff [Pa] that an explicit engine needs far more than `limit` substeps."""
    accuracy = EngineAccuracy(spacing=SPACING, substep_limit=limit)
    return watch_run(subject, _column(subject, modulus, 4), accuracy, [0.04])


# Nearly incompressible ------------------------------------------------------------------------------------------------


def beam_swings(subject: Subject, poissons_ratio: float, cells: int) -> tuple[float, float]:
    """V6, four times as long as thick: mean drop of the tip [m] and frequency [Hz] of a beam of `cells` cells.

    Not the deepest point of the swing: the stiffer in volume, the more steps, and each of them damps a little.
    """
    thickness, length = 1.0, 4.0
    spacing = thickness / cells
    modulus = 12 * DENSITY * GRAVITY * length**3 / (0.1 * thickness**2)
    # One cell of it is held.
    beam = box_of_points((-spacing, _AWAY[1], _AWAY[2]), (4 * cells + 1, cells, cells), spacing)
    problem = PointProblem(
        points=cloud_of([beam], [np.zeros(3)], spacing),
        materials=(_solid(subject, DENSITY, modulus, poissons_ratio),),
        colliders=(
            Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0)), contact=ContactCondition.STICK),
        ),
        gravity=_DOWN,
    )
    # That of a slender one; a thick one is slower.
    frequency = oracles.cantilever_frequency(length, thickness, oracles.bar_speed(modulus, DENSITY))
    tip = beam[:, 0] > length - spacing
    times = np.linspace(0, 1 / frequency, 51)[1:]
    accuracy = EngineAccuracy(spacing=spacing, substep_limit=10**6)
    z = problem.points.reference_positions[tip, 2]
    drop = [float((z - state.positions[tip, 2]).mean()) for state in subject.states(problem, accuracy, times)]
    swing = damped_oscillation(times, np.array(drop), frequency)
    return swing.mean, swing.frequency


# Light beside heavy ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """Largest change of total momentum, over the heavy body's; mean speed of the light one after, over the heavy one's
    before; substeps of all of it."""

    momentum_error: float
    light_speed: float
    substeps: int


def _pair(subject: Subject, ratio: float, gap: float, velocity: float, **scene: Any) -> PointProblem:
    """A cube `ratio` times as dense as another, `gap` [m] above it, moving at `velocity` [m/s] downwards."""
    cells = 2
    spacing = 1 / cells
    lower = box_of_points((_AWAY[0], _AWAY[1], 0.0), (cells, cells, cells), spacing)
    upper = lower + [0.0, 0.0, 1.0 + gap]
    light = _solid(subject, 1.0, 1e5, 0.3)
    heavy = _solid(subject, ratio, 1e5, 0.3)
    return PointProblem(
        points=cloud_of([lower, upper], [(0.0, 0.0, 0.0), (0.0, 0.0, -velocity)], spacing, [1, 0]),
        materials=(heavy, light),
        **scene,
    )


def heavy_meets_light(subject: Subject, ratio: float) -> Meeting:
    """A cube `ratio` times as dense runs into a resting one, weightless; long enough for both to come to terms.

    On a grid they feel each other from a cell and a half away, as the run begins; elsewhere as the gap has closed.
    Either way there is as much time again in which the light one goes where it was sent.
    """
    velocity, gap = 0.5, 0.75
    problem = _pair(subject, ratio, gap, velocity, gravity=NO_GRAVITY)
    masses = problem.masses
    light = problem.points.body_ids == 0
    start = masses @ problem.points.initial_velocities
    error, after = 0.0, 0.0
    times = np.linspace(0, 2 * gap / velocity, 21)[1:]
    journal = Journal()
    for state in subject.states(problem, EngineAccuracy(spacing=0.5), times, {Field.VELOCITIES}, journal):
        change = masses @ state.velocities - start
        error = max(error, float(np.linalg.norm(change) / np.linalg.norm(start)))
        after = -float(state.velocities[light, 2].mean()) / velocity
    return Meeting(momentum_error=error, light_speed=after, substeps=journal.substep_count)


def heavy_on_light(subject: Subject, ratio: float) -> WatchedRun:
    """A cube `ratio` times as dense on top of another one on a floor, under their own weight."""
    problem = _pair(subject, ratio, 0.0, 0.0, colliders=(_floor(ContactCondition.SEPARATE),), gravity=_DOWN)
    return watch_run(subject, problem, EngineAccuracy(spacing=0.5), np.linspace(0, 0.2, 11)[1:])


# Speed ----------------------------------------------------------------------------------------------------------------


def block_storms_about(subject: Subject, mach: float, cage: Domain | Collider) -> tuple[WatchedRun, Array]:
    """A block in a cage of 3 m, thrown into a corner of it at `mach` times its speed of sound.

    Returns
    -------
    The run, and how far any point was outside the cage at the end of each frame [m].
    """
    material = _solid(subject, DENSITY, 1e4, 0.3)
    block = _block()
    speed = mach * oracles.bar_speed(1e4, DENSITY)
    problem = PointProblem(
        points=cloud_of([block], [speed * np.array([0.6, 0.48, 0.64])], 0.5),
        materials=(material,),
        colliders=(cage,) if isinstance(cage, Collider) else (),
        domain=cage if isinstance(cage, Domain) else None,
        gravity=_DOWN,
    )
    # Once across at that speed, and the rebound.
    run = watch_run(subject, problem, EngineAccuracy(spacing=0.5), np.linspace(0, 12 / speed, 21)[1:])
    beyond = [np.maximum(CAGE_LOW - state.positions, state.positions - CAGE_HIGH).max() for state in run.states]
    return run, np.array(beyond)


def cages() -> dict[str, Domain | Collider]:
    """Ways to keep matter between 0 and 1 m, with 1 m to spare all around."""
    middle = (CAGE_LOW + CAGE_HIGH) / 2
    half = (CAGE_HIGH - CAGE_LOW) / 2
    walls = BoxShape(center=(middle,) * 3, half_extents=(half,) * 3)
    return {
        "walls": Collider(shape=walls, contact=ContactCondition.SEPARATE, side=Side.INSIDE),
        "clamping domain": Domain(lower=(CAGE_LOW,) * 3, upper=(CAGE_HIGH,) * 3, policy=DomainPolicy.CLAMP),
    }


# Scale and place ------------------------------------------------------------------------------------------------------


def tossed_block(subject: Subject, scale: float = 1.0, offset: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Where the points of a block are that is thrown, turning and ringing, in metres of one `scale` times as small.

    Lengths, stiffness and the square of time are `scale` times as large at the same density and gravity, which is the
    same motion (so are Froude's and Cauchy's numbers). Everything is `offset` [m] away.
    """
    block = _block(3)
    arms = block - block.mean(axis=0)
    # Turns and is stretched at a tenth of the speed of sound.
    velocities = np.array([0.8, -0.4, 1.5]) + np.cross([0.4, 0.7, -0.5], arms) + arms * [0.5, -0.3, 0.1]
    spacing = scale / 3
    problem = PointProblem(
        points=cloud_of([block * scale + offset], [velocities * math.sqrt(scale)], spacing),
        materials=(_solid(subject, DENSITY, 1e5 * scale, 0.3),),
        gravity=_DOWN,
    )
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [0.3 * math.sqrt(scale)])
    return (state.positions - np.asarray(offset)) / scale


# Few points, crowded points, clouds without a volume ------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Fall:
    """A cloud that falls.

    Parameters
    ----------
    run
        As far as it came; nothing else has a meaning where it was refused.
    error
        Largest distance from free fall [m].
    euler_error
        What symplectic Euler with the largest substep explains of it [m].
    distortion
        Largest distance of a point from where the cloud as a whole went [m].
    substeps
        Taken in all.
    reach
        Largest coordinate met, and way gone [m].
    """

    run: WatchedRun
    error: float
    euler_error: float
    distortion: float
    substeps: int
    reach: float


def cloud_falls(subject: Subject, positions: Array, accuracy: EngineAccuracy) -> Fall:
    """Any cloud (N, 3) [m], thrown, falls for half a second: each point as if it were alone."""
    velocity = np.array([1.0, -0.5, 2.0])
    count = len(positions)
    problem = PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.tile(velocity, (count, 1)),
            reference_volumes=np.full(count, 1e-3),
            material_ids=np.zeros(count),
            body_ids=np.zeros(count),
        ),
        materials=(plain_material(subject.descriptor.capabilities),),
        gravity=_DOWN,
    )
    run = watch_run(subject, problem, accuracy, np.linspace(0, 0.5, 6)[1:])
    error = distortion = reach = 0.0
    for state in run.states:
        exact = oracles.free_fall(positions, velocity, problem.gravity, state.time)
        off = state.positions - exact
        error = max(error, float(np.abs(off).max()))
        distortion = max(distortion, float(np.abs(off - off.mean(axis=0)).max()))
        reach = max(reach, float(np.abs(exact).max()) + float(np.linalg.norm(velocity)) * state.time)
    largest = max((report.largest_substep for report in run.reports), default=0.0)
    return Fall(
        run=run,
        error=error,
        euler_error=oracles.euler_fall_error(GRAVITY, 0.5, largest),
        distortion=distortion,
        substeps=sum(report.substep_count for report in run.reports),
        reach=reach,
    )


def few_points() -> Iterator[tuple[str, Array]]:
    """One, two, three points: alone, together in one cell, and far from each other."""
    apart = np.array([[0.0, 0.0, 0.0], [0.11, 0.02, -0.07], [-0.05, 0.13, 0.04]])
    for count in (1, 2, 3):
        yield f"{count} points", apart[:count] + _AWAY
    yield "2 points far apart", 30 * apart[:2] + _AWAY


def clouds_without_volume(spacing: float) -> Iterator[tuple[str, Array]]:
    """Clouds that no cell is filled by, on a grid of `spacing` [m]."""
    rng = np.random.default_rng(3)
    yield "a line", rng.random((17, 1)) * [1.0, 0.37, -0.21] + _AWAY
    yield "a line along an axis", rng.random((17, 1)) * [0.0, 1.0, 0.0]
    yield "a plane", rng.random((23, 2)) @ np.array([[1.0, 0.2, 0.3], [-0.1, 1.0, 0.4]])
    yield "a needle", rng.random((31, 3)) * [1.0, 1e-4, 1e-4] + _AWAY
    grid = spacing * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
    yield "points on corners of cells", grid
    yield "points on faces of cells", grid + [0.5 * spacing, 0.0, 0.5 * spacing]
    yield "all at one place", np.tile(_AWAY, (9, 1))
    yield "two at one place", np.repeat(rng.random((8, 3)), [2, 1, 1, 1, 1, 1, 1, 1], axis=0)
    yield "one far away", np.concatenate([rng.random((9, 3)) * 0.3, [[60.0, -70.0, 80.0]]])


def crowded_block(subject: Subject, crowd: bool) -> tuple[Array, Array]:
    """A block, thrown and ringing; if `crowd`, the half of its points on one side three times there, a third each.

    Returns
    -------
    Positions of the points as given once (N, 3), and the largest distance of copies from each other, both [m].
    """
    spacing = 0.5
    block = jittered(box_of_points(_AWAY, (2, 2, 2), spacing), spacing, 0.2, seed=5)
    copies = np.where(block[:, 0] > np.median(block[:, 0]), 3 if crowd else 1, 1)
    own = np.repeat(np.arange(len(block)), copies)
    # Rows in no order, so that copies are not neighbours.
    own = own[np.random.default_rng(6).permutation(len(own))]
    arms = block - block.mean(axis=0)
    velocities = np.array([0.3, -0.2, 1.0]) + np.cross([0.4, 0.7, -0.5], arms) + arms * [1.0, -0.8, 0.5]
    problem = PointProblem(
        points=PointCloud(
            reference_positions=block[own],
            initial_velocities=velocities[own],
            reference_volumes=((spacing / 2) ** 3 / copies)[own],
            material_ids=np.zeros(len(own)),
            body_ids=np.zeros(len(own)),
        ),
        materials=(_solid(subject, DENSITY, 1e5, 0.3),),
        gravity=_DOWN,
    )
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [0.3])
    first = np.array([int(np.flatnonzero(own == row)[0]) for row in range(len(block))])
    once = state.positions[first]
    return once, np.abs(state.positions - once[own]).max(axis=1)


# Crushed --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Crush:
    """A block that crushes itself.

    Parameters
    ----------
    run
        As far as it came.
    smallest_ratio
        Of volumes, as deformation gradients or else as the cloud's extents show it, while it was believed.
    stopped
        Why it ended: the engine's status, or what the detector says that watches every frame; "" for a run to the end.
    size_after
        Mean extent at the end, over that at the start.
    size_of_all_energy
        What it would be of a block that is stretched evenly and holds all that it began with.
    drift
        Largest distance of the centre of mass from where it was [m].
    untold
        Frames that show inverted points and whose report has no warning.
    """

    run: WatchedRun
    smallest_ratio: float
    stopped: str
    size_after: float
    size_of_all_energy: float
    drift: float
    untold: int


def block_crushes_itself(subject: Subject, rates: ArrayLike) -> Crush:
    """A weightless block in which all points fly towards its middle planes, at `rates` (3,) [speeds of sound / m]."""
    block = _block(3)
    modulus, ratio = 1e4, 0.3
    material = _solid(subject, DENSITY, modulus, ratio)
    sound = oracles.bar_speed(modulus, DENSITY)
    problem = PointProblem(
        points=cloud_of([block], [-sound * (block - block.mean(axis=0)) * rates], 1 / 3),
        materials=(material,),
        gravity=NO_GRAVITY,
    )
    times = np.linspace(0, 3 / sound, 61)[1:]
    run = watch_run(subject, problem, EngineAccuracy(spacing=1 / 3), times)
    stopped = "" if run.finished else run.ending
    watch = watch_over(problem, times[0])
    believed = list(run.states)
    for number, (before, now) in enumerate(itertools.pairwise(run.states), start=1):
        verdict = inspect(watch, before, now)
        if verdict.status is not Status.OK:
            stopped, believed = verdict.reason, believed[:number]
            break
    size = np.ptp(block, axis=0)
    moved = [(state.positions - block).mean(axis=0) for state in run.states]
    shown = [state.deformation_gradients for state in run.states]
    energy = 0.5 * float(problem.masses @ (problem.points.initial_velocities**2).sum(axis=1))
    shear_modulus = modulus / (2 * (1 + ratio))
    volume = float(problem.points.reference_volumes.sum())
    inverted = [found is not None and _surely_inverted(found, unit_roundoff(subject)) for found in shown[1:]]
    return Crush(
        run=run,
        smallest_ratio=min(_volume_ratio(state, size) for state in believed),
        stopped=stopped,
        size_after=float(np.mean(np.ptp(run.states[-1].positions, axis=0) / size)),
        # Stretched by s along its axes it holds V mu sum (s - 1)^2 at least if it is corotated (Stomakhin et al. 2012),
        # and half of that if it is neo-Hookean, s - 1 being above ln s. The mean of three numbers is no more than the
        # root of the mean of their squares.
        size_of_all_energy=1 + math.sqrt(2 * energy / (3 * shear_modulus * volume)),
        drift=float(np.linalg.norm(moved, axis=1).max()),
        untold=sum(turned and not report.warnings for turned, report in zip(inverted, run.reports)),
    )


def _surely_inverted(gradients: Array, unit: float) -> bool:
    """Whether det F <= 0 of any point in whatever order it is summed; where its terms cancel, the sign is chance.

    a . (b x c) takes five roundings of each of its six products at most: two orders differ by less than 10 u times the
    sum of the products' sizes.
    """
    a, b, c = (gradients[:, row] for row in range(3))
    determinants = np.einsum("pi,pi->p", a, np.cross(b, c))
    left, right = (np.roll(np.abs(b), -k, axis=1) * np.roll(np.abs(c), -(3 - k), axis=1) for k in (1, 2))
    sizes = np.einsum("pi,pi->p", np.abs(a), left + right)
    return bool((determinants < -10 * unit * sizes).any())


def _volume_ratio(state: PointState, size: Array) -> float:
    if state.deformation_gradients is None:
        return float(np.prod(np.ptp(state.positions, axis=0) / size))
    return float(np.linalg.det(state.deformation_gradients).min())


# The domain's edge ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """A block that flies towards the edge of its domain.

    Parameters
    ----------
    run
        As far as it came.
    touched
        When its first point reaches the edge [s].
    error
        Largest distance from free flight [m]; 0 where the domain clamps, which is felt before it is reached.
    reach
        Largest coordinate met [m].
    beyond
        How far any point was outside the domain [m].
    warned
        Whether any report after that has a warning.
    """

    run: WatchedRun
    touched: float
    error: float
    reach: float
    beyond: float
    warned: bool


def block_leaves_domain(subject: Subject, policy: DomainPolicy) -> Edge:
    """A weightless block flies along a diagonal out of a box that has half a metre of room around it."""
    block = _block()
    velocity = np.array([1.0, -0.8, 0.6])
    room = 0.5
    lower, upper = block.min(axis=0) - room, block.max(axis=0) + room
    problem = PointProblem(
        points=cloud_of([block], [velocity], 0.5),
        materials=(plain_material(subject.descriptor.capabilities),),
        gravity=NO_GRAVITY,
        domain=Domain(lower=tuple(lower), upper=tuple(upper), policy=policy),
    )
    touched = float((room / np.abs(velocity)).min())
    run = watch_run(subject, problem, EngineAccuracy(spacing=0.5), np.linspace(0, 3 * touched, 31)[1:])
    error = reach = 0.0
    beyond = -math.inf
    for state in run.states:
        exact = block + velocity * state.time
        if policy is not DomainPolicy.CLAMP:
            error = max(error, float(np.abs(state.positions - exact).max()))
        reach = max(reach, float(np.abs(exact).max()))
        beyond = max(beyond, float(np.maximum(lower - state.positions, state.positions - upper).max()))
    after = [report for report, state in zip(run.reports, run.states[1:]) if state.time > touched]
    return Edge(
        run=run,
        touched=touched,
        error=error,
        reach=reach,
        beyond=beyond,
        warned=any(report.warnings for report in after),
    )


# Long runs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class LongRun:
    """A body that nothing acts on.

    Parameters
    ----------
    energy
        Largest kinetic energy about the centre of mass, over that at the start.
    energy_rise
        Largest of a tenth of the run, over that of the tenth before.
    momentum_error
        Largest change, over the momentum at the start.
    ended
        Why, where it ended before its time; "" for a whole run.
    """

    energy: float
    energy_rise: float
    momentum_error: float
    ended: str


def ringing_flight(subject: Subject, substeps: int) -> LongRun:
    """A bar of 32 points rings, turns and flies on, weightless, for about so many substeps."""
    cells = 4
    modulus = 1e4
    spacing = 1 / cells
    bar = box_of_points(_AWAY, (cells, 1, 1), spacing)
    material = _solid(subject, DENSITY, modulus, 0.0)
    sound = oracles.bar_speed(modulus, DENSITY)
    arms = bar - bar.mean(axis=0)
    ringing = 0.01 * np.pi * sound * np.cos(np.pi * (bar[:, :1] - _AWAY[0])) * [1.0, 0.0, 0.0]
    flight = np.array([0.5, -0.3, 0.4])
    problem = PointProblem(
        points=cloud_of([bar], [flight + ringing + np.cross([0.0, 0.05, 0.03], arms)], spacing),
        materials=(material,),
        gravity=NO_GRAVITY,
    )
    masses = problem.masses
    momentum = masses @ problem.points.initial_velocities

    def inner_energy(velocities: Array) -> float:
        own = velocities - masses @ velocities / masses.sum()
        return float(0.5 * masses @ (own**2).sum(axis=1))

    start = inner_energy(problem.points.initial_velocities)
    step = 0.5 * rest_bound(material, spacing)
    accuracy = EngineAccuracy(spacing=spacing, substep=step)
    times = np.linspace(0, substeps * step, 10 * _FRAMES_A_TENTH + 1)[1:]
    energies: list[float] = []
    error, ended = 0.0, ""
    try:
        for state in subject.states(problem, accuracy, times, {Field.VELOCITIES}):
            energies.append(inner_energy(state.velocities))
            change = masses @ state.velocities - momentum
            error = max(error, float(np.linalg.norm(change) / np.linalg.norm(momentum)))
    except EngineDivergedError as stopped:
        ended = str(stopped)
    whole = len(energies) // _FRAMES_A_TENTH * _FRAMES_A_TENTH
    tenths = np.array(energies[:whole]).reshape(-1, _FRAMES_A_TENTH).max(axis=1)
    return LongRun(
        energy=max(energies, default=0.0) / start,
        energy_rise=float(max(tenths[1:] / tenths[:-1], default=0.0)),
        momentum_error=error,
        ended=ended,
    )


# Too large a step -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Unstable:
    """A run at a step that is too large.

    Parameters
    ----------
    run
        As far as it came.
    drift
        Largest distance of its centre of mass from uniform motion while it was reported OK [m].
    rounding
        What rounding explains of that [m].
    untold
        Frames reported OK without a warning, beyond the first, though the detector would end the run there.
    """

    run: WatchedRun
    drift: float
    rounding: float
    untold: int


def unstable_runs(subject: Subject) -> dict[str, Unstable]:
    """Weightless blocks in flight, at a fixed substep that is too large for them, by what makes it so."""
    material = _solid(subject, DENSITY, 1e4, 0.3)
    sound = oracles.bar_speed(1e4, DENSITY)
    spacing = 0.5
    block = jittered(_block(), spacing, 0.2, seed=2)
    arms = block - block.mean(axis=0)
    flight = sound * np.array([0.1, -0.05, 0.08])
    noise = 0.01 * sound * np.random.default_rng(4).normal(size=block.shape)
    bound = (subject.descriptor.capabilities.stable_step or rest_bound)(material, spacing)
    scenes = {
        "1.1 times the bound": (noise, 1.1),
        # Stable as long as matter is not deformed.
        "0.95 times the bound, stretched": (noise + sound * arms, 0.95),
        "0.95 times the bound, sheared": (noise + sound * arms[:, [1, 2, 0]], 0.95),
        # Some cells a substep.
        "0.95 times the bound, fast": (noise + 10 * flight / np.linalg.norm(flight) * sound, 0.95),
    }
    found: dict[str, Unstable] = {}
    for name, (motion, share) in scenes.items():
        velocities = flight + motion
        problem = PointProblem(
            points=cloud_of([block], [velocities], spacing), materials=(material,), gravity=NO_GRAVITY
        )
        step = share * bound
        accuracy = EngineAccuracy(spacing=spacing, substep=step)
        # The engine has a frame's time to find out.
        times = 5 * step * np.arange(1, 81)
        run = watch_run(subject, problem, accuracy, times, grace=1)
        uniform = velocities.mean(axis=0)
        off = [np.linalg.norm((state.positions - block).mean(axis=0) - uniform * state.time) for state in run.states]
        reach = max((float(np.abs(state.positions).max()) for state in run.states), default=0.0)
        substeps = sum(report.substep_count for report in run.reports)
        watch = watch_over(problem, times[0])
        doubted = [
            not report.warnings and inspect(watch, before, now).status is not Status.OK
            for (before, now), report in zip(itertools.pairwise(run.states), run.reports)
        ]
        found[name] = Unstable(
            run=run,
            drift=float(max(off, default=0.0)),
            rounding=reach * rounding(subject, substeps),
            untold=max(0, sum(doubted) - 1),
        )
    return found
