"""How motion dies away in elastic matter that is damped, run through the contract; it measures and does not judge."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gasp_conformance import capability_oracles as exact
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.material_cases import lame_block
from gasp_conformance.observables import Oscillation, damped_oscillation, mode_amplitude
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import (
    Collider,
    ContactCondition,
    Elastic,
    EngineAccuracy,
    HalfSpace,
    NeoHookean,
    PointProblem,
)

__all__ = ["Dying", "column_comes_to_rest", "plate_comes_to_rest"]

_CELLS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Dying:
    """Relative error of the rate at which what rings dies away, and what grid and substeps may leave of it."""

    error: float
    dispersion: float
    stepping: float


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
