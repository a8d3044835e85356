"""One step of MLS-MPM, from motion to motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.engine.contract import PointProblem
from gasp_core.engine.forcing import DomainPolicy
from gasp_reference_mpm.boundary import blown, collided, driven, kept_inside
from gasp_reference_mpm.matter import Matter, Motion, deformed, kirchhoff_stress
from gasp_reference_mpm.transfer import gather, inverse_inertia, reaching, scatter, stencil_around

__all__ = ["seeded_velocity_gradients", "substep"]

Array = NDArray[Any]

_SEEDING_PASSES = 16
_HELD = 1e-6
"""Of a node's velocity: what the domain's edge takes of it beyond this is more than rounding."""


def substep(
    problem: PointProblem, matter: Matter, motion: Motion, origin: Array, spacing: float, time: float, step: float
) -> tuple[Motion, Array]:
    """The motion `step` [s] after `time` [s], and a mask (N,) of the points that the domain's edge held back.

    Hu et al. 2018 (10.1145/3197517.3201293): the points' stress enters the grid as an affine momentum, -dt V0/D tau, so
    no gradient of a weight is ever needed. The stress is that of the stored deformation, and deformation and position
    move with the velocities just found (symplectic Euler).
    """
    masses = matter.masses[:, None, None]
    force = (matter.volumes * inverse_inertia(spacing))[:, None, None] * kirchhoff_stress(matter, motion)
    stencil = stencil_around(motion.positions, spacing)
    grid = scatter(
        stencil, spacing, matter.masses, motion.velocities, masses * motion.velocity_gradients - step * force
    )

    velocities = grid.momentum / grid.mass[:, None] + step * np.asarray(problem.gravity)
    places = grid.positions + origin
    velocities = blown(velocities, places, problem.force_fields, time, step)
    velocities = driven(velocities, places, problem.drives, time, spacing)
    velocities = collided(velocities, places, problem.colliders, spacing)
    if problem.domain is not None and problem.domain.policy is DomainPolicy.CLAMP:
        kept = kept_inside(velocities, places, problem.domain, spacing)
        cut = np.linalg.norm(velocities - kept, axis=1) > _HELD * np.linalg.norm(velocities, axis=1)
        held_back = reaching(stencil, grid.nodes[cut])
        velocities = kept
    else:
        held_back = np.zeros(len(motion.positions), dtype=np.bool_)

    point_velocities, velocity_gradients = gather(stencil, spacing, grid.nodes, velocities)
    deformations, volume_gains = deformed(matter, motion, velocity_gradients, step)
    moved = Motion(
        positions=motion.positions + step * point_velocities,
        velocities=point_velocities,
        velocity_gradients=velocity_gradients,
        deformations=deformations,
        volume_gains=volume_gains,
    )
    return moved, held_back


def seeded_velocity_gradients(positions: Array, spacing: float, masses: Array, velocities: Array) -> Array:
    """The affine velocities C (N, 3, 3) [1/s] that belong to a field of initial velocities (N, 3) [m/s].

    A cloud that starts with C = 0 loses spin to C in its first steps: of the angular momentum of a block of side a,
    1/(1 + 3 dx^2/a^2) is left in the velocities. So the grid is asked what the field's gradient is, again and again,
    each time with the last answer. An affine field's own gradient is what the transfers reproduce, and inside the
    cloud the first answer has it; near a free surface the error shrinks by 0.6 a pass.
    """
    stencil = stencil_around(positions, spacing)
    gradients = np.zeros((len(positions), 3, 3))
    for _ in range(_SEEDING_PASSES):
        grid = scatter(stencil, spacing, masses, velocities, masses[:, None, None] * gradients)
        _, gradients = gather(stencil, spacing, grid.nodes, grid.momentum / grid.mass[:, None])
    return gradients
