"""The verification cases: each runs a shared scene through the contract, and returns what it measured.

No case judges: bounds and their reasons are in the tests. Cases in one dimension are bars one cell thick with nu = 0:
their sides are free and stay where they are. Numbers are in the scene files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.clouds import POINTS_PER_CELL
from gasp_conformance.observables import (
    angular_momentum,
    damped_oscillation,
    flights,
    half_height_width,
    kinetic_energy,
    mode_amplitude,
)
from gasp_conformance.scenes import SharedScene, shared_scene, thrown_block
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import Elastic, Field, Fluid, HalfSpace, Material

__all__ = [
    "BarsCollide",
    "Bounce",
    "Cantilever",
    "ColumnSinks",
    "Drift",
    "Fall",
    "HangingBeam",
    "HeldBar",
    "Slide",
    "Tank",
    "Tumble",
    "ball_bounces",
    "bar_rings",
    "bars_collide",
    "beam_hangs",
    "block_drifts",
    "block_falls",
    "block_slides",
    "block_spins",
    "block_tumbles",
    "cantilever_swings",
    "column_sinks",
    "energy_after_throw",
    "held_bar_rings",
    "tank_settles",
]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fall:
    """Largest distance from free fall [m], and what symplectic Euler with the largest substep would have."""

    error: float
    euler_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Root mean square distance from the shifted shape over its size; largest relative change of momentum."""

    shape_error: float
    momentum_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldBar:
    """Relative errors of the frequency and of the mean displacement's first peak."""

    frequency_error: float
    peak_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnSinks:
    """Relative errors of the head's deepest and mean sinking and of the period; largest distance of the head from the
    closed form up to H/c, over the static sinking."""

    peak_error: float
    mean_error: float
    period_error: float
    fall_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cantilever:
    """Relative errors of the tip's mean drop and of the first frequency."""

    drop_error: float
    frequency_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HangingBeam:
    """Relative error of the tip's drop; root mean square speed at the end times the time it was given, in lengths."""

    drop_error: float
    unrest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BarsCollide:
    """Errors of total momentum, over one bar's, and of contact time, relative; speed after over speed before; whether
    one ever had a hundredth of its momentum from the other."""

    momentum_error: float
    time_error: float
    restitution: float
    touched: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounce:
    """What the flights of a ball say.

    Parameters
    ----------
    flight_count
        Arcs, the fall included.
    gravity_error
        Largest relative error of the gravity fitted to an arc.
    peak_ratio
        Largest height of fall from a peak over that from the peak before.
    energy_ratio
        Largest energy of the ball's centre over that at the start, both above the centre's lowest place.
    """

    flight_count: int
    gravity_error: float
    peak_ratio: float
    energy_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """Relative error of the way down the incline; speed [m/s] at which a block creeps that friction should hold."""

    distance_error: float
    creep: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tank:
    """Water at rest.

    Parameters
    ----------
    surface_error
        Of the surface's height, in cells.
    sinking_error
        Of the mean sinking of the water, relative.
    speed
        Root mean square, over sqrt(g H).
    volume_error
        Of the box around the water against area times the closed form's height, relative.
    """

    surface_error: float
    sinking_error: float
    speed: float
    volume_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tumble:
    """Largest change of linear momentum, over the sum of m |v|; substeps taken."""

    momentum_error: float
    substep_count: int


def _frames(duration: float, count: float) -> Array:
    """Equally spaced times after 0 [s]."""
    return np.linspace(0, duration, round(count) + 1)[1:]


def block_falls(subject: Subject, material: Material) -> Fall:
    """V1: a block of any material, thrown, flies for one second."""
    scene = shared_scene("v1_free_fall")
    cells = scene.cells[0]
    problem = replace(scene.problem(cells), materials=(material,))
    block, velocity = problem.points.reference_positions, problem.points.initial_velocities
    duration = scene.numbers["duration"]
    journal = Journal()
    error = 0.0
    times = _frames(duration, scene.numbers["frames"])
    for state in subject.states(problem, scene.accuracy(cells), times, (), journal):
        exact = oracles.free_fall(block, velocity, problem.gravity, state.time)
        error = max(error, float(np.abs(state.positions - exact).max()))
    strength = math.hypot(*problem.gravity)
    return Fall(error=error, euler_error=oracles.euler_fall_error(strength, duration, journal.largest_substep))


