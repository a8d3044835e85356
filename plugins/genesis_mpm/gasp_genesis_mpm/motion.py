"""What changes of the points, and its translation into the numbers that Genesis steps.

Genesis compiles the size of a substep and all stiffnesses into its kernels, for seconds. So its clock ticks in equal
steps, and it is the units that change: the unit of time is one substep, whatever that is now. Velocities, gravity and
the inverse of the masses then take a factor each time the substep changes, and lengths are counted in cells, so that
neither the size of a scene nor its place decides about rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_genesis_mpm.laws import Law, law_of, stiffness_of
from gasp_genesis_mpm.portions import Portion

__all__ = ["PARTICLE_VOLUME", "TICK", "Motion", "Numbers", "Units"]

Array = NDArray[Any]

TICK = 2.0**-20
"""Genesis' substep, in its own seconds. A power of two rounds nothing. Small, because Genesis adds 1e-7 to the squares
of float32 speeds before it takes their root: what it calls a speed should be large against that."""
PARTICLE_VOLUME = 1e3
"""Genesis' own volume of a particle of size 1, which its forces are multiplied by."""
_STIFFEST = 2.0**50
"""The largest stiffness in Genesis' numbers: masses are some 1e7 then, far above the 1e-7 it takes for nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What changes, all of one moment.

    Parameters
    ----------
    cells : (N, 3)
        Positions, in cells from the session's origin.
    velocities : (N, 3) [m/s]
    affine_velocities : (N, 3, 3) [1/s]
        C.
    deformations : (N, 3, 3)
        F; the elastic part of what flows, before the last strain has been returned to what it bears.
    history : (N,)
        Genesis' Jp. Sand: the logarithm of the volume ratio gained while loose. Snow: J_P. Nothing else has any.
    """

    cells: Array
    velocities: Array
    affine_velocities: Array
    deformations: Array
    history: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """A motion as Genesis has it: (N, 3) twice, (N, 3, 3) twice, (N,), float64, in Genesis' order."""

    positions: Array
    velocities: Array
    affine_velocities: Array
    deformations: Array
    history: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """Between SI and Genesis' numbers.

    Parameters
    ----------
    spacing
        Of the grid [m].
    portions
        Of the points; Genesis has them in this order.
    masses : (N,) [kg]
        In the given order.
    """

    spacing: float
    portions: tuple[Portion, ...]
    masses: Array

    @property
    def order(self) -> Array:
        """Rows (N,) in Genesis' order."""
        return np.concatenate([portion.rows for portion in self.portions])

    @property
    def _stress_scale(self) -> float:
        return _STIFFEST / max(stiffness_of(portion.material) * portion.volume for portion in self.portions)

    def laws(self, step: float) -> tuple[Law, ...]:
        """Genesis' material of every portion, for substeps of `step` [s]."""
        scale = self._stress_scale
        return tuple(law_of(portion.material, scale * portion.volume, step) for portion in self.portions)

    def scaled_masses(self, step: float) -> Array:
        """Genesis' masses (N,), in its order, for substeps of `step` [s].

        A substep changes a velocity in cells a substep by V tau dt^2 / (m dx^2), whatever the units.
        """
        scale = PARTICLE_VOLUME * self._stress_scale * (TICK * self.spacing / step) ** 2
        return scale * self.masses[self.order]

    def scaled_gravity(self, gravity: tuple[float, float, float], step: float) -> tuple[float, float, float]:
        """Genesis' gravity, of one in [m/s^2], for substeps of `step` [s]."""
        scale = (step / TICK) ** 2 / self.spacing
        x, y, z = gravity
        return scale * x, scale * y, scale * z

    def numbers(self, motion: Motion, shift: Array, step: float) -> Numbers:
        """Genesis' numbers of a motion, for substeps of `step` [s], `shift` (3,) cells from the session's origin.

        Genesis strains F at the beginning of a substep, by the C of the one before: its F is that of the positions one
        step back.
        """
        order, rate = self.order, step / TICK
        strain = np.eye(3) + step * motion.affine_velocities[order]
        return Numbers(
            positions=motion.cells[order] - shift,
            velocities=motion.velocities[order] * (rate / self.spacing),
            affine_velocities=motion.affine_velocities[order] * rate,
            deformations=np.linalg.solve(strain, motion.deformations[order]),
            history=motion.history[order],
        )

    def motion(self, numbers: Numbers, shift: Array, step: float) -> Motion:
        """The inverse of `numbers`."""
        order, rate = self.order, step / TICK
        affine = numbers.affine_velocities / rate
        deformations = (np.eye(3) + step * affine) @ numbers.deformations

        def restored(rows: Array) -> Array:
            given = np.empty_like(rows)
            given[order] = rows
            return given

        return Motion(
            cells=restored(numbers.positions + shift),
            velocities=restored(numbers.velocities * (self.spacing / rate)),
            affine_velocities=restored(affine),
            deformations=restored(deformations),
            history=restored(numbers.history),
        )
