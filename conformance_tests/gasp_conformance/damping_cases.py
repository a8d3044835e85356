"""How motion dies away in elastic matter that is damped, run through the contract; it measures and does not judge."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import capability_oracles as exact
from gasp_conformance import oracles
from gasp_conformance.bounds import place_rounding, rounding
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.material_cases import lame_block
from gasp_conformance.observables import Oscillation, angular_momentum, damped_oscillation, mode_amplitude
from gasp_conformance.scenes import shared_scene
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import (
    Collider,
    ContactCondition,
    Elastic,
    EngineAccuracy,
    Field,
    HalfSpace,
    NeoHookean,
    PointProblem,
)
from gasp_core.stepping.time_step import rest_bound

__all__ = ["Dying", "Flown", "Ringing", "bar_rings_on", "blocks_fly", "column_comes_to_rest", "plate_comes_to_rest"]

Array = NDArray[Any]

_CELLS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Dying:
    """Relative error of the rate at which what rings dies away, and what grid and substeps may leave of it."""

    error: float
    dispersion: float
    stepping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ringing:
    """Rate at which a bar dies away that nothing damps, and what steps, transfers and grid may leave of it [1/s]."""

    decay: float
    stepping: float
    transfers: float
    dispersion: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """Momenta of a body that flies and spins: largest errors, and what steps, grid and rounding may leave of them.

    Parameters
    ----------
    way, way_allowed
        Of its centre [m].
    spin, spin_allowed
        Of its angular momentum, over what that was at first.
    """

    way: float
    way_allowed: float
    spin: float
    spin_allowed: float


def bar_rings_on(subject: Subject) -> Ringing:
    """V3's free bar in its first mode, in small steps: what is lost once in each of them adds up."""
    scene = shared_scene("v3_free_bar")
    material, cells, periods = scene.material, 16, 1.3
    assert isinstance(material, Elastic), scene.name
    frequency = oracles.bar_frequency(scene.length, oracles.bar_speed(material.youngs_modulus, material.density))
    pulse, spacing = 2 * math.pi * frequency, scene.spacing(cells)
    (bar,) = scene.places(cells)
    wave_number = math.pi / scene.length
    shape = np.cos(wave_number * (bar[:, 0] - scene.bodies[0].corner[0]))
    velocities = np.zeros_like(bar)
    velocities[:, 0] = 0.002 * scene.length * pulse * shape
    accuracy = replace(scene.accuracy(cells), substep=0.05 * rest_bound(material, spacing))
    times, journal = np.linspace(0, periods / frequency, 40)[1:], Journal()
    states = subject.states(scene.problem(cells, [velocities]), accuracy, times, (), journal)
    amplitudes = np.array([mode_amplitude(state.positions[:, 0] - bar[:, 0], shape) for state in states])
    step = journal.largest_substep
    return Ringing(
        decay=damped_oscillation(times, amplitudes, frequency).decay,
        # Euler's rule, explicit or implicit, makes of an oscillation |1 + i w dt| or its inverse, 1 -+ (w dt)^2 / 2.
        stepping=pulse**2 * step / 2,
        # Affine velocities go to the grid and back once a step. Of a wave of them 1 - (k dx)^4 (m4 - m2^2) / 4 is left,
        # with the kernel's moments in cells: 1 - (k dx)^4 / 40 by quadratic B-splines, / 21 by cubic ones. Half of that
        # shows in the swing, whose energy is that of velocities half of the time.
        transfers=(wave_number * spacing) ** 4 / 40 / step,
        # What of the first shape is another mode of the grid comes and goes while the bar rings.
        dispersion=exact.grid_dispersion(wave_number, spacing) / times[-1],
    )


