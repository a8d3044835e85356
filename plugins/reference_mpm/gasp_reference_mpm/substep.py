"""One step of MLS-MPM, from motion to motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import DomainPolicy, PointProblem
from gasp_core.stepping.mpm import presence
from gasp_core.stepping.rigid.side import RigidSide
from gasp_reference_mpm.bodies import looked, met
from gasp_reference_mpm.boundary import blown, collided, driven, kept_inside, kept_out
from gasp_reference_mpm.leading import Lead
from gasp_reference_mpm.material_points import Matter, Motion, deformed, kirchhoff_stress, shock_pressures
from gasp_reference_mpm.separation import Separation
from gasp_reference_mpm.subgrid import subgrid_velocities, with_room
from gasp_reference_mpm.transfer import carried, gather, reaching, scatter, stencil_around

__all__ = ["seeded_affine_velocities", "substep"]

Array = NDArray[Any]

_SEEDING_PASSES = 16
_HELD = 1e-6
"""Of a node's velocity: what the domain's edge takes of it beyond this is more than rounding."""


def substep(
    problem: PointProblem,
    matter: Matter,
    motion: Motion,
    separation: Separation | None,
    holding: Array,
    origin: Array,
    spacing: float,
    time: float,
    step: float,
    allowed: float,
    rigid: RigidSide | None = None,
    lead: Lead | None = None,
) -> tuple[Motion, Separation, Array]:
    """The motion `step` [s] after `time` [s], how far bodies are then apart, and a mask (N,) of the points that the
    domain's edge held back.

    Without a separation it is looked how far apart the bodies are. Of the drives at this time each holds some of them,
    `holding` (K, B). Rigid bodies take the step as well, which might have been as long as
    `allowed` [s], and points that are led are where they are led to.

    The stress is that of the stored deformation, and deformation and position move with the velocities just found
    (symplectic Euler).
    """
    stencil = stencil_around(motion.positions, spacing, problem.points.body_ids)
    tensions = (step * matter.firmness * matter.volumes)[:, None, None] * kirchhoff_stress(matter, motion, stencil)
    masses = matter.firmness * matter.masses
    grid = scatter(stencil, spacing, masses, motion.velocities, motion.affine_velocities, tensions)

    velocities = grid.momentum / grid.mass[:, None] + step * np.asarray(problem.gravity)
    places = grid.positions + origin
    velocities = blown(velocities, places, problem.force_fields, time, step)
    owners = stencil.fields.bodies_of(grid.nodes)
    velocities, held = driven(velocities, places, owners, problem.drives, holding, time, step, spacing)
    led = None if lead is None else lead.nodes(stencil.fields, grid, time, step)
    if led is not None:
        velocities[led.rows] = led.velocities
        held[led.rows] = True
    if separation is None:
        separation = looked(stencil, grid, 0.5 * np.cbrt(matter.volumes)[:, None, None] * motion.deformations, spacing)
    velocities, separation = met(problem, stencil, grid, velocities, held, separation, spacing, step)
    velocities = collided(velocities, places, problem.colliders, time, step, spacing)
    if problem.domain is not None and problem.domain.policy is DomainPolicy.CLAMP:
        kept = kept_inside(velocities, places, problem.domain, spacing)
        cut = np.linalg.norm(velocities - kept, axis=1) > _HELD * np.linalg.norm(velocities, axis=1)
        held_back = reaching(stencil, grid.nodes[cut])
        velocities = kept
    else:
        held_back = np.zeros(len(motion.positions), dtype=np.bool_)

    if led is not None:
        velocities = velocities.copy()
        velocities[led.rows] = led.velocities
    if rigid is not None:
        half_widths = 0.5 * np.cbrt(matter.volumes)
        near = rigid.near(motion.positions + origin, half_widths, problem.points.body_ids, spacing, origin)
        rows = np.searchsorted(grid.nodes, stencil.fields.flat(near.bodies, near.nodes))
        velocities = velocities.copy()
        node_masses = grid.mass if led is None else led.masses(grid.mass, matter.masses)
        beside = motion.positions[rigid.welds.rows] + origin
        met_nodes = rigid.met(near, velocities[rows], node_masses[rows], spacing, origin, beside, allowed)
        velocities[rows] = rigid.world.step(time, step, met_nodes)

    point_velocities, affine_velocities, velocity_gradients = gather(stencil, spacing, grid.nodes, velocities)
    roomy = with_room(matter, motion, stencil, grid, problem.colliders, origin, spacing, time, step)
    deformations, history = deformed(matter, roomy, velocity_gradients, step)
    present = presence(grid.mass, float(matter.masses.mean()))
    carrying = carried(stencil, spacing, grid.nodes, present, velocities, motion.tracers, matter.tracer_bodies)
    tracers = motion.tracers + step * carrying
    if problem.domain is not None and problem.domain.policy is DomainPolicy.CLAMP:
        # One that nothing moves may stay outside.
        inside = np.clip(tracers, problem.domain.lower - origin, problem.domain.upper - origin)
        tracers = np.where(np.any(carrying, axis=1)[:, None], inside, tracers)
    advancing = point_velocities
    flowing = matter.flowing
    if len(flowing):
        advancing, affine_velocities = point_velocities.copy(), affine_velocities.copy()
        unseen, unseen_affine = subgrid_velocities(
            matter, motion, stencil, grid, affine_velocities, velocity_gradients, spacing, step
        )
        advancing[flowing] += unseen
        affine_velocities[flowing] += unseen_affine
        advancing[flowing] = kept_out(
            advancing[flowing],
            motion.positions[flowing] + origin,
            0.5 * np.cbrt(matter.volumes[flowing]),
            problem.colliders,
            time,
            step,
        )
        if rigid is not None:
            advancing[flowing] = rigid.keep_out(
                advancing[flowing],
                motion.positions[flowing] + origin,
                0.5 * np.cbrt(matter.volumes[flowing]),
                matter.masses[flowing],
                problem.points.body_ids[flowing],
                step,
            )
    kept = 1 / (1 + step * matter.mass_damping)
    moved = Motion(
        positions=motion.positions + step * advancing,
        velocities=kept[:, None] * advancing,
        affine_velocities=kept[:, None, None] * affine_velocities,
        velocity_gradients=velocity_gradients,
        deformations=deformations,
        history=history,
        shock_pressures=shock_pressures(matter, velocity_gradients, step),
        tracers=tracers,
    )
    return moved if lead is None else lead.followed(moved, time + step), separation, held_back


def seeded_affine_velocities(
    positions: Array, spacing: float, bodies: Array, masses: Array, velocities: Array
) -> Array:
    """The affine velocities C (N, 3, 3) [1/s] that belong to a field of initial velocities (N, 3) [m/s].

    A cloud that starts with C = 0 loses spin to C in its first steps: of the angular momentum of a block of side a,
    1/(1 + 3 dx^2/a^2) is left in the velocities. So the grid is asked what the field's gradient is, again and again,
    each time with the last answer. An affine field's own gradient is what the transfers reproduce, and inside the
    cloud the first answer has it; near a free surface the error shrinks by 0.6 a pass.
    """
    stencil = stencil_around(positions, spacing, bodies)
    found = at_rest = np.zeros((len(positions), 3, 3))
    for _ in range(_SEEDING_PASSES):
        grid = scatter(stencil, spacing, masses, velocities, found, at_rest)
        _, found, _ = gather(stencil, spacing, grid.nodes, grid.momentum / grid.mass[:, None])
    return found
