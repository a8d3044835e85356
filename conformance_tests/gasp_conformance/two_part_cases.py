"""A body that is of two materials, or of one whose numbers vary from point to point; it measures and does not judge."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import capability_oracles as exact
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.observables import damped_oscillation, mode_amplitude
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Subject
from gasp_core.contract import Elastic, EngineAccuracy, NeoHookean, PointProblem

__all__ = ["TwoParts", "bar_of_two_rings"]

Array = NDArray[Any]

_CORNER = np.array([0.37, 0.21, 0.11])
"""No whole number of cells from anything."""
_CELLS = 16
_SEAM = 0.5
"""Where the one part ends [m], of a bar of 1 m."""
_PEAK = 0.002
"""Of the displacements [m]: strains stay below a percent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoParts:
    """A bar that is one thing up to its middle and another beyond: errors, and what grid and seam may leave of them.

    Parameters
    ----------
    frequency, frequency_allowed
        Of its frequency, relative.
    stretch, stretch_allowed
        Of how far its second half stretches where its first does so by a given length, relative.
    narrowing, narrowing_allowed
        Of Poisson's ratio of either half, by how much narrower it is where it is longer.
    """

    frequency: float
    frequency_allowed: float
    stretch: float
    stretch_allowed: float
    narrowing: tuple[float, float]
    narrowing_allowed: tuple[float, float]


def bar_of_two_rings(
    subject: Subject, first: Elastic | NeoHookean, second: Elastic | NeoHookean, *, columns: bool
) -> TwoParts:
    """A free bar of two halves rings in the first mode that it has along itself.

    Parameters
    ----------
    first, second
        Of its halves; of one kind.
    columns
        Whether all of it is of the first, and columns say where it is as the second.
    """
    spacing = 1.0 / _CELLS
    bar = box_of_points(_CORNER, (_CELLS, 1, 1), spacing)
    along = bar[:, 0] - _CORNER[0]
    beyond = along > _SEAM
    pulse = _pulse(first, second, _SEAM)
    shape, slope = _mode(first, second, along, _SEAM)
    velocities = np.zeros_like(bar)
    velocities[:, 0] = _PEAK * pulse * shape
    cloud = cloud_of([bar], [velocities], spacing)
    if columns:
        cloud = replace(cloud, material_columns=_columns(first, second, beyond))
        materials = (first,)
    else:
        cloud = replace(cloud, material_ids=beyond.astype(np.int32))
        materials = (first, second)
    problem = PointProblem(points=cloud, materials=materials, gravity=NO_GRAVITY)
    frequency = pulse / (2 * math.pi)
    times = np.linspace(0, 1.3 / frequency, 40)[1:]
    moved = np.array(
        [state.positions - bar for state in subject.states(problem, EngineAccuracy(spacing=spacing), times)]
    )
    amplitudes = np.array([mode_amplitude(row, shape) for row in moved[:, :, 0]])
    arms = bar[:, 1:] - bar[:, 1:].mean(axis=0)
    stretches: list[Array] = []
    narrowing: list[float] = []
    narrowing_allowed: list[float] = []
    dispersion = exact.grid_dispersion(math.pi, spacing)
    for half, material, other in ((~beyond, first, second), (beyond, second, first)):
        own, thinner = shape[half] - shape[half].mean(), -slope[half, None] * arms[half]
        stretches.append(np.array([mode_amplitude(row - row.mean(), own) for row in moved[:, half, 0]]))
        narrower = np.array([mode_amplitude(rows.ravel(), thinner.ravel()) for rows in moved[:, half, 1:]])
        narrowing.append(mode_amplitude(narrower, stretches[-1]) - material.poissons_ratio)
        # Half a cell at the seam may be as narrow as what it hangs on, which is strained by the same stress. Places
        # count with the square of their strain.
        doubtful = np.abs(along[half] - _SEAM) < spacing / 2
        share = float((slope[half][doubtful] ** 2).sum() / (slope[half] ** 2).sum())
        beside = other.poissons_ratio * material.youngs_modulus / other.youngs_modulus
        narrowing_allowed.append(share * abs(beside - material.poissons_ratio) + dispersion)
    # Where the one ends and the other begins, a grid knows to half a cell.
    displaced = [_SEAM + side * spacing / 2 for side in (-1, 1)]
    ratio = _stretch_ratio(first, second, _SEAM)
    return TwoParts(
        frequency=damped_oscillation(times, amplitudes, frequency).frequency / frequency - 1,
        frequency_allowed=dispersion + max(abs(_pulse(first, second, seam) / pulse - 1) for seam in displaced),
        stretch=mode_amplitude(stretches[1], stretches[0]) - 1,
        stretch_allowed=dispersion + max(abs(_stretch_ratio(first, second, seam) / ratio - 1) for seam in displaced),
        narrowing=(narrowing[0], narrowing[1]),
        narrowing_allowed=(narrowing_allowed[0], narrowing_allowed[1]),
    )


def _columns(first: Elastic | NeoHookean, second: Elastic | NeoHookean, beyond: Array) -> dict[str, Array]:
    """What the second has otherwise, where it is; nothing elsewhere, where the material's own number holds."""
    names = [one.name for one in dataclasses.fields(first) if one.name != "name"]
    return {
        name: np.where(beyond, getattr(second, name), np.nan)
        for name in names
        if getattr(second, name) != getattr(first, name)
    }


def _waves(*materials: Elastic | NeoHookean) -> list[tuple[float, float]]:
    """Speed sqrt(E / rho) [m/s] and impedance sqrt(E rho) [kg/m^2/s] of waves along a thin bar of each."""
    return [(math.sqrt(e / rho), math.sqrt(e * rho)) for e, rho in ((m.youngs_modulus, m.density) for m in materials)]


def _pulse(first: Elastic | NeoHookean, second: Elastic | NeoHookean, seam: float) -> float:
    return exact.two_part_pulse(seam, *_waves(first, second))


def _mode(first: Elastic | NeoHookean, second: Elastic | NeoHookean, along: Array, seam: float) -> tuple[Array, Array]:
    return exact.two_part_mode(along, seam, *_waves(first, second))


def _stretch_ratio(first: Elastic | NeoHookean, second: Elastic | NeoHookean, seam: float) -> float:
    """How far the second half of the bar's points stretches over the first, where the seam is elsewhere."""
    start, middle, end = _mode(first, second, np.array([0.0, _SEAM, 1.0]), seam)[0]
    return float((end - middle) / (middle - start))