def plate_comes_to_rest(subject: Subject, material: Elastic | NeoHookean) -> Dying:
    """A free plate rings in Lame's mode, with the damping of its material and without, in equal steps.

    What engine and grid take of it by themselves is in both.
    """
    frequency = exact.lame_frequency(1.0, material.shear_modulus, material.density)
    pulse = 2 * math.pi * frequency
    plate, shape, spacing = lame_block(_CELLS)
    times = np.linspace(0, 2.5 / frequency, 60)[1:]
    rates: list[float] = []
    accuracy, journal = EngineAccuracy(spacing=spacing), Journal()
    for each in (material, replace(material, mass_damping=0.0, stiffness_damping=0.0)):
        problem = PointProblem(
            points=cloud_of([plate], [0.005 / math.pi * pulse * shape], spacing),
            materials=(each,),
            gravity=NO_GRAVITY,
        )
        states = subject.states(problem, accuracy, times, (), journal)
        amplitudes = np.array([mode_amplitude((state.positions - plate).ravel(), shape.ravel()) for state in states])
        rates.append(damped_oscillation(times, amplitudes, frequency).decay)
        accuracy = replace(accuracy, substep=journal.largest_substep)
    by_stiffness = material.stiffness_damping * pulse**2 / 2
    damping = material.mass_damping / 2 + by_stiffness
    return Dying(
        error=(rates[0] - rates[1]) / damping - 1,
        # It goes with the square of the frequency.
        dispersion=2 * by_stiffness / damping * exact.grid_dispersion(math.sqrt(2) * math.pi, spacing),
        # A rate of the first order, by what is lost in a step; and the rate of strain is that of the step before.
        stepping=(damping + pulse) * journal.largest_substep,
    )


def column_comes_to_rest(subject: Subject, material: Elastic | NeoHookean) -> Dying:
    """A column in a smooth tube is pressed and drawn apart along itself, by turns.

    Between walls at both ends, with the damping of its material and without, in equal steps, as the plate.
    """
    cells, across, spacing = 12, 3, 1 / 12
    column = box_of_points((0.0, 0.0, 0.0), (cells, across, across), spacing)
    shape = np.sin(math.pi * column[:, 0])[:, None] * [1.0, 0.0, 0.0]
    stiffness = material.lame_lambda + 2 * material.shear_modulus
    frequency = math.sqrt(stiffness / material.density) / 2
    ends = np.array([1.0, across * spacing, across * spacing])
    walls = tuple(
        Collider(
            shape=HalfSpace(point=tuple(side * ends * np.eye(3)[axis]), normal=tuple((1 - 2 * side) * np.eye(3)[axis])),
            contact=ContactCondition.SLIP,
        )
        for axis in range(3)
        for side in (0, 1)
    )
    times = np.linspace(0, 2.5 / frequency, 60)[1:]
    found: list[Oscillation] = []
    accuracy, journal = EngineAccuracy(spacing=spacing), Journal()
    for each in (material, replace(material, mass_damping=0.0, stiffness_damping=0.0)):
        problem = PointProblem(
            points=cloud_of([column], [0.002 * 2 * math.pi * frequency * shape], spacing),
            materials=(each,),
            colliders=walls,
            gravity=NO_GRAVITY,
        )
        states = subject.states(problem, accuracy, times, (), journal)
        amplitudes = np.array([mode_amplitude((state.positions - column).ravel(), shape.ravel()) for state in states])
        found.append(damped_oscillation(times, amplitudes, frequency))
        accuracy = replace(accuracy, substep=journal.largest_substep)
    # Proportional to stiffness is proportional to that of the grid, whatever pitch it gives the column.
    damping = material.stiffness_damping * (2 * math.pi * found[1].frequency) ** 2 / 2
    return Dying(
        error=(found[0].decay - found[1].decay) / damping - 1,
        dispersion=0.0,
        stepping=(damping + 2 * math.pi * frequency) * journal.largest_substep,
    )