def block_drifts(subject: Subject) -> Drift:
    """V2: a block flies through the grid without weight for one second."""
    scene = shared_scene("v2_drift")
    cells = scene.cells[0]
    problem = scene.problem(cells)
    block, masses = problem.points.reference_positions, problem.masses
    momentum = masses @ problem.points.initial_velocities
    shape_error = momentum_error = 0.0
    times = _frames(scene.numbers["duration"], scene.numbers["frames"])
    for state in subject.states(problem, scene.accuracy(cells), times, {Field.VELOCITIES}):
        moved = state.positions - block
        off = moved - moved.mean(axis=0)
        shape_error = max(shape_error, math.sqrt(float(np.mean(np.sum(off**2, axis=1)))) / scene.length)
        change = masses @ state.velocities - momentum
        momentum_error = max(momentum_error, float(np.linalg.norm(change) / np.linalg.norm(momentum)))
    return Drift(shape_error=shape_error, momentum_error=momentum_error)


def _solid(scene: SharedScene) -> Elastic:
    material = scene.material
    assert isinstance(material, Elastic), scene.name
    return material


def _along(scene: SharedScene, axis: int, places: Array) -> Array:
    """Distance of places (N, 3) [m] from the body's corner along an axis, (N,) [m]; negative where it is embedded."""
    return places[:, axis] - scene.bodies[0].corner[axis]


def bar_rings(subject: Subject, cells: int) -> float:
    """V3: relative error of the frequency of a free bar in its first mode."""
    scene = shared_scene("v3_free_bar")
    material, numbers = _solid(scene), scene.numbers
    frequency = oracles.bar_frequency(scene.length, oracles.bar_speed(material.youngs_modulus, material.density))
    (bar,) = scene.places(cells)
    shape = np.cos(np.pi * _along(scene, 0, bar) / scene.length)
    velocities = np.zeros_like(bar)
    velocities[:, 0] = numbers["amplitude"] * 2 * np.pi * frequency * shape
    times = _frames(numbers["periods"] / frequency, numbers["periods"] * numbers["frames_per_period"])
    states = subject.states(scene.problem(cells, [velocities]), scene.accuracy(cells), times)
    amplitudes = [mode_amplitude(state.positions[:, 0] - bar[:, 0], shape) for state in states]
    return damped_oscillation(times, np.array(amplitudes), frequency).frequency / frequency - 1


def held_bar_rings(subject: Subject, cells: int) -> HeldBar:
    """V4: a bar that is held at one end rings in its first mode; its mean displacement is followed."""
    scene = shared_scene("v4_fixed_free_bar")
    material, numbers = _solid(scene), scene.numbers
    speed = oracles.bar_speed(material.youngs_modulus, material.density)
    period = oracles.column_period(scene.length, speed)
    (bar,) = scene.places(cells)
    along = _along(scene, 0, bar)
    free = along > 0
    velocities = np.zeros_like(bar)
    velocities[free, 0] = numbers["speed"] * np.sin(np.pi * along[free] / (2 * scene.length))
    times = _frames(numbers["periods"] * period, numbers["periods"] * numbers["frames_per_period"])
    states = subject.states(scene.problem(cells, [velocities]), scene.accuracy(cells), times)
    mean = np.array([float((state.positions[:, 0] - bar[:, 0])[free].mean()) for state in states])
    frequency = damped_oscillation(times, mean, 1 / period).frequency
    closed = oracles.fixed_free_bar_mean(times, scene.length, speed, numbers["speed"])
    early = times <= period / 2
    return HeldBar(
        frequency_error=frequency * period - 1, peak_error=float(mean[early].max() / closed[early].max()) - 1
    )


