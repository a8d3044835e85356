"""What the grid does not see of matter that flows, and what it sees too much of.

`gasp_core.stepping.flow` says why.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.stepping.flow import CROWDED_VOLUME_RATIO, CROWDING_TOLERANCE, wall_share
from gasp_core.stepping.forcing import walls_of
from gasp_core.stepping.walls import wall_distances
from gasp_reference_mpm.material_points import Matter, Motion
from gasp_reference_mpm.transfer import GridMomentum, Stencil, brought, gather, weighted_sums

__all__ = ["subgrid_velocities", "with_room"]

Array = NDArray[Any]


def subgrid_velocities(
    matter: Matter,
    motion: Motion,
    stencil: Stencil,
    grid: GridMomentum,
    affine_velocities: Array,
    velocity_gradients: Array,
    spacing: float,
    step: float,
) -> tuple[Array, Array]:
    """What is left after `step` [s] of the flowing points' sub-grid velocities (K, 3) [m/s] and of their affine part
    (K, 3, 3) [1/s]; C[v_i'] and L (N, 3, 3) [1/s] are the step's."""
    rows = matter.flowing
    momentum = brought(stencil, grid.nodes, matter.masses, motion.velocities, motion.affine_velocities)
    seen, seen_affine, _ = gather(stencil, spacing, grid.nodes, momentum / grid.mass[:, None])
    product = motion.affine_velocities[rows] @ velocity_gradients[rows]
    fall = 0.5 * step * (product + product.transpose(0, 2, 1))
    change = affine_velocities[rows] - seen_affine[rows]
    size = np.sum(fall**2, axis=(1, 2))
    share = np.clip(np.sum(change * fall, axis=(1, 2)) / np.where(size > 0, size, 1.0), 0.0, 1.0)
    kept = np.maximum(1 - step * matter.subgrid_decays, 0.0)
    unseen = motion.velocities[rows] - seen[rows]
    unseen_affine = motion.affine_velocities[rows] - seen_affine[rows] - share[:, None, None] * fall
    return kept[:, None] * unseen, kept[:, None, None] * unseen_affine


def with_room(
    matter: Matter,
    motion: Motion,
    stencil: Stencil,
    grid: GridMomentum,
    colliders: Sequence[Collider],
    origin: Array,
    spacing: float,
    time: float,
    step: float,
) -> Motion:
    """The motion with volume ratios of fluids that are less where there is more of them than room."""
    rows = np.flatnonzero(matter.crowding_decays)
    if not len(rows):
        return motion
    volumes = np.linalg.det(motion.deformations[rows])
    own_density = matter.masses[rows] / matter.volumes[rows]
    seen = weighted_sums(stencil, grid.nodes, grid.mass)[rows] / spacing**3 / own_density
    for wall in itertools.chain.from_iterable(map(walls_of, colliders)):
        seen /= wall_share(wall_distances(wall, motion.positions[rows] + origin, time) / spacing)
    excess = np.maximum(seen * volumes - 1 - CROWDING_TOLERANCE, 0.0)
    shrunk = volumes / (1 + step * matter.crowding_decays[rows] * excess)
    roomy = np.maximum(shrunk, np.minimum(volumes, CROWDED_VOLUME_RATIO))
    deformations = motion.deformations.copy()
    deformations[rows] *= np.cbrt(roomy / volumes)[:, None, None]
    return replace(motion, deformations=deformations)
