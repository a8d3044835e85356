"""What tells one material from another, each case run through the contract; it measures and does not judge.

Solids are told by how free bodies ring, which needs no wall; sand and fluids by what they do not resist, and on floors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import curve_fit

from gasp_conformance import capability_oracles as exact
from gasp_conformance import oracles
from gasp_conformance.clouds import POINTS_PER_CELL, box_of_points, cloud_of
from gasp_conformance.observables import damped_oscillation, mode_amplitude
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_conformance.wall_cases import floor_of
from gasp_core.contract import (
    Collider,
    ContactCondition,
    Elastic,
    EngineAccuracy,
    Fluid,
    Foam,
    HalfSpace,
    Material,
    Metal,
    NeoHookean,
    Plasticine,
    PointProblem,
    Rigid,
    Sand,
    Snow,
)

__all__ = [
    "Decay",
    "Flowed",
    "Pressed",
    "Relaxed",
    "Ring",
    "Sinking",
    "Spin",
    "Swing",
    "ball_breathes",
    "bar_between_walls_flows",
    "bar_stretches_far",
    "block_shears_and_returns",
    "block_swings",
    "confined_column_sinks",
    "lame_block",
    "loose_block_parts",
    "rigid_block_spins",
    "shear_flow_dies",
    "shear_relaxes",
    "snow_between_walls_is_pressed",
    "snow_is_pressed",
    "snow_is_pulled_and_swings",
    "snow_is_torn",
    "spreads_on_a_floor",
    "unyielding",
]

Array = NDArray[Any]
Solid = Elastic | NeoHookean | Snow
Yielding = Metal | Plasticine | Foam

GRAVITY = 9.81
_AWAY = np.array([0.37, 0.21, 0.11])
"""A corner that is no whole number of cells from anything."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """Relative error of a frequency, and what the grid may leave of it."""

    error: float
    dispersion: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Sinking:
    """Relative errors of a column's period and of how deep it sinks."""

    period_error: float
    depth_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """Relative error of a rate of decay, and what grid, transfers and substeps may leave of it."""

    error: float
    dispersion: float
    transfers: float
    stepping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """Farthest that a block was sheared, and how far it was at least from then on, over the elastic amplitude."""

    highest: float
    lowest_after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxed:
    """Relative error of a relaxation time, and what grid, transfers, substeps and yield stress may leave of it."""

    error: float
    dispersion: float
    transfers: float
    stepping: float
    unyielding: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Flowed:
    """A bar between two heavy caps that were thrown at each other, and between walls.

    Parameters
    ----------
    length_error
        Of the length that its swing below yield stands for, relative.
    pressing_error
        Of the work that is lost until it is shortest, over that of its law; relative.
    return_error
        The same from there until it is longest.
    """

    length_error: float
    pressing_error: float
    return_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Pressed:
    """A bar of snow between two heavy caps that were thrown at each other.

    Parameters
    ----------
    length_error
        Of the length that its swing below yield stands for, relative.
    set_error
        Of what it is shorter by for good, over the closed form's for the work that was done on it; relative.
    frequency_error
        Of how much faster it swings than before, over the closed form's for the set it has; relative.
    swing_error
        Of how far it swings about that set, over its critical compression; relative.
    """

    length_error: float
    set_error: float
    frequency_error: float
    swing_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Spin:
    """A rigid body in flight: change of its distances and error of its places, over its size, and Euler's share."""

    distance_change: float
    place_error: float
    stepping: float


def lame_block(cells: int) -> tuple[Array, Array, float]:
    """A square plate, 1 m wide and a cell thick, Lame's mode at its points, and the spacing."""
    spacing = 1.0 / cells
    plate = box_of_points(_AWAY, (cells, cells, 1), spacing)
    return plate, exact.lame_shape(plate - _AWAY, 1.0), spacing


