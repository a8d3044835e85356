"""Points and how each of them deforms: which law belongs to which material, applied row by row."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Elastic, Fluid, Foam, Material, Metal, NeoHookean, Plasticine, PointProblem, Sand, Snow
from gasp_core.stepping.flow import crowding_decay, is_flowing, subgrid_decay
from gasp_core.stepping.mpm import averaged_lame
from gasp_core.stepping.shock import SHOCK_VISCOSITY
from gasp_core.stepping.stiffening import fluid_stiffening, hencky_stiffening, snow_stiffening, stiffening
from gasp_core.stepping.time_step import rest_bound, viscous_share
from gasp_core.stepping.tracer_bodies import tracer_bodies
from gasp_reference_mpm.constitutive import (
    drucker_prager_projection,
    fixed_corotated_stress,
    fluid_deformation,
    fluid_stress,
    hencky_stress,
    log_volume_ratio,
    logarithmic_strains,
    neo_hookean_stress,
    snow_hardening,
    snow_projection,
    viscoplastic_projection,
    viscous_stress,
    von_mises_projection,
)
from gasp_reference_mpm.transfer import Stencil, local_means

__all__ = ["Matter", "Motion", "deformed", "kirchhoff_stress", "matter_of", "shock_pressures", "stable_step"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Matter:
    """What does not change.

    Parameters
    ----------
    masses : (N,) [kg]
    volumes : (N,) [m^3]
        At rest.
    portions
        Each material with the rows that it owns.
    tracer_bodies : (M,)
        Whose matter carries each tracer.
    elastic, flowing : (L,), (K,)
        Rows of what is elastic alone, and of what flows.
    subgrid_decays : (K,) [1/s]
        How fast sub-grid velocities of what flows fade.
    crowding_decays : (N,) [1/s]
        How fast the volume ratio of fluids falls where they are crowded.
    shock_viscosities : (N,) [kg/m]
        c^2 rho dx^2 of the bulk viscosity that stops shocks; nought where there is none.
    mass_damping : (N,) [1/s]
        How fast all velocities fall by the material's own damping.
    firmness : (N,)
        How many times mass and stress count on the grid (`gasp_core.stepping.held_matter`).
    """

    masses: Array
    volumes: Array
    portions: tuple[tuple[Material, Array], ...]
    tracer_bodies: Array
    elastic: Array
    flowing: Array
    subgrid_decays: Array
    crowding_decays: Array
    shock_viscosities: Array
    mass_damping: Array
    firmness: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What changes. Positions are relative to the grid's origin.

    Parameters
    ----------
    positions : (N, 3) [m]
    velocities : (N, 3) [m/s]
    affine_velocities : (N, 3, 3) [1/s]
        C, what the transfers carry.
    velocity_gradients : (N, 3, 3) [1/s]
        L, what F grew by.
    deformations : (N, 3, 3)
        F; the elastic part of what flows, J^(1/3) I for fluids.
    history : (N,)
        What matter remembers of its flow beside F. Sand: the logarithm of the volume ratio it gained while loose. Snow:
        ln J_P. Metal and plasticine: equivalent plastic strain. Nothing else remembers anything.
    shock_pressures : (N,) [Pa]
        What a shock adds to the pressure (`gasp_core.stepping.shock`).
    tracers : (M, 3) [m]
        Massless points that are carried along.
    """

    positions: Array
    velocities: Array
    affine_velocities: Array
    velocity_gradients: Array
    deformations: Array
    history: Array
    shock_pressures: Array
    tracers: Array


def matter_of(problem: PointProblem, spacing: float) -> Matter:
    """Masses, volumes and material rows of a problem on a grid of `spacing` [m]."""
    ids = problem.points.material_ids
    flows = np.array([is_flowing(one) for one in problem.materials])[ids]
    flowing = np.flatnonzero(flows)
    decays = {index: subgrid_decay(problem.materials[index], spacing) for index in np.unique(ids[flowing])}
    crowdings = {index: crowding_decay(problem, index, spacing) for index in np.unique(ids)}
    volumes = problem.points.reference_volumes
    return Matter(
        masses=problem.masses,
        volumes=volumes,
        portions=tuple((problem.materials[index], np.flatnonzero(ids == index)) for index in np.unique(ids)),
        tracer_bodies=tracer_bodies(problem.points),
        elastic=np.flatnonzero(~flows),
        flowing=flowing,
        subgrid_decays=np.array([decays[index] for index in ids[flowing]]),
        crowding_decays=np.array([crowdings[index] for index in ids]),
        shock_viscosities=SHOCK_VISCOSITY * spacing**2 * np.where(flows, 0.0, problem.masses / volumes),
        mass_damping=np.array([getattr(one, "mass_damping", 0.0) for one in problem.materials])[ids],
        firmness=np.ones(len(ids)),
    )


def _law_stress(material: Material, deformation: Array, velocity_gradient: Array, history: Array) -> Array:
    match material:
        case Elastic():
            own = material.lame_lambda - averaged_lame(material)
            elastic = fixed_corotated_stress(deformation, material.shear_modulus, own)
            return elastic + viscous_stress(velocity_gradient, material.shear_modulus, own, material.stiffness_damping)
        case NeoHookean():
            own = material.lame_lambda - averaged_lame(material)
            elastic = neo_hookean_stress(deformation, material.shear_modulus, own)
            return elastic + viscous_stress(velocity_gradient, material.shear_modulus, own, material.stiffness_damping)
        case Sand():
            return hencky_stress(deformation, material.shear_modulus, material.lame_lambda)
        case Metal() | Plasticine() | Foam():
            own = material.lame_lambda - averaged_lame(material)
            return hencky_stress(deformation, material.shear_modulus, own)
        case Snow():
            at_rest = fixed_corotated_stress(deformation, material.shear_modulus, material.lame_lambda)
            return snow_hardening(history, material.hardening)[:, None, None] * at_rest
        case Fluid():
            return fluid_stress(deformation, velocity_gradient, material.bulk_modulus, material.viscosity)
        case _:
            raise AssertionError(f"{material.kind} is not among the declared materials")


