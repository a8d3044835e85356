"""Rigid bodies: what they are, where they are, and how they move while nothing touches them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem, Rigid
from gasp_core.errors import SceneError
from gasp_core.gaussians import rotation_quaternions
from gasp_core.stepping.mass_properties import inertia_of_cubes, shown_spin
from gasp_core.stepping.rigid.turning import rotations_of
from gasp_core.stepping.rigid_motion import Pose, rotation_matrix
from gasp_core.stepping.vectors import crossed

__all__ = ["RigidBodies", "RigidState", "momenta_of", "moved", "poses_of", "rigid_bodies_of"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidBodies:
    """What does not change of B rigid bodies with N points.

    Parameters
    ----------
    bodies : (B,)
        Their numbers in `PointCloud.body_ids`.
    owners : (N,)
        Which of them each point is of, 0 to B - 1.
    rows : (N,)
        Of the points in the cloud.
    point_masses : (N,) [kg]
    masses : (B,) [kg]
    centers : (B, 3) [m]
        Of mass, at the points' reference positions.
    axes : (B, 3, 3)
        Rotations whose columns are the principal axes there.
    moments : (B, 3) [kg m^2]
        About these axes; a point is a cube of its volume.
    arms : (N, 3) [m]
        Of the points from their body's centre, along its principal axes.
    restitutions : (B,)
    """

    bodies: Array
    owners: Array
    rows: Array
    point_masses: Array
    masses: Array
    centers: Array
    axes: Array
    moments: Array
    arms: Array
    restitutions: Array

    def __len__(self) -> int:
        return len(self.bodies)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidState:
    """Where B rigid bodies are, and how they move.

    Parameters
    ----------
    places : (B, 3) [m]
        Of their centres of mass.
    quaternions : (B, 4)
        Unit (w, x, y, z): from the principal axes to the scene.
    velocities : (B, 3) [m/s]
        Of the centres.
    spins : (B, 3) [kg m^2/s]
        Angular momenta about the centres, in the scene's frame: what stays while nothing touches a body.
    """

    places: Array
    quaternions: Array
    velocities: Array
    spins: Array

    @property
    def rotations(self) -> Array:
        """(B, 3, 3), from the principal axes to the scene."""
        return rotations_of(self.quaternions)

    def angular_velocities(self, bodies: RigidBodies) -> Array:
        """(B, 3) [rad/s], in the scene's frame."""
        turned = self.rotations
        along = np.einsum("bji,bj->bi", turned, self.spins) / bodies.moments
        return np.einsum("bij,bj->bi", turned, along)

    def positions(self, bodies: RigidBodies) -> Array:
        """Of the points, (N, 3) [m]."""
        return self.places[bodies.owners] + np.einsum("nij,nj->ni", self.rotations[bodies.owners], bodies.arms)

    def point_velocities(self, bodies: RigidBodies) -> Array:
        """Of the points, (N, 3) [m/s]."""
        arms = np.einsum("nij,nj->ni", self.rotations[bodies.owners], bodies.arms)
        turning = crossed(self.angular_velocities(bodies)[bodies.owners], arms)
        return self.velocities[bodies.owners] + turning

    def kinetic_energies(self, bodies: RigidBodies) -> Array:
        """(B,) [J]."""
        straight = bodies.masses * np.sum(self.velocities**2, axis=1)
        return 0.5 * (straight + np.sum(self.spins * self.angular_velocities(bodies), axis=1))

    @classmethod
    def at_rest(cls, bodies: RigidBodies, velocities: Array) -> Self:
        """The rigid motion with the momenta that points (N, 3) [m/s] have at their reference positions.

        See `gasp_core.stepping.mass_properties.shown_spin`.
        """
        count = len(bodies)
        mean, spins = np.zeros((count, 3)), np.zeros((count, 3))
        quaternions = rotation_quaternions(bodies.axes)
        for body in range(count):
            own = bodies.owners == body
            weights = bodies.point_masses[own]
            mean[body] = weights @ velocities[own] / bodies.masses[body]
            spin = shown_spin(weights, bodies.arms[own] @ bodies.axes[body].T, velocities[own] - mean[body])
            spins[body] = bodies.axes[body] @ (bodies.moments[body] * (spin @ bodies.axes[body]))
        return cls(places=bodies.centers.copy(), quaternions=quaternions, velocities=mean, spins=spins)