def _lame_amplitudes(
    subject: Subject, material: Material, cells: int, velocity: float, times: Array, journal: Journal | None = None
) -> Array:
    """Amplitudes (T,) [m] of Lame's mode in a plate that is thrown with `velocity` [m/s] in that mode."""
    plate, shape, spacing = lame_block(cells)
    problem = PointProblem(
        points=cloud_of([plate], [velocity * shape], spacing), materials=(material,), gravity=NO_GRAVITY
    )
    states = subject.states(problem, EngineAccuracy(spacing=spacing), times, (), journal)
    return np.array([mode_amplitude((state.positions - plate).ravel(), shape.ravel()) for state in states])


def block_shears_and_returns(subject: Subject, material: Solid) -> Ring:
    """A free plate rings in Lame's mode, at half a percent of strain: tells mu / rho."""
    cells = 8
    frequency = exact.lame_frequency(1.0, material.shear_modulus, material.density)
    times = np.linspace(0, 1.3 / frequency, 40)[1:]
    peak = 0.005 / math.pi
    amplitudes = _lame_amplitudes(subject, material, cells, peak * 2 * math.pi * frequency, times)
    found = damped_oscillation(times, amplitudes, frequency).frequency
    return Ring(error=found / frequency - 1, dispersion=exact.grid_dispersion(math.sqrt(2) * math.pi, 1.0 / cells))


def bar_stretches_and_returns(subject: Subject, material: Solid) -> Ring:
    """A free bar with nu = 0 rings along itself, at half a percent of strain: tells E / rho."""
    cells = 8
    spacing = 1.0 / cells
    frequency = oracles.bar_frequency(1.0, oracles.bar_speed(material.youngs_modulus, material.density))
    bar = box_of_points(_AWAY, (cells, 1, 1), spacing)
    shape = np.cos(math.pi * (bar[:, 0] - _AWAY[0]))
    velocities = np.zeros_like(bar)
    velocities[:, 0] = 0.005 / math.pi * 2 * math.pi * frequency * shape
    # In front of what it is made of stands a softer material, of which nothing is made.
    materials = (replace(material, youngs_modulus=material.youngs_modulus / 4), material)
    problem = PointProblem(points=cloud_of([bar], [velocities], spacing, [1]), materials=materials, gravity=NO_GRAVITY)
    times = np.linspace(0, 1.3 / frequency, 40)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=spacing), times)
    amplitudes = [mode_amplitude(state.positions[:, 0] - bar[:, 0], shape) for state in states]
    found = damped_oscillation(times, np.array(amplitudes), frequency).frequency
    return Ring(error=found / frequency - 1, dispersion=exact.grid_dispersion(math.pi, spacing))


def ball_breathes(subject: Subject, material: Solid) -> Ring:
    """A free ball, 1 m wide, breathes at half a percent of strain: tells how lambda and mu go together, over rho."""
    cells = 6
    spacing = 1.0 / cells
    center = _AWAY + 0.5
    ball = box_of_points(_AWAY, (cells, cells, cells), spacing)
    ball = ball[np.linalg.norm(ball - center, axis=1) <= 0.5]
    # The ball that the points fill: they are cells of equal volume, and its surface is as rough as they are.
    radius = (len(ball) * (spacing / 2) ** 3 * 3 / (4 * math.pi)) ** (1 / 3)
    frequency, root = exact.radial_frequency(radius, material.shear_modulus, material.lame_lambda, material.density)
    shape = exact.radial_shape(ball - center, radius, root)
    peak = 0.005 * radius
    problem = PointProblem(
        points=cloud_of([ball], [peak * 2 * math.pi * frequency * shape], spacing),
        materials=(material,),
        gravity=NO_GRAVITY,
    )
    times = np.linspace(0, 1.3 / frequency, 40)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=spacing), times)
    amplitudes = [mode_amplitude((state.positions - ball).ravel(), shape.ravel()) for state in states]
    found = damped_oscillation(times, np.array(amplitudes), frequency).frequency
    return Ring(error=found / frequency - 1, dispersion=exact.grid_dispersion(root / radius, spacing))


