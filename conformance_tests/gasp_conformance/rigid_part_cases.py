"""Rigid parts of bodies that deform: a weight that hangs from a rod, and a hammer that flies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.clouds import POINTS_PER_CELL, box_of_points, cloud_of, point_volume
from gasp_conformance.observables import angular_momentum, damped_oscillation, kinetic_energy
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Journal, Subject
from gasp_core.contract import Elastic, EngineAccuracy, Field, HalfSpace, Pinned, PointProblem, Rigid

__all__ = ["ROD_CELLS", "Flight", "Hanging", "hammer_flies", "weight_hangs"]

Array = NDArray[Any]

_SPACING = 0.05
_WIDTH = 3
"""Cells of rod and block across."""
ROD_CELLS = 8
"""Of its free length."""
_EMBEDDED = 2
"""Cells of the rod within what holds it."""
_ROD = Elastic(density=500.0, youngs_modulus=1e5, poissons_ratio=0.0)
_HEAVY, _LIGHT = Rigid(density=4000.0), Rigid(density=1500.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hanging:
    """A rigid weight at the end of an elastic rod, which swings up and down.

    Parameters
    ----------
    stretch
        Mean way of the weight, over that which the rod's closed form has.
    frequency
        Likewise.
    """

    stretch: float
    frequency: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A rigid block and an elastic rod, one piece, that spin without weight.

    Parameters
    ----------
    apart
        By how much the two are farther apart where they meet than at the start, in the mean [cells].
    momentum, spin
        Largest change of linear momentum and of angular momentum, over what there was.
    energy
        Kinetic energy over that of the start, at most.
    substep_count
        Steps it took.
    """

    apart: float
    momentum: float
    spin: float
    energy: float
    substep_count: int


def _pieces(rod_cells: int, heavy: Rigid) -> tuple[Array, Array, tuple[Elastic, Rigid]]:
    """Points of a rod along z, those of a rigid block below it, of the rod's width, and their materials."""
    rod = box_of_points((0.0, 0.0, _WIDTH * _SPACING), (_WIDTH, _WIDTH, rod_cells), _SPACING)
    block = box_of_points((0.0, 0.0, 0.0), (_WIDTH,) * 3, _SPACING)
    return rod, block, (_ROD, heavy)


def weight_hangs(subject: Subject) -> Hanging:
    """A weight sets in that hangs from a rod, which is held at its top."""
    rod, block, materials = _pieces(ROD_CELLS + _EMBEDDED, _HEAVY)
    gravity = 0.5
    length, area = ROD_CELLS * _SPACING, (_WIDTH * _SPACING) ** 2
    top = _WIDTH * _SPACING + length
    mass, own = _HEAVY.density * area * _WIDTH * _SPACING, _ROD.density * area * length
    stretch = (mass + own / 2) * gravity * length / (_ROD.youngs_modulus * area)
    speed = oracles.bar_speed(_ROD.youngs_modulus, _ROD.density)
    frequency = oracles.loaded_bar_frequency(length, speed, mass / own)
    problem = PointProblem(
        points=cloud_of([rod, block], [(0.0, 0.0, 0.0)] * 2, _SPACING, range(2)),
        materials=materials,
        drives=(Pinned(region=HalfSpace(point=(0.0, 0.0, top), normal=(0.0, 0.0, -1.0))),),
        gravity=(0.0, 0.0, -gravity),
        rigid_parts={1: 0},
    )
    weight = problem.points.body_ids == 1
    times = np.linspace(0.0, 3 / frequency, 61)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=_SPACING), times)
    ways = np.array([float((block - state.positions[weight])[:, 2].mean()) for state in states])
    swing = damped_oscillation(times, ways, frequency)
    return Hanging(stretch=swing.mean / stretch - 1, frequency=swing.frequency / frequency - 1)


def hammer_flies(subject: Subject) -> Flight:
    """A block with a rod for a handle turns twice about an axis across it, which strains the rod by some hundredths."""
    rod, block, materials = _pieces(5, _LIGHT)
    points = np.concatenate([rod, block])
    masses = point_volume(_SPACING) * np.repeat([each.density for each in materials], [len(rod), len(block)])
    middle = masses @ points / masses.sum()
    spin = np.array([8.0, 0.0, 0.0])
    velocities = np.cross(spin, points - middle) + [0.3, 0.1, 0.2]
    problem = PointProblem(
        points=cloud_of([rod, block], [velocities[: len(rod)], velocities[len(rod) :]], _SPACING, range(2)),
        materials=materials,
        gravity=NO_GRAVITY,
        rigid_parts={1: 0},
    )
    # The last layer of the one lies on the first of the other.
    lowest = np.flatnonzero(np.isclose(points[:, 2], rod[:, 2].min()))
    highest = np.flatnonzero(np.isclose(points[:, 2], block[:, 2].max()))
    journal = Journal()
    times = np.linspace(0, 2 * 2 * math.pi / float(np.linalg.norm(spin)), 17)[1:]
    states = subject.states(problem, EngineAccuracy(spacing=_SPACING), times, {Field.VELOCITIES}, journal)
    momenta, spins, energies, ways = [], [], [], []
    for state in states:
        momenta.append(masses @ state.velocities)
        spins.append(angular_momentum(masses, state.positions, state.velocities))
        energies.append(kinetic_energy(masses, state.velocities))
        ways.append(float(np.linalg.norm(state.positions[lowest] - state.positions[highest], axis=1).mean()))
    given = masses @ velocities
    turning = angular_momentum(masses, points, velocities)
    return Flight(
        apart=max(ways) / _SPACING - 1 / POINTS_PER_CELL,
        momentum=max(float(np.linalg.norm(each - given)) for each in momenta) / float(np.linalg.norm(given)),
        spin=max(float(np.linalg.norm(each - turning)) for each in spins) / float(np.linalg.norm(turning)),
        energy=max(energies) / kinetic_energy(masses, velocities),
        substep_count=journal.substep_count,
    )
