"""What acts on rigid bodies besides contact: wind, and drives that hold them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, Driven, PointProblem, Wind
from gasp_core.stepping.forcing import drives_at, force_fields_at, pose_of_drive, position_at_start
from gasp_core.stepping.rigid.bodies import RigidBodies, RigidState, momenta_of

__all__ = ["Holds", "wind_momenta"]

Array = NDArray[Any]


def wind_momenta(problem: PointProblem, bodies: RigidBodies, state: RigidState, time: float, step: float) -> Array:
    """Linear and angular momenta (B, 6) that wind gives in `step` [s] from `time` [s] on, about the centres of mass."""
    winds = [each for each in force_fields_at(problem.force_fields, time) if isinstance(each, Wind)]
    if not winds:
        return np.zeros((len(bodies), 6))
    positions, before = state.positions(bodies), state.point_velocities(bodies)
    speeds = before
    for wind in winds:
        # One after the other, as at nodes: all at once they would take more than there is.
        share = np.full(len(positions), step * wind.drag / (1 + step * wind.drag))
        if wind.region is not None:
            share = np.where(wind.region.signed_distance(positions) <= 0, share, 0.0)
        speeds = speeds + share[:, None] * (np.asarray(wind.velocity) - speeds)
    return momenta_of(bodies, state, bodies.point_masses[:, None] * (speeds - before))


class Holds:
    """Which bodies drives hold: those of which a point is in a drive's region, or was since the drive acts.

    Attributes
    ----------
    kept : (D, B)
        Of every drive and body: 1 where it holds it, 0 where not.
    """

    def __init__(self, problem: PointProblem, bodies: RigidBodies) -> None:
        self._problem, self._bodies = problem, bodies
        self.kept: Array = np.zeros((len(problem.drives), len(bodies)))
        arms = np.linalg.norm(bodies.arms, axis=1)
        self._radii = np.zeros(len(bodies))
        np.maximum.at(self._radii, bodies.owners, arms)

    def at(self, state: RigidState, time: float, step: float) -> tuple[list[int], Array]:
        """Those held at `time` [s], and velocities (B, 6) that they have for a `step` [s]; of several drives the last
        one counts."""
        prescribed = np.zeros((len(self._bodies), 6))
        held: set[int] = set()
        for number, drive in enumerate(self._problem.drives):
            if not drives_at([drive], time):
                continue
            self.kept[number, self._inside(drive, state, time)] = 1.0
            for body in np.flatnonzero(self.kept[number] > 0).tolist():
                held.add(body)
                prescribed[body] = 0.0
                if isinstance(drive, Driven):
                    pose = pose_of_drive(drive, time)
                    # A centre goes along its chord; turns are exact as they are.
                    prescribed[body, :3] = pose.during(step).velocities(state.places[body][None])[0]
                    prescribed[body, 3:] = pose.angular_velocity
        return sorted(held), prescribed

    def _inside(self, drive: Drive, state: RigidState, time: float) -> Array:
        """Which bodies (B,) of bool have a point in a drive's region."""
        bodies = self._bodies
        depths = drive.region.signed_distance(position_at_start(drive, time, state.places))
        inside = np.zeros(len(bodies), dtype=np.bool_)
        # This is asked in every step: of bodies out of reach no point is looked at. Fields know distances roughly only.
        close = depths <= 2 * self._radii
        if close.any():
            near = close[bodies.owners]
            positions = position_at_start(drive, time, state.positions(bodies)[near])
            inside[bodies.owners[near][drive.region.signed_distance(positions) <= 0]] = True
        return inside