def bar_stretches_far(subject: Subject, material: Solid, stress: Any, other_stress: Any) -> tuple[float, float]:
    """A bar with nu = 0 swings by a tenth of its length for half a period: tells one law from another.

    Returns
    -------
    Root mean square distances over the amplitude: of the bar from its own law's displacements, and of the other law's
    displacements from those.
    """
    cells, amplitude = 16, 0.1
    spacing = 1.0 / cells
    speed = oracles.bar_speed(material.youngs_modulus, material.density)
    bar = box_of_points(_AWAY, (cells, 1, 1), spacing)
    along = bar[:, 0] - _AWAY[0]
    velocities = np.zeros_like(bar)
    velocities[:, 0] = math.pi * amplitude * speed * np.cos(math.pi * along)
    problem = PointProblem(points=cloud_of([bar], [velocities], spacing), materials=(material,), gravity=NO_GRAVITY)
    time = 1.0 / speed
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [time])
    own = exact.large_wave(stress, speed, along, amplitude, time)
    other = exact.large_wave(other_stress, speed, along, amplitude, time)

    def size(displacements: Array) -> float:
        return math.sqrt(float(np.mean(displacements**2))) / amplitude

    return size(state.positions[:, 0] - bar[:, 0] - own), size(other - own)


def spreads_on_a_floor(subject: Subject, material: Material) -> tuple[float, float]:
    """A block of matter that flows, let go on a floor for 0.6 s: by how much the surface is under the floor [cells].

    Returns
    -------
    In the mean of the lowest layer, and of its lowest percent; a point stands for a quarter of a cell on either side.
    """
    spacing, cells = 0.05, 5
    block = box_of_points((0.013, 0.021, 0.0), (cells, cells, cells), spacing)
    problem = PointProblem(
        points=cloud_of([block], [(0.0, 0.0, 0.0)], spacing),
        materials=(material,),
        colliders=(Collider(shape=floor_of(subject), friction=0.3),),
    )
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [0.6])
    heights = np.sort(state.positions[:, 2])
    layer = heights[: (cells * POINTS_PER_CELL) ** 2]
    half = spacing / POINTS_PER_CELL / 2
    return float(half - layer.mean()) / spacing, float(half - np.quantile(heights, 0.01)) / spacing


def loose_block_parts(subject: Subject, material: Material, gradient: ArrayLike, time: float) -> tuple[float, float]:
    """A cube thrown with v = G (x - centre), without weight: tells what a material does not resist.

    Returns
    -------
    Largest distance from where points fly that nothing holds, over how far the farthest goes; and the strain G t times
    a cell over the side, which is what affine transfers take at free surfaces for the material's own.
    """
    cells, spacing = 3, 0.1
    block = box_of_points(_AWAY, (cells, cells, cells), spacing)
    velocities = (block - block.mean(axis=0)) @ np.asarray(gradient, dtype=float).T
    problem = PointProblem(points=cloud_of([block], [velocities], spacing), materials=(material,), gravity=NO_GRAVITY)
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [time])
    off = float(np.linalg.norm(state.positions - block - time * velocities, axis=1).max())
    farthest = time * float(np.linalg.norm(velocities, axis=1).max())
    strain = time * float(np.linalg.norm(np.asarray(gradient), 2))
    return off / farthest, strain / cells


def confined_column_sinks(subject: Subject, material: Fluid | Sand, cells: int) -> Sinking:
    """Weight sets in on a column, 1 m high, between frictionless walls: tells density and how stiff it is there."""
    modulus = (
        material.bulk_modulus if isinstance(material, Fluid) else material.lame_lambda + 2 * material.shear_modulus
    )
    height, spacing = 1.0, 1.0 / cells
    column = box_of_points((0.0, 0.0, 0.0), (1, 1, cells), spacing)
    walls = [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ((spacing, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.0, spacing, 0.0), (0.0, -1.0, 0.0)),
    ]
    problem = PointProblem(
        points=cloud_of([column], [np.zeros(3)], spacing),
        materials=(material,),
        colliders=tuple(
            Collider(shape=HalfSpace(point=point, normal=normal), contact=ContactCondition.SLIP)
            for point, normal in walls
        ),
        gravity=(0.0, 0.0, -GRAVITY),
    )
    speed = math.sqrt(modulus / material.density)
    period = oracles.column_period(height, speed)
    z = column[:, 2]
    shape = np.sin(np.pi * z / (2 * height))
    times = np.linspace(0, 1.2 * period, 60)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=spacing), times)
    sinking = np.array([mode_amplitude(z - state.positions[:, 2], shape) for state in states])
    swing = damped_oscillation(times, sinking, 1 / period)
    static = oracles.column_deflection(z, height, material.density, GRAVITY, modulus)
    return Sinking(
        period_error=1 / (swing.frequency * period) - 1,
        depth_error=swing.mean / mode_amplitude(static, shape) - 1,
    )


