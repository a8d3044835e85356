"""What a step has to leave of a cage's momenta: the forces between its nodes add up to nothing, and turn nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["rigid_share"]

Array = NDArray[Any]


def rigid_share(masses: Array, places: Array, missing: Array) -> Array:
    """Velocities (M, 3) of the rigid motion that takes up missing momentum, and missing angular momentum.

    A step solves linear equations, to a tolerance, in which cells have turned no further than at its start: the one
    leaves momentum undone, the other takes spin. As places end at x1 = x0 + h v1, velocities v1 at the end and c the
    centre of mass,

        sum m (x1 - c1) x v1 = sum m (x0 - c0) x v1,

    so that what is missing of either is linear in v1, and this rigid motion about x0 is all of it.

    Parameters
    ----------
    masses : (M,)
        Of the nodes; where these are damped, in proportion to velocities at the end of the step, m + h d instead of m.
    places : (M, 3)
        Before the step, from any point.
    missing : (M, 3)
        Momentum that each node had before the step, and got from outside, dampers included, less what it has now.
        Forces from node to node are in it as well, and cancel.
    """
    mass = masses.sum()
    arms = places - masses @ places / mass
    squares = arms.T @ (masses[:, None] * arms)
    inertia = np.trace(squares) * np.eye(3) - squares
    crossed = missing.T @ arms
    # What has shrunk to a line has no axis to take up spin about, and what is not finite is judged elsewhere.
    turns = np.linalg.det(inertia) > 0
    spin = np.linalg.solve(inertia, _vector(crossed.T - crossed)) if turns else np.zeros(3)
    # arms @ A = spin x arms.
    x, y, z = spin
    return missing.sum(axis=0) / mass + arms @ np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])


def _vector(skew: Array) -> Array:
    """Of an antisymmetric matrix sum (a b^T - b a^T), the vector sum a x b."""
    return np.array([skew[1, 2], skew[2, 0], skew[0, 1]])