def kirchhoff_stress(matter: Matter, motion: Motion, stencil: Stencil) -> Array:
    """tau of every point, (N, 3, 3) [Pa]; what is nearly incompressible feels the mean dilation around it."""
    stress = np.empty_like(motion.deformations)
    for material, rows in matter.portions:
        stress[rows] = _law_stress(
            material, motion.deformations[rows], motion.velocity_gradients[rows], motion.history[rows]
        )
    stress += (_mean_pressure(matter, motion, stencil) - motion.shock_pressures)[:, None, None] * np.eye(3)
    return stress


def _mean_pressure(matter: Matter, motion: Motion, stencil: Stencil) -> Array:
    """The isotropic part of tau (N,) [Pa] that comes from the mean dilation (`stepping.mpm.averaged_lame`)."""
    stiffness, dilation, leverage = (np.zeros(len(matter.masses)) for _ in range(3))
    spreading = np.trace(motion.velocity_gradients, axis1=1, axis2=2)
    for material, rows in matter.portions:
        stiffness[rows] = math.sqrt(averaged_lame(material))
        match material:
            case Elastic():
                leverage[rows] = np.linalg.det(motion.deformations[rows])
                dilation[rows] = leverage[rows] - 1
                dilation[rows] += material.stiffness_damping * leverage[rows] * spreading[rows]
            case NeoHookean():
                leverage[rows] = 1.0
                dilation[rows] = log_volume_ratio(motion.deformations[rows])
                dilation[rows] += material.stiffness_damping * spreading[rows]
            case Metal() | Plasticine() | Foam():
                leverage[rows] = 1.0
                dilation[rows] = logarithmic_strains(motion.deformations[rows]).sum(axis=1)
            case _:
                pass
    tight = np.flatnonzero(stiffness)
    pressure = np.zeros(len(stiffness))
    if len(tight):
        counted = (matter.firmness * matter.volumes)[tight]
        means = local_means(stencil, tight, counted, (stiffness * dilation)[tight])
        pressure[tight] = stiffness[tight] * leverage[tight] * means
    return pressure


def deformed(matter: Matter, motion: Motion, velocity_gradients: Array, step: float) -> tuple[Array, Array]:
    """Deformation and history after `step` [s] of velocity gradients L (N, 3, 3) [1/s].

    F grows to (I + dt L) F; then the material says how much of that it keeps as elastic deformation.
    """
    deformations = motion.deformations + step * velocity_gradients @ motion.deformations
    history = motion.history.copy()
    for material, rows in matter.portions:
        match material:
            case Sand():
                deformations[rows], history[rows] = drucker_prager_projection(
                    deformations[rows],
                    history[rows],
                    material.shear_modulus,
                    material.lame_lambda,
                    material.friction_slope,
                    material.loosest_strain,
                )
            case Snow():
                deformations[rows], history[rows] = snow_projection(
                    deformations[rows], history[rows], material.critical_compression, material.critical_stretch
                )
            case Metal():
                deformations[rows], history[rows] = von_mises_projection(
                    deformations[rows],
                    history[rows],
                    material.shear_modulus,
                    material.yield_stress,
                    material.hardening,
                    material.yield_stress,
                )
            case Plasticine():
                deformations[rows], history[rows] = von_mises_projection(
                    deformations[rows],
                    history[rows],
                    material.shear_modulus,
                    material.yield_stress,
                    -material.softening * material.yield_stress,
                    material.residual * material.yield_stress,
                )
            case Foam():
                deformations[rows] = viscoplastic_projection(
                    deformations[rows],
                    material.shear_modulus,
                    material.yield_stress,
                    material.plastic_viscosity,
                    step,
                )
            case Fluid():
                dilation = step * np.trace(velocity_gradients[rows], axis1=1, axis2=2)
                deformations[rows] = fluid_deformation(motion.deformations[rows], dilation)
            case _:
                pass
    return deformations, history


def shock_pressures(matter: Matter, velocity_gradients: Array, step: float) -> Array:
    """What a shock adds to the pressure, (N,) [Pa], of velocity gradients L (N, 3, 3) [1/s] in a step [s]."""
    pressing = np.maximum(-np.trace(velocity_gradients, axis1=1, axis2=2), 0.0)
    return matter.shock_viscosities * pressing * np.minimum(pressing, 1 / (12 * SHOCK_VISCOSITY * step))


def stable_step(matter: Matter, motion: Motion, spacing: float) -> float:
    """Smallest stable step [s] over all points as they are deformed now."""
    bound = np.inf
    for material, rows in matter.portions:
        deformation = motion.deformations[rows]
        match material:
            case Fluid():
                growth = fluid_stiffening(deformation[:, 0, 0] ** 3, viscous_share(material, spacing))
            case Metal() | Plasticine() | Foam():
                growth = hencky_stiffening(deformation)
            case Snow():
                growth = stiffening(deformation) * snow_stiffening(motion.history[rows], material.hardening)
            case _:
                growth = stiffening(deformation)
        bound = min(bound, rest_bound(material, spacing) / float(np.sqrt(growth.max())))
    return bound
