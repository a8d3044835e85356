"""How motion dies away in elastic matter that is damped, run through the contract; it measures and does not judge."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gasp_conformance import capability_oracles as exact
from gasp_conformance.clouds import cloud_of
from gasp_conformance.material_cases import lame_block
from gasp_conformance.observables import damped_oscillation, mode_amplitude
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import Elastic, EngineAccuracy, NeoHookean, PointProblem

__all__ = ["Dying", "plate_comes_to_rest"]

_CELLS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Dying:
    """Relative error of the rate at which a ringing plate dies away, and what grid and substeps may leave of it."""

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