def rigid_bodies_of(problem: PointProblem) -> RigidBodies | None:
    """The rigid bodies of a problem; None where it has none.

    Raises
    ------
    SceneError
        Where a body is rigid in part.
    """
    points = problem.points
    is_rigid = np.array([isinstance(material, Rigid) for material in problem.materials])[points.material_ids]
    if not is_rigid.any():
        return None
    numbers = np.unique(points.body_ids[is_rigid])
    mixed = np.intersect1d(numbers, points.body_ids[~is_rigid])
    if len(mixed):
        raise SceneError(f"body {mixed[0]} has points that are rigid and points that are not: give these a body each")
    rows = np.flatnonzero(is_rigid)
    owners = np.searchsorted(numbers, points.body_ids[rows])
    weights, places = problem.masses[rows], points.reference_positions[rows]
    masses = np.bincount(owners, weights)
    centers = np.stack([np.bincount(owners, weights * places[:, axis]) for axis in range(3)], axis=1) / masses[:, None]
    arms = places - centers[owners]
    bounces = np.array([_restitution(problem, body) for body in numbers])
    axes, moments = np.empty((len(numbers), 3, 3)), np.empty((len(numbers), 3))
    for body in range(len(numbers)):
        own = owners == body
        inertia = inertia_of_cubes(weights[own], arms[own], points.reference_volumes[rows[own]])
        moments[body], axes[body] = np.linalg.eigh(inertia)
        axes[body, :, 2] = np.cross(axes[body, :, 0], axes[body, :, 1])
    return RigidBodies(
        bodies=numbers,
        owners=owners,
        rows=rows,
        point_masses=weights,
        masses=masses,
        centers=centers,
        axes=axes,
        moments=moments,
        arms=np.einsum("nji,nj->ni", axes[owners], arms),
        restitutions=bounces,
    )


def momenta_of(bodies: RigidBodies, state: RigidState, given: Array) -> Array:
    """Linear and angular momenta (B, 6), about the centres, of what is given to the points, (N, 3) [kg m/s]."""
    turning = crossed(state.positions(bodies) - state.places[bodies.owners], given)
    both = np.concatenate([given, turning], axis=1)
    return np.stack([np.bincount(bodies.owners, column, len(bodies)) for column in both.T], axis=1)


def poses_of(bodies: RigidBodies, state: RigidState) -> list[Pose]:
    """From the reference positions to where the bodies are, and how fast."""
    turns, spins = state.rotations @ bodies.axes.transpose(0, 2, 1), state.angular_velocities(bodies)
    return [
        Pose(center=center, place=place, rotation=turn, velocity=velocity, angular_velocity=spin)
        for center, place, turn, velocity, spin in zip(bodies.centers, state.places, turns, state.velocities, spins)
    ]


def _restitution(problem: PointProblem, body: int) -> float:
    """The least of a body's materials."""
    used = np.unique(problem.points.material_ids[problem.points.body_ids == body])
    return min(material.restitution for row in used if isinstance(material := problem.materials[row], Rigid))


def moved(bodies: RigidBodies, state: RigidState, step: float) -> RigidState:
    """The state after `step` [s] in which nothing touches the bodies.

    Turns about one principal axis after the other, half of each but the last on the way there and half on the way back
    (Dullweber, Leimkuhler and McLachlan 1997, "Symplectic splitting methods for rigid body molecular dynamics"): the
    angular momentum is kept to rounding and the energy oscillates by O(step^2) without a drift.
    """
    quaternions = state.quaternions
    along = np.einsum("bji,bj->bi", state.rotations, state.spins)
    for axis, share in ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)):
        angle = share * step * along[:, axis] / bodies.moments[:, axis]
        one, other = (axis + 1) % 3, (axis + 2) % 3
        cosine, sine = np.cos(angle), np.sin(angle)
        first, second = along[:, one].copy(), along[:, other].copy()
        along[:, one] = cosine * first + sine * second
        along[:, other] = cosine * second - sine * first
        quaternions = _turned(quaternions, axis, angle)
    quaternions = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return RigidState(
        places=state.places + step * state.velocities,
        quaternions=quaternions,
        velocities=state.velocities,
        spins=state.spins,
    )


def driven_round(
    bodies: RigidBodies, before: RigidState, after: RigidState, held: Sequence[int], spins: Array, step: float
) -> RigidState:
    """The state `after` a step [s] with those of its bodies that are `held` as far round as angular velocities (B, 3)
    [rad/s] have brought them: what turns freely is turned by its moments too.
    """
    if not held:
        return after
    rotations, quaternions, kept = before.rotations, after.quaternions.copy(), after.spins.copy()
    for body in held:
        axes = rotation_matrix(step * spins[body]) @ rotations[body]
        quaternions[body] = rotation_quaternions(axes[None])[0]
        kept[body] = axes @ (bodies.moments[body] * (spins[body] @ axes))
    return replace(after, quaternions=quaternions, spins=kept)


def _turned(quaternions: Array, axis: int, angles: Array) -> Array:
    """Quaternions (B, 4) after turns by angles (B,) [rad] about an axis of the body's own."""
    w, v = quaternions[:, 0], quaternions[:, 1:]
    cosine, sine = np.cos(angles / 2), np.sin(angles / 2)
    # The product with (cosine, sine times the axis).
    along, one, other = v[:, axis], (axis + 1) % 3, (axis + 2) % 3
    turned = np.empty_like(quaternions)
    turned[:, 0] = w * cosine - along * sine
    turned[:, 1 + axis] = along * cosine + w * sine
    turned[:, 1 + one] = v[:, one] * cosine + v[:, other] * sine
    turned[:, 1 + other] = v[:, other] * cosine - v[:, one] * sine
    return turned