def blocks_fly(
    subject: Subject, by_mass: Elastic | NeoHookean, by_stiffness: Elastic | NeoHookean
) -> tuple[Flown, Flown]:
    """Two blocks are thrown, spinning, far from each other: one of matter damped by mass, one damped by stiffness.

    Matter damped by mass loses both momenta, dp/dt = M g - a p and dL/dt = -a L, whatever goes on within it; what is
    damped by stiffness loses neither.
    """
    spacing, cells, end = 0.1, 3, 0.5
    velocity, spin, gravity = np.array([1.1, -0.6, 0.9]), np.array([0.5, -0.4, 0.8]), np.array([3.1, -4.3, -8.2])
    blocks = [box_of_points((0.37 + 2.75 * side, -0.21, 0.11), (cells, cells, cells), spacing) for side in (0, 1)]
    arms = blocks[0] - blocks[0].mean(axis=0)
    # It breathes as well, so that damping by stiffness has something to do.
    thrown = velocity + np.cross(spin, arms) + 0.1 * arms
    problem = PointProblem(
        points=cloud_of(blocks, [thrown, thrown], spacing, [0, 1]),
        materials=(by_mass, by_stiffness),
        gravity=tuple(gravity),
    )
    times, journal = np.linspace(0, end, 6), Journal()
    accuracy = EngineAccuracy(spacing=spacing, substep=2e-3)
    states = list(subject.states(problem, accuracy, times, {Field.VELOCITIES}, journal))
    step = journal.largest_substep
    reach = max(float(np.abs(state.positions).max()) for state in states)
    travel = float(np.linalg.norm(velocity)) * end + float(np.linalg.norm(gravity)) * end**2 / 2
    rounded = place_rounding(subject, journal.substep_count, reach, travel)
    flown: list[Flown] = []
    for side, (block, material) in enumerate(zip(blocks, problem.materials)):
        rows, damping = problem.points.material_ids == side, material.mass_damping
        masses, square = problem.masses[rows], float(np.sum(arms**2))
        first = angular_momentum(masses, block, thrown)
        way = turning = swing = 0.0
        for state in states:
            assert state.velocities is not None
            places = state.positions[rows]
            if damping > 0:
                gone = exact.carried_by_wind(velocity, gravity / damping, damping, state.time)
            else:
                gone = oracles.free_fall((0.0, 0.0, 0.0), velocity, gravity, state.time)
            way = max(way, float(np.linalg.norm((places - block).mean(axis=0) - gone)))
            kept = first * math.exp(-damping * state.time)
            missing = angular_momentum(masses, places, state.velocities[rows]) - kept
            turning = max(turning, float(np.linalg.norm(missing) / np.linalg.norm(first)))
            swing = max(swing, abs(float(np.sum((places - places.mean(axis=0)) ** 2)) / square - 1))
        # The points' own affine fields hold a share dx^2 / (2 r_g^2) of what turns, and it changes as the moment of
        # inertia does: see `readout_cases.spinning_plate`. Of a cube, r_g^2 is two thirds of the mean square.
        hidden = 2 * spacing**2 / (2 * 2 / 3 * square / len(block)) * swing
        flown.append(
            Flown(
                way=way,
                way_allowed=_fall_stepping(damping, velocity, gravity, end, step) + rounded,
                spin=turning,
                spin_allowed=_decay_stepping(damping, step) + hidden + rounding(subject, journal.substep_count),
            )
        )
    return flown[0], flown[1]


def _fall_stepping(damping: float, velocity: Array, gravity: Array, time: float, step: float) -> float:
    """What Euler's rule, of either kind, is off by in a damped fall at most [m]."""
    pull = float(np.linalg.norm(gravity))
    if damping == 0:
        return 1.05 * oracles.euler_fall_error(pull, time, step)
    # Drag, and the way of a step, may be of the velocity at any moment of it, with its gravity and drag or without:
    # that is off by what these do in a step. An error of the velocity dies away as the velocity does.
    change = (pull + float(np.linalg.norm(gravity - damping * velocity))) * step
    by_way, by_drag = change * time, change * (time + math.expm1(-damping * time) / damping)
    return by_way + by_drag


def _decay_stepping(damping: float, step: float) -> float:
    """What it is off by at most in exp(-a t), of 1 at first."""
    # (1 - a dt)^n and (1 + a dt)^-n are off by (a dt / 2) a t exp(-a t) in the first order, a dt / 2 e where that is
    # largest, and velocities may be known half a step early or late.
    return 1.05 * damping * step / 2 * (1 / math.e + 1)