def column_sinks(subject: Subject, scene: SharedScene, cells: int) -> ColumnSinks:
    """V5: weight sets in on a column that stands on a slip floor, with free sides or between slip walls."""
    material, height = _solid(scene), scene.length
    confined = oracles.confined_modulus(material.youngs_modulus, material.poissons_ratio)
    speed = oracles.bar_speed(confined, material.density)
    period = oracles.column_period(height, speed)
    gravity = -scene.gravity[2]
    (column,) = scene.places(cells)
    z = column[:, 2]
    head = z == z.max()
    shape = np.sin(np.pi * z / (2 * height))
    # A little over whole periods: the column is slower than the closed form, and means are over whole periods.
    periods = scene.numbers["periods"]
    times = _frames(1.05 * periods * period, 1.05 * periods * scene.numbers["frames_per_period"])
    states = subject.states(scene.problem(cells), scene.accuracy(cells), times)
    sinking = np.array([z - state.positions[:, 2] for state in states])
    amplitudes = np.array([mode_amplitude(row, shape) for row in sinking])
    frequency = damped_oscillation(times, amplitudes, 1 / period).frequency
    tip = sinking[:, head].mean(axis=1)
    static = float(oracles.column_deflection(z.max(), height, material.density, gravity, confined))
    early = times <= height / speed
    closed = oracles.column_tip_motion(times[early], height, speed, gravity)
    whole = np.linspace(0, periods / frequency, 401)
    followed = np.interp(whole, np.concatenate([[0.0], times]), np.concatenate([[0.0], tip]))
    return ColumnSinks(
        peak_error=float(tip.max()) / (2 * static) - 1,
        mean_error=float(np.mean((followed[1:] + followed[:-1]) / 2)) / static - 1,
        period_error=1 / (frequency * period) - 1,
        fall_error=float(np.abs(tip[early] - closed).max()) / static,
    )


def _beam_weight(scene: SharedScene) -> float:
    """K of a beam along x that hangs down z."""
    material, thickness = _solid(scene), scene.bodies[0].proportions[2] * scene.length
    return oracles.gravity_parameter(
        material.density, -scene.gravity[2], scene.length, thickness, material.youngs_modulus
    )


def _tip(scene: SharedScene, beam: Array) -> tuple[Array, float]:
    """Which points of a beam (N, 3) [m] are its last layer, and that layer's place x/L."""
    along = _along(scene, 0, beam) / scene.length
    return along == along.max(), float(along.max())


def cantilever_swings(subject: Subject, cells: int) -> Cantilever:
    """V6: weight sets in on a slender cantilever, which swings about the static deflection."""
    scene = shared_scene("v6_cantilever")
    material, body, numbers = _solid(scene), scene.bodies[0], scene.numbers
    thickness = body.proportions[2] * scene.length
    speed = oracles.bar_speed(material.youngs_modulus, material.density)
    frequency = oracles.cantilever_frequency(scene.length, thickness, speed)
    (beam,) = scene.places(cells)
    tip, place = _tip(scene, beam)
    times = _frames(numbers["periods"] / frequency, numbers["periods"] * numbers["frames_per_period"])
    states = subject.states(scene.problem(cells), scene.accuracy(cells), times)
    drop = np.array([float((beam - state.positions)[tip, 2].mean()) for state in states])
    swing = damped_oscillation(times, drop, frequency)
    static = oracles.cantilever_deflection(place, _beam_weight(scene), scene.length / thickness) * scene.length
    return Cantilever(drop_error=swing.mean / float(static) - 1, frequency_error=swing.frequency / frequency - 1)


def beam_hangs(subject: Subject, scene: SharedScene, cells: int, held: float = 0.0) -> HangingBeam:
    """V7: a beam bends far under its own weight; still air brings it to rest. Some cells of its length are `held` too.

    It stands between slip walls, because a blade one cell thin that carries such a weight buckles sideways: beyond
    q L^3 = 12.85 sqrt(E I_y G J) for a cantilever (Timoshenko and Gere, "Theory of Elastic Stability", 6.4).
    """
    (beam,) = scene.places(cells)
    tip, place = _tip(scene, beam)
    duration, free = scene.numbers["duration"], 1 - held / cells
    # In four frames, so that none needs more substeps than an engine grants a frame by default.
    problem = replace(scene.problem(cells), colliders=scene.side_walls(cells, "y"))
    if held:
        plane = (scene.bodies[0].corner[0] + held * scene.spacing(cells), 0.0, 0.0)
        (pin,) = problem.drives
        problem = replace(problem, drives=(replace(pin, region=HalfSpace(point=plane, normal=(1.0, 0.0, 0.0))),))
    *_, end = subject.states(problem, scene.accuracy(cells), _frames(duration, 4), {Field.VELOCITIES})
    drop = float((beam - end.positions)[tip, 2].mean()) / scene.length
    speed = math.sqrt(float(np.mean(np.sum(end.velocities**2, axis=1))))
    slenderness = free / scene.bodies[0].proportions[2]
    weight = _beam_weight(scene) * free**3
    exact = free * float(oracles.heavy_beam_drop((place - 1 + free) / free, weight, slenderness)[0])
    return HangingBeam(drop_error=drop / exact - 1, unrest=speed * duration / scene.length)


