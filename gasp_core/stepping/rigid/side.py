"""A problem of rigid bodies and of others, taken apart: an engine steps the others as if they were alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, Field, Impulse, PointCloud, PointProblem, PointState, Trajectories
from gasp_core.stepping.forcing import bodies_held
from gasp_core.stepping.led_points import refuse_led_rigid_bodies
from gasp_core.stepping.mpm import HELD_TOGETHER
from gasp_core.stepping.rigid.bodies import rigid_bodies_of
from gasp_core.stepping.rigid.grid_nodes import GridNodes
from gasp_core.stepping.session import impulse_change
from gasp_core.stepping.tracer_bodies import tracer_bodies

__all__ = ["RigidSide"]

if TYPE_CHECKING:
    from gasp_core.stepping.rigid.nodes import NodeContacts
    from gasp_core.stepping.rigid.welds import Welds
    from gasp_core.stepping.rigid.world import RigidWorld

Array = NDArray[Any]

_HEAVIEST = 1e6
"""Times the mass of a rigid body, of a node that it meets: beside what is heavier nothing would be left of its own."""
_LED = 2.0**50
"""Times that: nodes that nothing moves, as they are led. None that has its weight from matter is so heavy."""
_LONGEST_STEP = 1e-3
"""[s] Contacts hold for a step: what rolls or rocks goes on as if they did not change in it."""
_FALL_SHARE = 3e-2
"""Of sqrt(r / g) for the radius r of the smallest body: small ones fall past themselves, and rock, as fast as that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidSide:
    """The rigid bodies of a problem, and what is left of it without them.

    Parameters
    ----------
    problem
        All of it.
    world
        The rigid bodies.
    soft
        The problem without them; None where nothing else is in it.
    soft_rows : (N',)
        Of its points in the whole cloud.
    soft_bodies : (B',)
        Numbers of its bodies in the whole cloud.
    tracer_owners : (M,)
        Which rigid body carries each tracer, as they are counted in `world`; -1 for none.
    welds
        Of rigid bodies that are parts of others.
    """

    problem: PointProblem
    world: RigidWorld
    soft: PointProblem | None
    soft_rows: Array
    soft_bodies: Array
    tracer_owners: Array
    welds: Welds

    @classmethod
    def of(cls, problem: PointProblem, restart: Mapping[str, Array] | None, engine: str) -> Self | None:
        """Of a problem as it begins, or as `RigidWorld.checkpoint` gave it; None where nothing is rigid.

        Raises
        ------
        SceneError
            Where a body is rigid in part, or the checkpoint is of something else; `engine` is who says so.
        """
        bodies = rigid_bodies_of(problem)
        if bodies is None:
            return None
        refuse_led_rigid_bodies(problem)
        # Only where it is needed: what it imports takes half a second.
        from gasp_core.stepping.rigid.welds import Welds
        from gasp_core.stepping.rigid.world import RigidWorld

        world = RigidWorld.of(problem, bodies, restart, engine)
        rows = np.setdiff1d(np.arange(len(problem.points)), world.bodies.rows)
        carried = tracer_bodies(problem.points)
        place = np.searchsorted(world.bodies.bodies, carried)
        there = world.bodies.bodies[np.minimum(place, len(world.bodies) - 1)] == carried
        owners = np.where(there, place, -1)
        soft = _part(problem, rows, owners < 0) if len(rows) else None
        return cls(
            problem=problem,
            world=world,
            soft=soft,
            soft_rows=rows,
            soft_bodies=np.unique(problem.points.body_ids[rows]),
            tracer_owners=owners,
            welds=Welds.of(problem, world.bodies.bodies, rows, world.surfaces),
        )

    @property
    def longest_step(self) -> float:
        """What rolling and rocking bear [s], of bodies of any size."""
        gravity = math.hypot(*self.problem.gravity)
        if gravity == 0:
            return _LONGEST_STEP
        bodies = self.world.bodies
        # Of the ball that turns as easily: a pencil rolls by its thickness, not by its length.
        radius = math.sqrt(2.5 * float((bodies.moments.min(axis=1) / bodies.masses).min()))
        return min(_LONGEST_STEP, _FALL_SHARE * math.sqrt(radius / gravity))

    @property
    def box(self) -> tuple[Array, Array]:
        """Corners, (3,) [m] each, of a box that the rigid bodies are in."""
        places, radii = self.world.state.places, self.world.surfaces.radii[:, None]
        return (places - radii).min(axis=0), (places + radii).max(axis=0)

    def beside(self, low: Array, high: Array, stress: float) -> tuple[Array, Array, float]:
        """Corners (3,) [m] of the box of other matter, and the step [s] that its stress bears: with rigid bodies."""
        lower, upper = self.box
        return np.minimum(low, lower), np.maximum(high, upper), min(stress, self.longest_step)

    def bodies_held(self, drives: Sequence[Drive], time: float, positions: Array, spacing: float) -> Array:
        """Which bodies of `soft`, whose points are at positions (N', 3) [m], each drive holds: see
        `gasp_core.stepping.forcing.bodies_held`."""
        bodies = self.problem.points.body_ids
        found = bodies_held(drives, time, self.positions(positions), bodies, int(bodies.max()) + 1, spacing)
        return found[:, self.soft_bodies]

    def near(self, positions: Array, half_widths: Array, bodies: Array, spacing: float, origin: Array) -> NodeContacts:
        """Nodes where matter may touch a rigid body within a step.

        Parameters
        ----------
        positions, half_widths, bodies, spacing, origin
            Of points of `soft`: see `gasp_core.stepping.rigid.nodes.nodes_near`.
        """
        # Only where it is needed: what it imports takes half a second.
        from gasp_core.stepping.rigid.nodes import nodes_near

        # No point goes further than half a cell in a step; the body may come towards it as far.
        return nodes_near(
            self.world.surfaces,
            self.world.poses(),
            positions,
            half_widths,
            bodies,
            spacing,
            origin,
            spacing,
            self.welds.hosts,
        )

    def met(
        self,
        contacts: NodeContacts,
        velocities: Array,
        masses: Array,
        spacing: float,
        origin: Array,
        seams: Array,
        allowed: float,
    ) -> GridNodes:
        """The same nodes with what they have: velocities (K, 3) [m/s] and masses (K,) [kg].

        `seams` (S, 3) [m] are where the points beside welds are, `Welds.rows`, as a step begins that may be as long as
        `allowed` [s].
        """
        places = contacts.nodes * spacing + origin
        parts = np.where(contacts.welded, contacts.rigid, -1)
        own = self.world.bodies.masses[contacts.rigid]
        return GridNodes(
            rigid=contacts.rigid,
            others=self.soft_bodies[contacts.bodies],
            places=places,
            velocities=velocities,
            masses=np.minimum(masses, _HEAVIEST * own),
            led=masses > _LED * own,
            normals=contacts.normals,
            gaps=contacts.gaps,
            welded=contacts.welded,
            wanted=self.welds.wanted(self.world.poses(), seams, parts, places, allowed),
            held_together=HELD_TOGETHER * spacing,
        )

    def keep_out(
        self, velocities: Array, positions: Array, half_widths: Array, masses: Array, bodies: Array, step: float
    ) -> Array:
        """See `RigidWorld.keep_out`; `bodies` (N,) are counted as in `soft`."""
        whose = self.soft_bodies[bodies]
        return self.world.keep_out(velocities, positions, half_widths, masses, whose, step)

    def impulse(self, impulse: Impulse, positions: Array) -> tuple[Array, Array] | None:
        """What an impulse does to the points of `soft` at positions (N', 3) [m]: see `impulse_change`.

        The rigid bodies have taken their share when this returns.
        """
        whole = self.positions(positions)
        given = impulse_change(impulse, whole, self.problem.masses)
        if given is None:
            return None
        struck, change = given
        self.world.push(struck, change)
        return struck[self.soft_rows], change

    def positions(self, soft: Array) -> Array:
        """Of all points, (N, 3) [m], those of `soft` being at (N', 3)."""
        return self._whole(soft, self.world.state.positions(self.world.bodies))

    def state(self, time: float, fields: frozenset[Field], soft: PointState | None) -> PointState:
        """What is read of all points, `soft` being what is read of the others."""
        world = self.world
        state, bodies = world.state, world.bodies
        nothing = np.zeros((0, 3))
        velocities = deformations = tracers = None
        if Field.VELOCITIES in fields:
            own = nothing if soft is None or soft.velocities is None else soft.velocities
            velocities = self._whole(own, state.point_velocities(bodies))
        if Field.DEFORMATION_GRADIENTS in fields:
            turns = (state.rotations @ bodies.axes.transpose(0, 2, 1))[bodies.owners]
            own = soft.deformation_gradients if soft is not None else None
            deformations = self._whole(np.zeros((0, 3, 3)) if own is None else own, turns)
        if Field.TRACER_POSITIONS in fields and self.problem.points.tracer_positions is not None:
            tracers = self._tracers(None if soft is None else soft.tracer_positions)
        return PointState(
            time=time,
            positions=self.positions(nothing if soft is None else soft.positions),
            velocities=velocities,
            deformation_gradients=deformations,
            tracer_positions=tracers,
        )

    def _tracers(self, soft: Array | None) -> Array:
        places = np.array(self.problem.points.tracer_positions)
        if soft is not None:
            places[self.tracer_owners < 0] = soft
        for body, pose in enumerate(self.world.poses()):
            own = self.tracer_owners == body
            places[own] = (places[own] - pose.center) @ pose.rotation.T + pose.place
        return places

    def _whole(self, soft: Array, rigid: Array) -> Array:
        found = np.empty((len(self.problem.points), *rigid.shape[1:]))
        found[self.soft_rows], found[self.world.bodies.rows] = soft, rigid
        return found


