"""Where something is that moves as a prescribed rigid body, and how fast."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import KeyframedMotion, RigidMotion, SteadyMotion
from gasp_core.gaussians import rotation_matrices
from gasp_core.stepping.vectors import crossed

__all__ = ["Pose", "abrupt_times", "pose_of", "rotation_matrix", "starts_of"]

Array = NDArray[Any]


def rotation_matrix(rotation_vector: Array) -> Array:
    """Rotation (3, 3) about an axis by its length [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(rotation_vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Of what moves: x in the scene is at place + rotation (x - center) now.

    Parameters
    ----------
    center : (3,) [m]
    place : (3,) [m]
    rotation : (3, 3)
    velocity : (3,) [m/s]
        Of what was at the center.
    angular_velocity : (3,) [rad/s]
        w.
    inward
        [s]: how much of w x (w x r) [m/s^2] belongs to a velocity; 0 at a moment, see `during`.
    """

    center: Array
    place: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    inward: float = 0.0

    def before(self, positions: Array) -> Array:
        """Where in the scene is what is at positions (N, 3) [m] now."""
        return (positions - self.place) @ self.rotation + self.center

    def velocities(self, positions: Array) -> Array:
        """Velocities (N, 3) [m/s] of what is at positions (N, 3) [m] now."""
        around = crossed(self.angular_velocity, positions - self.place)
        velocities = self.velocity + around
        return velocities + self.inward * crossed(self.angular_velocity, around) if self.inward else velocities

    def during(self, step: float) -> Pose:
        """The same pose with the velocities that bring everything in a `step` [s] to where it is then.

        Along the chord and not along the tangent, which leads outward: what is held by tangents turns in a spiral, and
        its deformation gradient grows. With a turn by t = |w| dt about the axis n, (R - I)/dt is, by Rodrigues,
        sin t / dt [n] + (1 - cos t) / dt [n]^2, [n] being the matrix of the cross product: that of w' = w sin t / t,
        and dt / (1 + cos t) times its square.
        """
        # More than that no step turns: limits keep it below a fifth.
        angle = min(float(np.linalg.norm(self.angular_velocity)) * step, 3.0)
        if angle == 0.0:
            return self
        slower = self.angular_velocity * (math.sin(angle) / angle)
        return replace(self, angular_velocity=slower, inward=step / (1 + math.cos(angle)))


def pose_of(motion: RigidMotion, time: float) -> Pose:
    """The pose at a time [s]; from a moment on velocities are those that follow it."""
    center = np.asarray(motion.center)
    if isinstance(motion, SteadyMotion):
        velocity, spin = np.asarray(motion.velocity), np.asarray(motion.angular_velocity)
        elapsed = min(max(time - motion.start, 0.0), motion.end - motion.start)
        moving = float(motion.start <= time < motion.end)
        return Pose(
            center=center,
            place=center + velocity * elapsed,
            rotation=rotation_matrix(spin * elapsed),
            velocity=moving * velocity,
            angular_velocity=moving * spin,
        )
    return _between(motion, center, time)


def _between(motion: KeyframedMotion, center: Array, time: float) -> Pose:
    still = np.zeros(3)
    row = bisect_right(motion.times, time) - 1
    if row < 0 or row == len(motion.times) - 1:
        end = max(row, 0)
        return Pose(
            center=center,
            place=np.asarray(motion.places[end]),
            rotation=rotation_matrices([motion.quaternions[end]])[0],
            velocity=still,
            angular_velocity=still,
        )
    span = motion.times[row + 1] - motion.times[row]
    elapsed = time - motion.times[row]
    place = np.asarray(motion.places[row])
    velocity = (np.asarray(motion.places[row + 1]) - place) / span
    spin = _turn(motion.quaternions[row], motion.quaternions[row + 1]) / span
    return Pose(
        center=center,
        place=place + velocity * elapsed,
        rotation=rotation_matrix(spin * elapsed) @ rotation_matrices([motion.quaternions[row]])[0],
        velocity=velocity,
        angular_velocity=spin,
    )


def _turn(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> Array:
    """The shorter way from one orientation to the other, as an axis by an angle [rad], in the scene's frame."""
    a, b = (np.asarray(quaternion) / np.linalg.norm(quaternion) for quaternion in (one, other))
    w = a @ b
    axis = a[0] * b[1:] - b[0] * a[1:] - np.cross(b[1:], a[1:])
    if w < 0:
        w, axis = -w, -axis
    sine = float(np.linalg.norm(axis))
    return axis * (2 * np.arctan2(sine, w) / sine) if sine > 0 else np.zeros(3)


def starts_of(motion: RigidMotion) -> float:
    """When it begins to move [s]."""
    return motion.start if isinstance(motion, SteadyMotion) else motion.times[0]


def abrupt_times(motion: RigidMotion, way: float, reach: float) -> list[float]:
    """Moments [s] across which no step may stretch, rising: before and after more than a `way` [m] between two moments.

    Parameters
    ----------
    motion
        Steady ones begin and end abruptly.
    way
        That may be passed over [m].
    reach
        How far matter is from the center at the most, for what turns [m].
    """
    if isinstance(motion, SteadyMotion):
        return [motion.start, *([motion.end] if math.isfinite(motion.end) else [])]
    # All at once, of half a million moments too: unit quaternions of a turn by t are 2 sin(t / 4) apart, or their
    # opposites are.
    quaternions = np.array(motion.quaternions)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    one, other = quaternions[:-1], quaternions[1:]
    apart = np.minimum(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1))
    turns = 4 * np.arcsin(np.minimum(apart / 2, 1.0))
    ways = np.linalg.norm(np.diff(np.array(motion.places), axis=0), axis=1) + reach * turns
    far = np.flatnonzero(ways > way)
    return [motion.times[row] for row in np.union1d(far, far + 1)]