def shear_flow_dies(subject: Subject, material: Fluid) -> Decay:
    """A slow flow in the shape of Lame's mode dies of viscosity alone, for as long as it takes to fall to 1/e."""
    cells = 8
    rate = exact.lame_viscous_decay(1.0, material.viscosity, material.density)
    # It comes to rest at a hundredth of strain: the shape it flows in is the shape it started in.
    velocity = 0.01 * rate / math.pi
    times = np.linspace(0, 1 / rate, 11)[1:]
    journal = Journal()
    moved = _lame_amplitudes(subject, material, cells, velocity, times, journal) / velocity
    (found,), _ = curve_fit(lambda t, decay: -np.expm1(-decay * t) / decay, times, moved, p0=[rate])
    step = journal.largest_substep
    wave = math.pi / cells
    return Decay(
        error=float(found) / rate - 1,
        # The rate goes with the square of the wave number, as the square of a frequency does.
        dispersion=2 * exact.grid_dispersion(math.sqrt(2) * math.pi, 1.0 / cells),
        # Affine transfers keep what is affine within a cell; of the rest, (k dx)^4 along each axis, they lose some
        # hundredths a substep.
        transfers=0.05 * 2 * wave**4 / (rate * step),
        stepping=rate * step / 2,
    )


def shear_relaxes(subject: Subject, material: Foam) -> Relaxed:
    """A plate is thrown in Lame's mode, its yield stress next to nothing: it comes to rest as its stress relaxes."""
    cells = 8
    frequency = exact.lame_frequency(1.0, material.shear_modulus, material.density)
    relaxation = material.plastic_viscosity / (2 * material.shear_modulus)
    # Half a percent of strain, as where plates ring.
    peak = 0.005 / math.pi
    velocity = peak * 2 * math.pi * frequency
    pulse = 2 * math.pi * frequency
    # What swings dies with half the rate of relaxation; what creeps, with w^2 theta.
    times = np.linspace(0, 2 * relaxation + 2 / (pulse**2 * relaxation), 31)[1:]
    journal = Journal()
    moved = _lame_amplitudes(subject, material, cells, velocity, times, journal) / velocity
    (found,), _ = curve_fit(
        lambda t, time: exact.lame_relaxing(t, frequency, time),
        times,
        moved,
        p0=[relaxation],
        bounds=(0.01 * relaxation, 100 * relaxation),
    )
    step = journal.largest_substep
    wave = math.pi / cells
    return Relaxed(
        error=float(found) / relaxation - 1,
        # It comes to rest at v / (w^2 theta): what is wrong with the square of the frequency looks like the time's.
        dispersion=2 * exact.grid_dispersion(math.sqrt(2) * math.pi, 1.0 / cells),
        # As `shear_flow_dies`; what is lost of the momentum is lost of the way.
        transfers=0.05 * 2 * wave**4 * float(times[-1]) / step,
        # A step of implicit Euler leaves (1 + dt/theta)^-1 instead of exp(-dt/theta): the time seems longer by dt/2.
        stepping=step / (2 * relaxation),
        unyielding=exact.von_mises_yield_strain(material.yield_stress, material.shear_modulus) / (math.pi * peak),
    )


def block_swings(subject: Subject, material: Yielding, over: float) -> Swing:
    """A plate is thrown in Lame's mode so that, were it elastic, it would be strained to `over` times its yield."""
    cells = 8
    frequency = exact.lame_frequency(1.0, material.shear_modulus, material.density)
    strain = over * exact.von_mises_yield_strain(material.yield_stress, material.shear_modulus)
    peak = strain / math.pi
    # A plastic plate goes farther than an elastic one, and takes longer to come to rest.
    times = np.linspace(0, 3 / frequency, 90)[1:]
    amplitudes = _lame_amplitudes(subject, material, cells, peak * 2 * math.pi * frequency, times) / peak
    highest = int(np.argmax(amplitudes))
    return Swing(highest=float(amplitudes[highest]), lowest_after=float(amplitudes[highest:].min()))