def block_spins(subject: Subject, cells: int) -> float:
    """V8: share of its angular momentum that a stiff square plate, spinning freely, still shows in its velocities."""
    scene = shared_scene("v8_spin")
    problem = scene.problem(cells)
    points, masses = problem.points, problem.masses
    start = angular_momentum(masses, points.reference_positions, points.initial_velocities)[2]
    times = _frames(scene.numbers["duration"], scene.numbers["frames"])
    states = subject.states(problem, scene.accuracy(cells), times, {Field.VELOCITIES})
    kept = [angular_momentum(masses, state.positions, state.velocities)[2] / start for state in states]
    # The plate breathes a little with its own centrifugal force: average over the later half.
    return float(np.mean(kept[len(kept) // 2 :]))


def bars_collide(subject: Subject, cells: int) -> BarsCollide:
    """V10: two equal bars run into each other head on."""
    scene = shared_scene("v10_collision")
    material, numbers = _solid(scene), scene.numbers
    speed = oracles.bar_speed(material.youngs_modulus, material.density)
    contact_time = oracles.collision_time(scene.length, speed)
    problem = scene.problem(cells)
    masses = problem.masses
    body = problem.points.body_ids == 0
    own = float(masses[body] @ problem.points.initial_velocities[body, 0])
    times = _frames(
        numbers["contact_times"] * contact_time, numbers["contact_times"] * numbers["frames_per_contact_time"]
    )
    momenta, totals = [own], []
    for state in subject.states(problem, scene.accuracy(cells), times, {Field.VELOCITIES}):
        momenta.append(float(masses[body] @ state.velocities[body, 0]))
        totals.append(float(np.abs(masses @ state.velocities).max()))
    force = -np.diff(momenta) / np.diff(np.concatenate([[0.0], times]))
    # rho c v times the cross-section is the contact force of the closed form, constant while it lasts.
    plateau = 2 * own / contact_time
    return BarsCollide(
        momentum_error=max(totals) / own,
        time_error=half_height_width(times, force, plateau) / contact_time - 1,
        restitution=-momenta[-1] / own,
        touched=float(np.abs(np.array(momenta) - own).max()) > 0.01 * own,
    )


def ball_bounces(subject: Subject, cells: int) -> Bounce:
    """V11: a ball is dropped from a metre onto a floor and bounces."""
    scene = shared_scene("v11_bounce")
    problem, spacing = scene.problem(cells), scene.spacing(cells)
    masses = problem.masses / problem.masses.sum()
    gravity = -scene.gravity[2]
    times = _frames(scene.numbers["duration"], scene.numbers["frames"])
    heights, speeds, clear = [], [], []
    for state in subject.states(problem, scene.accuracy(cells), times, {Field.VELOCITIES}):
        heights.append(float(masses @ state.positions[:, 2]))
        speeds.append(float(masses @ state.velocities[:, 2]))
        # Quadratic B-splines feel the floor from a cell and a half away, wider kernels from two.
        clear.append(float(state.positions[:, 2].min()) > 2 * spacing)
    # The ball's centre when it touches the floor is where its energy of position is counted from.
    height = np.array(heights) - scene.length / 2
    arcs = flights(times, height, np.array(clear))
    start = gravity * scene.bodies[0].corner[2]
    energy = gravity * height + np.square(speeds) / 2
    falls = np.array([arc.peak for arc in arcs])
    return Bounce(
        flight_count=len(arcs),
        gravity_error=max((abs(arc.gravity / gravity - 1) for arc in arcs), default=math.inf),
        peak_ratio=float(np.max(falls[1:] / falls[:-1], initial=0.0)),
        energy_ratio=float(energy.max()) / start,
    )


def block_slides(subject: Subject) -> Slide:
    """V12: on an incline of 24 degrees a block slides with mu = tan 15 degrees and stays with mu = tan 35 degrees.

    The sliding block starts at 1 m/s. One let go at rest sticks, rightly, until its weight has arrived at the foot: in
    an elastic block pressure comes with c_p and shear with c_s, and c_s/c_p tan 24 < mu. It is then ahead of the rigid
    body of the closed form by that much friction it never felt (5 % here, 1.5 % with ten times the stiffness).
    """
    sliding, held = shared_scene("v12_sliding"), shared_scene("v12_held")
    duration = sliding.numbers["duration"]
    (way,) = _way_down(subject, sliding, np.array([duration]))
    across, _, down = sliding.gravity
    acceleration = oracles.incline_acceleration(
        math.atan2(across, -down), sliding.colliders[0].friction, math.hypot(across, down)
    )
    # Put onto the slope at once, the held block slips in its first sways, and sways by some mm at 5 Hz for long: it
    # creeps by the slope of a line through many sways, when it has stood for a while.
    times = np.linspace(held.numbers["settled"], held.numbers["duration"], round(held.numbers["frames"]))
    creep = float(np.polyfit(times, _way_down(subject, held, times), 1)[0])
    return Slide(distance_error=float(way) / (acceleration * duration**2 / 2) - 1, creep=creep)


def _way_down(subject: Subject, scene: SharedScene, times: Array) -> Array:
    """How far ahead of uniform motion a block on an incline is at `times` [s], (T,) [m]."""
    cells = scene.cells[0]
    problem = scene.problem(cells)
    start, speed = problem.points.reference_positions, scene.bodies[0].velocity[0]
    states = subject.states(problem, scene.accuracy(cells), times)
    return np.array([float((state.positions - start)[:, 0].mean()) - speed * state.time for state in states])


def tank_settles(subject: Subject, cells: int) -> Tank:
    """V13: water in a tank sinks together under its own weight; still air brings it to rest."""
    scene = shared_scene("v13_tank")
    material, height, spacing = scene.material, scene.length, scene.spacing(cells)
    assert isinstance(material, Fluid), scene.name
    gravity = -scene.gravity[2]
    problem = scene.problem(cells)
    water = problem.points.reference_positions
    *_, end = subject.states(problem, scene.accuracy(cells), _frames(scene.numbers["duration"], 4), {Field.VELOCITIES})

    def settled(heights: Array) -> Array:
        return oracles.fluid_column_heights(heights, height, material.density, gravity, material.bulk_modulus)

    z = water[:, 2]
    top = z == z.max()
    # Faces of the body of water, by the means of its outermost points; each stands for half its cell beyond it.
    sides = [
        float((end.positions[own == own.max(), axis]).mean() - (end.positions[own == own.min(), axis]).mean())
        + spacing / POINTS_PER_CELL
        for axis, own in enumerate(water.T)
    ]
    area = math.prod(scene.bodies[0].proportions[:2]) * height**2
    speed = math.sqrt(float(np.mean(np.sum(end.velocities**2, axis=1))))
    surface = float(end.positions[top, 2].mean() - settled(z.max()))
    return Tank(
        surface_error=surface / spacing,
        sinking_error=float((z - end.positions[:, 2]).mean() / (z - settled(z)).mean()) - 1,
        speed=speed / math.sqrt(gravity * height),
        volume_error=math.prod(sides) / (area * float(settled(np.array(height)))) - 1,
    )


def block_tumbles(subject: Subject, substeps: int) -> Tumble:
    """A block turns and wobbles without weight for many substeps; its linear momentum is watched."""
    scene = shared_scene("v16_smooth")
    problem, accuracy = scene.problem(scene.cells[0]), scene.accuracy(scene.cells[0])
    masses, velocities = problem.masses, problem.points.initial_velocities
    start, scale = masses @ velocities, float(masses @ np.linalg.norm(velocities, axis=1))
    step = scene.fixed_substep(scene.cells[0])
    journal = Journal()
    times = _frames(substeps * step, 20)
    states = subject.states(problem, replace(accuracy, substep=step), times, {Field.VELOCITIES}, journal)
    error = max(float(np.linalg.norm(masses @ state.velocities - start)) / scale for state in states)
    return Tumble(momentum_error=error, substep_count=journal.substep_count)


def energy_after_throw(subject: Subject, material: Material, cells: int) -> float:
    """Largest kinetic energy of a block thrown on a floor, over what the start and gravity account for."""
    throw = thrown_block(material, cells)
    problem = throw.problem
    masses, places = problem.masses, problem.points.reference_positions
    start = kinetic_energy(masses, problem.points.initial_velocities)
    ratios = []
    for state in subject.states(problem, throw.accuracy, _frames(throw.end, 50), {Field.VELOCITIES}):
        released = float(masses @ (state.positions - places) @ np.asarray(problem.gravity))
        ratios.append(kinetic_energy(masses, state.velocities) / (start + max(released, 0.0)))
    return max(ratios)
