"""The engine's own units, so that neither the size of a scene nor its place decides about rounding.

Length: the grid spacing. Origin: the anchor, a place in the world where a node lies. Time: the smallest stable step of
any material used. Mass: the mean mass of a point. With tau' = 4 T^2 / (rho dx^2) tau the scaled stiffness of the
stiffest material is about 4, whatever its Young's modulus.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Elastic, Fluid, Foam, Material, Metal, NeoHookean, Plasticine, PointProblem, Sand, Snow
from gasp_core.stepping.flow import crowding_decay, subgrid_decay
from gasp_core.stepping.grid import grid_node
from gasp_core.stepping.mpm import averaged_lame
from gasp_core.stepping.time_step import rest_bound, viscous_share
from gasp_mpm_host import layout as at

__all__ = ["Units", "material_table"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """Conversion between SI and the engine's units.

    Parameters
    ----------
    spacing
        Grid spacing [m].
    time
        Unit of time [s].
    mass
        Unit of mass [kg].
    anchor : (3,) [m]
        A node of the grid (`gasp_core.stepping.grid.grid_node`).
    """

    spacing: float
    time: float
    mass: float
    anchor: Array

    @classmethod
    def of(cls, problem: PointProblem, spacing: float) -> Self:
        """Units for a problem on a grid of the given spacing [m]."""
        used = [problem.materials[index] for index in np.unique(problem.points.material_ids)]
        time = min(rest_bound(material, spacing) for material in used)
        return cls(spacing=spacing, time=time, mass=float(problem.masses.mean()), anchor=grid_node(problem, spacing))

    @property
    def speed(self) -> float:
        """Unit of velocity [m/s]."""
        return self.spacing / self.time

    def cells(self, positions: Any) -> Array:
        """World positions (..., 3) [m] in cells from the anchor, float64."""
        return (np.asarray(positions, dtype=np.float64) - self.anchor) / self.spacing

    def world(self, cells: Array) -> Array:
        """Positions (..., 3) [m] of cells."""
        return cells * self.spacing + self.anchor


def material_table(problem: PointProblem, units: Units) -> Array:
    """Scaled parameters of every material, flat float64 rows of `layout.MATERIAL_WIDTH`."""
    table = np.zeros((len(problem.materials), at.MATERIAL_WIDTH))
    density = problem.materials[0].density
    for index, (row, material) in enumerate(zip(table, problem.materials)):
        if material.kind not in at.KINDS:
            continue  # an unused row: what is used has been checked against the capabilities
        scale = 4 * units.time**2 / (material.density * units.spacing**2)
        row[at.KIND] = at.KINDS[material.kind]
        row[at.INVERSE_BOUND] = rest_bound(material, units.spacing) ** -2
        row[at.LIGHTNESS] = density / material.density
        row[at.SUBGRID_DECAY] = units.time * subgrid_decay(material, units.spacing)
        row[at.CROWDING_DECAY] = units.time * crowding_decay(problem, index, units.spacing)
        row[at.FULLNESS] = units.mass / (material.density * units.spacing**3)
        if isinstance(material, Fluid):
            row[at.LAME] = scale * material.bulk_modulus
            row[at.VISCOSITY] = scale * material.viscosity / units.time
            row[at.VISCOUS_SHARE] = viscous_share(material, units.spacing)
            continue
        row[at.SHEAR] = scale * getattr(material, "shear_modulus")  # noqa: B009
        averaged = averaged_lame(material)
        row[at.LAME] = scale * (getattr(material, "lame_lambda") - averaged)  # noqa: B009
        row[at.MEAN_STIFFNESS] = math.sqrt(scale * material.density / density * averaged)
        if isinstance(material, Elastic | NeoHookean):
            damping = material.stiffness_damping / units.time
            row[at.VISCOSITY], row[at.BULK_VISCOSITY] = damping * row[at.SHEAR], damping * row[at.LAME]
            row[at.STIFFNESS_DAMPING] = damping
            row[at.MASS_DAMPING] = material.mass_damping * units.time
        _write_flow(row, material, math.sqrt(2 / 3) * scale, units.time)
    return table.reshape(-1)


def _write_flow(row: Array, material: Material, scale: float, time: float) -> None:
    """What a material's return mapping reads; `scale` makes |dev tau| of a yield stress, `time` is the unit [s]."""
    match material:
        case Sand():
            row[at.CONE] = math.sqrt(2 / 3) * material.friction_slope / 3
            row[at.LOOSEST_STRAIN] = material.loosest_strain
        case Metal():
            row[[at.YIELD, at.RESIDUAL]] = scale * material.yield_stress
            row[at.HARDENING] = scale * material.hardening
        case Plasticine():
            row[at.YIELD] = scale * material.yield_stress
            row[at.HARDENING] = -scale * material.yield_stress * material.softening
            row[at.RESIDUAL] = scale * material.yield_stress * material.residual
        case Foam():
            row[at.YIELD] = scale * material.yield_stress
            row[at.RELAXATION] = material.plastic_viscosity / (2 * material.shear_modulus) / time
        case Snow():
            row[at.HARDENING] = material.hardening
            row[at.LEAST_STRETCH] = max(1 - material.critical_compression, at.SMALLEST_STRETCH)
            row[at.GREATEST_STRETCH] = 1 + material.critical_stretch
        case _:
            pass
