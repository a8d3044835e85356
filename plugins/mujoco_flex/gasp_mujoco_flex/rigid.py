"""A rigid body: its mass and inertia, and the convex shapes by which it touches others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gasp_core.contract import SignedDistanceField
from gasp_core.stepping.convex_pieces import convex_pieces
from gasp_core.stepping.embedding import CORNERS
from gasp_core.stepping.mass_properties import inertia_of_cubes, shown_spin
from gasp_core.stepping.voxel_cage import VoxelGrid
from gasp_mujoco_flex.body_mass import Matter

__all__ = ["PIECES", "RigidBody", "merged_boxes", "rigid_body"]

Array = NDArray[Any]

_CONVEX = 0.8
"""Share of its hull that a body's matter fills, from which on the hull stands for it."""
PIECES = 128
"""Convex bodies that a body of known shape is made of, at most: statues then go beyond their surface by a voxel."""
_NO_BOXES = np.zeros((0, 2, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidBody:
    """Six numbers, and what belongs to them.

    Parameters
    ----------
    centre : (3,) [m]
        Of mass.
    inertia : (3, 3) [kg m^2]
        About it.
    velocity, spin : (3,) [m/s], [rad/s]
        At the start: those of the rigid motion with the same momenta.
    hulls : of (H, 3) [m]
        Corners of the convex bodies that it is made of, about the centre; none where boxes stand for it.
    boxes : (B, 2, 3) [m]
        Middle about the centre, and half sides, of boxes that fill it; none where hulls do.
    surface : (S, 3) [m]
        Places on its surface about the centre, where that is known.
    matter
        What it is made of.
    arms : (G, 3) [m]
        Of the given points, about the centre.
    """

    centre: Array
    inertia: Array
    velocity: Array
    spin: Array
    hulls: tuple[Array, ...]
    boxes: Array
    surface: Array
    matter: Matter
    arms: Array

    @property
    def corners(self) -> Array:
        """Of its shapes, about its centre, (K, 3) [m]."""
        signs = 2.0 * CORNERS - 1
        of_boxes = (self.boxes[:, None, 0] + signs * self.boxes[:, None, 1]).reshape(-1, 3)
        return np.concatenate([*self.hulls, of_boxes])


def rigid_body(matter: Matter, grid: VoxelGrid, margin: float, shape: SignedDistanceField | None = None) -> RigidBody:
    """The rigid body of this matter.

    Parameters
    ----------
    matter
        Its points stand for what is within `margin` [m] of them along each axis.
    grid
        Its cells are the body's shape where that is far from convex, and not known.
    shape
        What it fills, where that is known.
    """
    centre = matter.centre
    arms = matter.positions - centre
    inertia = inertia_of_cubes(matter.masses, arms, matter.volumes)
    velocity = matter.masses @ matter.velocities / matter.mass
    spin = shown_spin(matter.masses, arms, matter.velocities - velocity)
    if shape is None:
        hulls, boxes = _shapes(matter, grid, margin, centre)
    else:
        hulls, boxes = tuple(piece - centre for piece in convex_pieces(shape, PIECES)), _NO_BOXES
    return RigidBody(
        centre=centre,
        inertia=inertia,
        velocity=velocity,
        spin=spin,
        hulls=hulls,
        boxes=boxes,
        surface=np.concatenate(hulls) if shape is not None else np.zeros((0, 3)),
        matter=matter,
        arms=np.ascontiguousarray(arms[: len(matter.rows)]),
    )


def _shapes(matter: Matter, grid: VoxelGrid, margin: float, centre: Array) -> tuple[tuple[Array, ...], Array]:
    """A hull (H, 3) or boxes (B, 2, 3) about the centre."""
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[tuple(grid.locate(matter.positions)[0].T)] = True
    try:
        hull = ConvexHull(matter.positions)
    except (QhullError, ValueError):
        # Flat, thin, or too few points.
        hull = None
    if hull is not None and matter.volumes.sum() >= _CONVEX * hull.volume:
        signs = 2.0 * CORNERS - 1
        corners = (matter.positions[hull.vertices][:, None] + margin * signs).reshape(-1, 3)
        return (corners[ConvexHull(corners).vertices] - centre,), _NO_BOXES
    corners = merged_boxes(occupied)
    low, high = (grid.lower - centre + side * grid.sides for side in (corners[:, 0], corners[:, 1]))
    return (), np.stack([(low + high) / 2, (high - low) / 2], axis=1)


def merged_boxes(occupied: Array) -> Array:
    """Boxes (B, 2, 3) of cells, first and one beyond the last, that fill the occupied cells (I, J, K) once each.

    Greedily: from the first cell that is left, as far as it goes along z, then y, then x.
    """
    left = occupied.copy()
    boxes: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
    while left.any():
        x, y, z = (int(index) for index in np.unravel_index(int(np.argmax(left)), left.shape))
        end_z = z + _run(left[x, y, z:])
        end_y = y + _run(np.all(left[x, y:, z:end_z], axis=1))
        end_x = x + _run(np.all(left[x:, y:end_y, z:end_z], axis=(1, 2)))
        left[x:end_x, y:end_y, z:end_z] = False
        boxes.append(((x, y, z), (end_x, end_y, end_z)))
    return np.array(boxes).reshape(-1, 2, 3)


def _run(flags: Array) -> int:
    """How many are true before the first that is not."""
    return int(np.argmin(flags)) if not flags.all() else len(flags)
