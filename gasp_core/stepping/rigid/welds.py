"""Rigid parts of bodies that deform: the matter beside them goes with them, however it is pulled.

Nodes of the body in the part, and close to it, have the part's velocity, as in contact that sticks, and nobody asks how
wide the gap is. Velocities alone let go slowly all the same. Positions are their sums, and of what is
strained and crosses one cell after the other they do not add up to what the deformation gradients say: a rod welded to
a block, strained by a hundredth, is a seventh of a cell off it after four turns. So the points beside a seam know where
on the part they began, and the seam as a whole is brought back there, by impulses that the one gives and the other
takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.stepping.rigid.surfaces import RigidSurfaces
from gasp_core.stepping.rigid_motion import Pose

__all__ = ["NO_HOST", "Welds"]

Array = NDArray[Any]

NO_HOST = -1
_BESIDE = 1.0
"""Widths of points, from the surface of a part to their middles: the first layer of a lattice is half of one away, the
second one and a half."""
_BROUGHT_BACK = 0.05
"""Of what a seam is off by, in a step as long as it may be: slow beside sound, which takes a few steps through a cell,
and soon beside the swings of what hangs there."""
_THIN = 0.01
"""Of the widest extent of a seam: about what is narrower it is not turned."""
_AS_IT_BEGINS = Pose(
    center=np.zeros(3), place=np.zeros(3), rotation=np.eye(3), velocity=np.zeros(3), angular_velocity=np.zeros(3)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Welds:
    """The seams of B rigid bodies, of which some are parts of bodies that deform.

    Parameters
    ----------
    hosts : (B,)
        The body that each is a part of, among those that deform; `NO_HOST` for one of its own.
    rows : (S,)
        Points beside the seams, among those of bodies that deform.
    parts : (S,)
        Which rigid body they are beside.
    starts : (S, 3) [m]
        Where they are at the start.
    """

    hosts: Array
    rows: Array
    parts: Array
    starts: Array

    @classmethod
    def of(cls, problem: PointProblem, rigid: Array, soft_rows: Array, surfaces: RigidSurfaces) -> Self:
        """Those of a problem.

        Parameters
        ----------
        rigid : (B,)
            Numbers of its rigid bodies.
        soft_rows : (N',)
            Of its other points.
        surfaces
            Of the rigid bodies.
        """
        points = problem.points
        places, bodies = points.reference_positions[soft_rows], points.body_ids[soft_rows]
        widths = np.cbrt(points.reference_volumes[soft_rows])
        numbers = np.unique(bodies)
        hosts = np.full(len(rigid), NO_HOST)
        rows: list[Array] = []
        for part, host in _parts(problem.rigid_parts, rigid):
            hosts[part] = np.searchsorted(numbers, host)
            own = np.flatnonzero(bodies == host)
            depth, _ = surfaces.seen(part, _AS_IT_BEGINS, places[own])
            rows.append(own[depth < _BESIDE * widths[own]])
        joined = np.concatenate([*rows, np.zeros(0, dtype=np.int64)]).astype(np.int64)
        whose = np.repeat(np.flatnonzero(hosts != NO_HOST), [len(each) for each in rows])
        return cls(hosts=hosts, rows=joined, parts=whose, starts=places[joined])

    def wanted(self, poses: Sequence[Pose], positions: Array, rigid: Array, places: Array, allowed: float) -> Array:
        """Velocities (K, 3) [m/s] over those of their part that bring seams back, at nodes that are welded.

        Parameters
        ----------
        poses
            Of the rigid bodies.
        positions : (S, 3) [m]
            Where the points beside the seams are.
        rigid : (K,)
            Which body each node is welded to, -1 for none.
        places : (K, 3) [m]
            Of the nodes.
        allowed
            How long a step may be [s]. One that ends sooner, because something begins there, brings back as much less:
            else no speed would be enough.
        """
        found = np.zeros(places.shape)
        if not len(self.rows):
            return found
        for part in np.unique(self.parts):
            nodes, own, pose = np.flatnonzero(rigid == part), self.parts == part, poses[part]
            if len(nodes):
                targets = (self.starts[own] - pose.center) @ pose.rotation.T + pose.place
                shift, turn = _motion_between(positions[own], targets)
                x, y, z = turn
                across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
                way = shift + (places[nodes] - targets.mean(axis=0)) @ across.T
                found[nodes] = _BROUGHT_BACK / allowed * way
        return found


def _parts(rigid_parts: Mapping[int, int], rigid: Array) -> list[tuple[int, int]]:
    """Places among the rigid bodies, rising, and numbers of the bodies they are parts of."""
    return sorted((int(np.searchsorted(rigid, part)), host) for part, host in rigid_parts.items())


def _motion_between(positions: Array, targets: Array) -> tuple[Array, Array]:
    """A shift (3,) [m] and a small turn (3,) [rad] about the targets' mean that bring positions (S, 3) [m] nearest."""
    off = targets - positions
    shift, arms = off.mean(axis=0), targets - targets.mean(axis=0)
    spread = np.sum(arms**2) * np.eye(3) - arms.T @ arms
    product = arms.T @ (off - shift)
    # The sum of cross products.
    moment = np.array([product[1, 2] - product[2, 1], product[2, 0] - product[0, 2], product[0, 1] - product[1, 0]])
    return shift, np.linalg.pinv(spread, rcond=_THIN, hermitian=True) @ moment