def _led_of(problem: PointProblem, rows: Array) -> Trajectories | None:
    """The trajectories of a problem with other numbers of its points, those of `rows` (N',)."""
    led = problem.trajectories
    return None if led is None else replace(led, rows=np.searchsorted(rows, led.rows))


def _part(problem: PointProblem, rows: Array, traced: Array) -> PointProblem:
    """The problem of the points `rows` (N',) and the tracers `traced` (M,) of bool, its bodies counted anew."""
    points = problem.points
    bodies = np.unique(points.body_ids[rows])
    used = np.unique(points.material_ids[rows])
    numbers = {int(body): number for number, body in enumerate(bodies)}
    pairs = {
        (numbers[low], numbers[high]): contact
        for (low, high), contact in problem.pair_contacts.items()
        if low in numbers and high in numbers
    }
    cloud = PointCloud(
        reference_positions=points.reference_positions[rows],
        initial_velocities=points.initial_velocities[rows],
        reference_volumes=points.reference_volumes[rows],
        material_ids=np.searchsorted(used, points.material_ids[rows]),
        body_ids=np.searchsorted(bodies, points.body_ids[rows]),
        tracer_positions=None if points.tracer_positions is None else points.tracer_positions[traced],
        material_columns={name: column[rows] for name, column in points.material_columns.items()},
    )
    return replace(
        problem,
        points=cloud,
        rigid_parts={},
        trajectories=_led_of(problem, rows),
        materials=tuple(problem.materials[row] for row in used),
        pair_contacts=pairs,
    )
