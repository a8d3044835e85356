"""What changes of the points, and its translation into the numbers that Genesis steps.

Genesis compiles the size of a substep and all stiffnesses into its kernels, for seconds. So its clock ticks in equal
steps, and it is the units that change: the unit of time is one substep, whatever that is now. Velocities, gravity and
the inverse of the masses then take a factor each time the substep changes, and lengths are counted in cells, so that
neither the size of a scene nor its place decides about rounding.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Fluid
from gasp_genesis_mpm.material_mapping import Law, law_of, stiffness_of
from gasp_genesis_mpm.stiffness_groups import Portion

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
        F; the elastic part of what flows, before the last strain has been returned to what it bears; J^(1/3) I of
        fluids.
    history : (N,)
        Genesis' Jp. Sand: the logarithm of the volume ratio gained while loose. Snow: J_P. Metal: equivalent plastic
        strain. Nothing else has any.
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

    def laws(self) -> tuple[Law, ...]:
        """The law of every portion."""
        scale = self._stress_scale
        return tuple(law_of(portion.material, scale * portion.volume) for portion in self.portions)

    def actuations(self, step: float) -> Array:
        """What substeps of `step` [s] make of a fluid's viscosity, (N,) in Genesis' order; 0 for all else."""
        return self._spread(
            portion.material.viscosity / (portion.material.bulk_modulus * step)
            if isinstance(portion.material, Fluid)
            else 0.0
            for portion in self.portions
        )

    @property
    def _flows(self) -> Array:
        """Which rows (N,), in Genesis' order, are of fluids."""
        return self._spread(isinstance(portion.material, Fluid) for portion in self.portions)

    def _spread(self, values: Iterable[float]) -> Array:
        """To each point (N,), in Genesis' order, the value of its portion."""
        return np.repeat(np.array(list(values)), [len(portion.rows) for portion in self.portions])

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
        step back. A fluid's is always that at rest, and its history the volume ratio one step back.
        """
        order, rate = self.order, step / TICK
        affine, deformations, history = (
            rows[order] for rows in (motion.affine_velocities, motion.deformations, motion.history)
        )
        flows = self._flows
        history[flows] = np.linalg.det(deformations[flows]) / self._dilation(affine[flows], step)
        deformations = np.linalg.solve(np.eye(3) + step * affine, deformations)
        deformations[flows] = np.eye(3)
        return Numbers(
            positions=motion.cells[order] - shift,
            velocities=motion.velocities[order] * (rate / self.spacing),
            affine_velocities=affine * rate,
            deformations=deformations,
            history=history,
        )

    @staticmethod
    def _dilation(affine: Array, step: float) -> Array:
        """By what factors (n,) volumes grow in a substep, of C (n, 3, 3) [1/s]."""
        return np.clip(1 + step * np.trace(affine, axis1=1, axis2=2), 0.1, 10.0)

    def motion(self, numbers: Numbers, shift: Array, step: float) -> Motion:
        """The inverse of `numbers`."""
        order, rate = self.order, step / TICK
        affine = numbers.affine_velocities / rate
        deformations = (np.eye(3) + step * affine) @ numbers.deformations
        history = numbers.history.copy()
        flows = self._flows
        ratios = history[flows] * self._dilation(affine[flows], step)
        deformations[flows] = np.cbrt(ratios)[:, None, None] * np.eye(3)
        history[flows] = 1.0

        def restored(rows: Array) -> Array:
            given = np.empty_like(rows)
            given[order] = rows
            return given

        return Motion(
            cells=restored(numbers.positions + shift),
            velocities=restored(numbers.velocities * (self.spacing / rate)),
            affine_velocities=restored(affine),
            deformations=restored(deformations),
            history=restored(history),
        )
