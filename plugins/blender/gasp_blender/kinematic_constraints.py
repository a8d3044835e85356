"""Drives that hold matter: which nodes they hold, and where these are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Driven, Pinned

__all__ = ["at_start", "held_nodes", "pose", "rigid_motion"]

Array = NDArray[Any]

_HALF = 0.5 - 1e-9
"""A node is held with half of its matter: one on the region's edge is, and the body is clamped at that edge."""


def held_nodes(
    drive: Pinned | Driven,
    now: float,
    grips: Array,
    places: Array,
    share_within: Callable[[Array], Array],
    positions: Array,
) -> tuple[Array, Array]:
    """Which nodes are held (V,), and where each was when the drive started [m], (V, 3), NaN for one that is free.

    What is once held stays so until the drive ends.
    """
    held = ~np.isnan(grips[:, 0])
    inside = drive.region.signed_distance(at_start(drive, now, positions)) <= 0
    fresh = (share_within(inside) >= _HALF) & ~held
    grips = grips.copy()
    grips[fresh] = at_start(drive, now, places[fresh])
    return held | fresh, grips


def at_start(drive: Pinned | Driven, now: float, places: Array) -> Array:
    """Where what is at `places` (P, 3) [m] was when the drive started, if it went with it."""
    back, _ = pose(drive, now)
    center = np.asarray(drive.center) if isinstance(drive, Driven) else np.zeros(3)
    return (places - center - _shift(drive, now)) @ back + center


def rigid_motion(drive: Pinned | Driven, now: float, starts: Array) -> tuple[Array, Array]:
    """Places [m] and velocities [m/s] of held nodes, from where they were at the drive's start (H, 3)."""
    if isinstance(drive, Pinned):
        return starts, np.zeros_like(starts)
    turn, spin = pose(drive, now)
    center = np.asarray(drive.center)
    arms = (starts - center) @ turn.T
    return center + _shift(drive, now) + arms, np.asarray(drive.velocity) + np.cross(spin, arms)


def _shift(drive: Pinned | Driven, now: float) -> Array:
    return np.asarray(drive.velocity) * (now - drive.start) if isinstance(drive, Driven) else np.zeros(3)


def pose(drive: Pinned | Driven, now: float) -> tuple[Array, Array]:
    """Rotation since the start, (3, 3), by Rodrigues' formula, and angular velocity [rad/s]."""
    spin = np.asarray(drive.angular_velocity) if isinstance(drive, Driven) else np.zeros(3)
    rate = float(np.linalg.norm(spin))
    if rate == 0.0:
        return np.eye(3), spin
    x, y, z = spin / rate
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = rate * (now - drive.start)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross, spin