_BAR_CELLS = 8
_CAP_CELLS = 2
_HEAVY = 100.0
"""Times as dense and as stiff as the bar: sound is as fast in the caps, and takes as small steps."""
_SMALL_STRAIN = 0.01
_PRESSED_TO = 0.86
"""Of its length for good. Far from its yield strain, and from where an engine would think of limits."""


_FLOWING_WORK = 0.01
"""Of the modulus: an elastic bar is pressed to exp(-0.14) of its length."""


def unyielding(material: Any) -> Any:
    """The same matter, of snow or what flows, with such limits that it is elastic as far as it is strained here."""
    if isinstance(material, Snow):
        return replace(material, critical_compression=0.5, critical_stretch=0.5)
    return replace(material, yield_stress=material.youngs_modulus)


def _walls_beside_a_bar() -> tuple[Collider, ...]:
    """Frictionless walls at the long sides of a bar that is a cell thick and whose corner is `_AWAY`."""
    spacing = 1.0 / _BAR_CELLS
    _, y, z = _AWAY
    walls = [
        ((0.0, y, 0.0), (0.0, 1.0, 0.0)),
        ((0.0, y + spacing, 0.0), (0.0, -1.0, 0.0)),
        ((0.0, 0.0, z), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, z + spacing), (0.0, 0.0, -1.0)),
    ]
    return tuple(
        Collider(shape=HalfSpace(point=point, normal=normal), contact=ContactCondition.SLIP) for point, normal in walls
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Press:
    """A bar along x, 1 m long and a cell thick, whose ends are heavy caps.

    The caps are so heavy that sound goes up and down the bar many times while they swing: it is strained evenly, and
    the caps on it are a mass on a spring.

    Parameters
    ----------
    modulus
        Of the bar along its axis [Pa].
    walls
        What holds its sides.
    """

    material: Snow | Yielding
    modulus: float
    walls: tuple[Collider, ...] = ()

    @property
    def mass(self) -> float:
        """Reduced mass of the caps, over the bar's cross-section [kg/m^2]; a bar that is strained evenly adds a
        twelfth of its own."""
        return self.material.density * (_HEAVY * _CAP_CELLS / _BAR_CELLS / 2 + 1 / 12)

    @property
    def pulse(self) -> float:
        """Angular frequency below yield [rad/s]."""
        return math.sqrt(self.modulus / self.mass)

    def speed(self, work: float) -> float:
        """How fast the caps have to come [m/s], to do `work` on the bar, per volume and over its modulus."""
        return self.pulse * math.sqrt(2 * work)

    def gaps(self, subject: Subject, material: Snow | Yielding, speed: float, times: Array) -> Array:
        """How much farther the caps are apart (T,) [m], of a bar of `material`, when they start at `speed` [m/s]."""
        spacing = 1.0 / _BAR_CELLS
        places = box_of_points(_AWAY, (_BAR_CELLS + 2 * _CAP_CELLS, 1, 1), spacing)
        along = places[:, 0] - _AWAY[0] - _CAP_CELLS * spacing
        left, right = along < 0, along > 1
        velocities = np.zeros_like(places)
        velocities[:, 0] = speed * (np.clip(along, 0, 1) - 0.5)
        heavy = replace(material, density=_HEAVY * material.density, youngs_modulus=_HEAVY * material.youngs_modulus)
        cloud = cloud_of([places], [velocities], spacing)
        problem = PointProblem(
            points=replace(cloud, material_ids=(left | right).astype(np.int32)),
            materials=(material, unyielding(heavy)),
            colliders=self.walls,
            gravity=NO_GRAVITY,
        )
        states = subject.states(problem, EngineAccuracy(spacing=spacing), times)
        moved = [state.positions[:, 0] - places[:, 0] for state in states]
        return np.array([float(one[right].mean() - one[left].mean()) for one in moved])

    def frequency(self, subject: Subject) -> float:
        """At which it swings below yield [Hz]: the caps come at each other slowly."""
        period = 2 * math.pi / self.pulse
        times = np.linspace(0, 1.3 * period, 40)[1:]
        gaps = self.gaps(subject, unyielding(self.material), -_SMALL_STRAIN * self.pulse, times)
        return damped_oscillation(times, gaps, 1 / period).frequency

    def length(self, frequency: float) -> float:
        """That a bar of this frequency [Hz] has, over its length: a spring is the stiffer the shorter it is, and part
        of the cells at the caps is as stiff as they are."""
        return (self.pulse / (2 * math.pi * frequency)) ** 2 if frequency else math.inf

    def pressed(self, subject: Subject, snow: Snow) -> Pressed:
        """The caps come at each other slowly, and so fast that the bar is pressed far beyond yield."""
        period = 2 * math.pi / self.pulse
        before = self.frequency(subject)
        length = self.length(before)
        nothing = Pressed(length_error=length - 1, set_error=math.nan, frequency_error=math.nan, swing_error=math.nan)
        if not 0.5 < length < 2:
            return nothing

        theta, xi = snow.critical_compression, snow.hardening
        work = exact.snow_pressing_work(_PRESSED_TO, theta, xi)
        faster = math.sqrt(exact.snow_stiffening(_PRESSED_TO, xi)) / _PRESSED_TO
        # It comes to rest within half a period, and then swings two of its own.
        rest, swings = period / 2, 2 * period / faster
        times = np.linspace(0, rest + swings, 160)[1:]
        gaps = self.gaps(subject, snow, -self.speed(work), times)[times > rest] / length
        swing = damped_oscillation(times[times > rest], gaps, faster * before)
        after, shorter = swing.frequency, swing.mean
        kept = 1 + shorter
        set_error = shorter / (exact.snow_volume_ratio(work / length, theta, xi) - 1) - 1
        if not 0 < kept < 2:
            return replace(nothing, set_error=set_error)
        return Pressed(
            length_error=length - 1,
            set_error=set_error,
            frequency_error=after / before * kept / math.sqrt(exact.snow_stiffening(kept, xi)) - 1,
            swing_error=float(np.ptp(gaps)) / 2 / (theta * kept) - 1,
        )


def snow_is_pressed(subject: Subject, material: Snow) -> Pressed:
    """A bar with free sides and nu = 0: tells critical compression, set and hardening of mu."""
    assert material.poissons_ratio == 0
    return _Press(material=material, modulus=material.youngs_modulus).pressed(subject, material)


def snow_between_walls_is_pressed(subject: Subject, material: Snow) -> Pressed:
    """A bar between frictionless walls: tells hardening of lambda, and that a box holds each stretch by itself."""
    modulus = material.lame_lambda + 2 * material.shear_modulus
    return _Press(material=material, modulus=modulus, walls=_walls_beside_a_bar()).pressed(subject, material)


def snow_is_pulled_and_swings(subject: Subject, material: Snow, over: float) -> Swing:
    """The caps fly apart so that an elastic bar would be stretched to `over` times the critical stretch."""
    press = _Press(material=material, modulus=material.youngs_modulus)
    peak = over * material.critical_stretch
    times = np.linspace(0, 1.1 * 2 * math.pi / press.pulse, 60)[1:]
    gaps = press.gaps(subject, material, peak * press.pulse, times) / peak
    highest = int(np.argmax(gaps))
    return Swing(highest=float(gaps[highest]), lowest_after=float(gaps[highest:].min()))


def snow_is_torn(subject: Subject, material: Snow, over: float) -> float:
    """The caps fly apart with `over` times the energy that tears the bar: what is left of their speed.

    It is that of 0.7 periods later, when a bar that did not tear has them on their way back.
    """
    press = _Press(material=material, modulus=material.youngs_modulus)
    speed = press.speed(over * exact.snow_tearing_work(material.critical_stretch, material.hardening))
    times = np.array([0.65, 0.75]) * 2 * math.pi / press.pulse
    first, last = press.gaps(subject, material, speed, times)
    return float(last - first) / float(times[1] - times[0]) / speed


def bar_between_walls_flows(subject: Subject, material: Yielding) -> Flowed:
    """A bar between frictionless walls is pressed far beyond yield and swings back: tells how far it bears shear.

    Its volume is the spring, so it is strained evenly even where it softens.
    """
    shear = material.shear_modulus
    bulk = material.lame_lambda + 2 / 3 * shear
    press = _Press(material=material, modulus=bulk + 4 / 3 * shear, walls=_walls_beside_a_bar())
    length = press.length(press.frequency(subject))
    nothing = Flowed(length_error=length - 1, pressing_error=math.nan, return_error=math.nan)
    if not 0.5 < length < 2:
        return nothing

    # What the caps bring is spent on a bar of that length.
    work = _FLOWING_WORK * press.modulus / length
    law = _turns(material, work, bulk, press.mass * length)
    # With shear it swings faster than its volume alone, which takes three quarters of a period to where it is longest.
    times = np.linspace(0, 0.8 * 2 * math.pi * math.sqrt(press.mass * length / bulk), 160)[1:]
    stretches = 1 + press.gaps(subject, material, -press.speed(_FLOWING_WORK), times) / length
    shortest = int(np.argmin(stretches))
    if not stretches[shortest] > 0:
        return nothing
    found = exact.Turns(pressed=-math.log(stretches[shortest]), stretched=math.log(float(stretches[shortest:].max())))

    def lost(turns: exact.Turns) -> tuple[float, float]:
        kept = bulk * turns.pressed**2 / 2
        return work - kept, kept - bulk * turns.stretched**2 / 2

    (pressing, returning), (expected_pressing, expected_returning) = lost(found), lost(law)
    return replace(
        nothing,
        pressing_error=pressing / expected_pressing - 1,
        return_error=returning / expected_returning - 1,
    )


def _turns(material: Yielding, work: float, bulk: float, mass: float) -> exact.Turns:
    """Where its law has a bar turn; `work` [J/m^3], bulk modulus [Pa], `mass` [kg/m^3] as in the closed forms."""
    shear, strength = material.shear_modulus, material.yield_stress
    match material:
        case Metal():
            return exact.turns_of_a_yielding_bar(work, bulk, shear, strength, material.hardening, strength)
        case Plasticine():
            slope, residual = -material.softening * strength, material.residual * strength
            return exact.turns_of_a_yielding_bar(work, bulk, shear, strength, slope, residual)
        case Foam():
            viscosity = material.plastic_viscosity
            return exact.turns_of_a_viscoplastic_bar(work, bulk, shear, strength, viscosity, mass)


def rigid_block_spins(subject: Subject, material: Rigid) -> Spin:
    """A rigid block, thrown and spinning about its short axis, turns by a radian."""
    spacing, velocity, spin, time = 0.1, np.array([0.7, -0.3, 1.1]), np.array([0.0, 0.0, 2.0]), 0.5
    block = box_of_points(_AWAY, (4, 4, 2), spacing)
    center = block.mean(axis=0)
    problem = PointProblem(
        points=cloud_of([block], [velocity + np.cross(spin, block - center)], spacing),
        materials=(material,),
        gravity=(0.0, 0.0, -GRAVITY),
    )
    journal = Journal()
    (state,) = subject.states(problem, EngineAccuracy(spacing=spacing), [time], (), journal)
    place = exact.rigid_motion(block, center, velocity, spin, time) + np.array([0, 0, -GRAVITY]) * time**2 / 2
    size = float(np.linalg.norm(np.ptp(block, axis=0)))
    corner = block[0]
    before, after = np.linalg.norm(block - corner, axis=1), np.linalg.norm(state.positions - state.positions[0], axis=1)
    step, reach = journal.largest_substep, size / 2
    return Spin(
        distance_change=float(np.abs(after - before).max()) / size,
        place_error=float(np.linalg.norm(state.positions - place, axis=1).max()) / size,
        # Euler's rule on a fall and on a circle: a t dt / 2 for the acceleration a of either.
        stepping=(GRAVITY + reach * float(spin @ spin)) * time * step / 2 / size,
    )
