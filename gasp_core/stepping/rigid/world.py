"""The rigid bodies of a simulation: one step of them, with all that they meet."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    Collider,
    ContactCondition,
    DomainPolicy,
    HalfSpace,
    PointProblem,
)
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.forcing import walls_of
from gasp_core.stepping.rigid.bodies import RigidBodies, RigidState, driven_round, momenta_of, moved, poses_of
from gasp_core.stepping.rigid.contacts import CONDITIONS, Contacts, contacts_of
from gasp_core.stepping.rigid.forces import Holds, wind_momenta
from gasp_core.stepping.rigid.grid_nodes import NO_NODES, GridNodes
from gasp_core.stepping.rigid.joints import Joints
from gasp_core.stepping.rigid.solver import loaded, settle_nodes, share_of_change, solve
from gasp_core.stepping.rigid.surfaces import RigidSurfaces, rigid_surfaces_of, unit
from gasp_core.stepping.rigid.targets import bounce_shares, targets_of
from gasp_core.stepping.rigid_motion import Pose
from gasp_core.stepping.vectors import crossed, lengths
from gasp_core.stepping.walls import stopped

__all__ = ["RigidWorld"]

Array = NDArray[Any]

_PARTING, _STICKING = CONDITIONS[ContactCondition.SEPARATE], CONDITIONS[ContactCondition.STICK]
_ROUNDS = 60
"""Of contact with nodes, whose friction depends on what comes out."""
_SWINGING = 12
"""Rounds after which changes are made by half: friction that follows what bears it can swing with it."""
_SWEEPS = 200
_TOLERANCE = 1e-5
"""Of what gravity gives in a step."""
_RESTING = 4.0
"""Times what gravity gives in a step: what comes no faster does not bounce."""
_PUSHED_APART = 0.05
"""Of an overlap, in a step,"""
_PUSHING_SPEED = 0.5
"""and radii of the largest body, in a second: what begins deep in a wall comes out of it, but does not leap."""


class RigidWorld:
    """The rigid bodies of a problem.

    Parameters
    ----------
    problem
        What is simulated.
    bodies, surfaces
        Its rigid bodies.
    state
        Where they are.
    """

    def __init__(self, problem: PointProblem, bodies: RigidBodies, surfaces: RigidSurfaces, state: RigidState) -> None:
        self.bodies, self.surfaces, self.state = bodies, surfaces, state
        self._problem = problem
        domain = problem.domain
        edges = () if domain is None or domain.policy is not DomainPolicy.CLAMP else _edges(domain.lower, domain.upper)
        self._walls = [wall for collider in (*problem.colliders, *edges) for wall in walls_of(collider)]
        self._holds = Holds(problem, bodies)
        self._joints = Joints(len(bodies), len(self._walls))
        contacts = [
            [problem.contact_between(int(body), other) for body in bodies.bodies]
            for other in range(int(problem.points.body_ids.max()) + 1)
        ]
        self._conditions = np.array([[CONDITIONS[one.contact] for one in row] for row in contacts])
        self._frictions = np.array([[one.friction for one in row] for row in contacts])
        self._owed = np.zeros((len(bodies), 6))
        self._posed: tuple[RigidState, list[Pose]] | None = None

    @classmethod
    def of(cls, problem: PointProblem, bodies: RigidBodies, restart: Mapping[str, Array] | None, engine: str) -> Self:
        """The rigid bodies of a problem as it begins, or as `checkpoint` gave them.

        Raises
        ------
        SceneError
            Where the checkpoint is of something else; `engine` is who says so.
        """
        state = RigidState.at_rest(bodies, problem.points.initial_velocities[bodies.rows])
        world = cls(problem, bodies, rigid_surfaces_of(problem, bodies), state)
        if restart is not None:
            names = {f"rigid_{name}": getattr(state, name).shape for name in RigidState.__slots__}
            shapes = {f"rigid_{name}": array.shape for name, array in world._others().items()}
            kept = checkpoint_arrays(restart, {**names, **shapes}, engine)
            world.state = RigidState(**{name: kept[f"rigid_{name}"].copy() for name in RigidState.__slots__})
            world._owed, world._holds.kept = kept["rigid_owed"].copy(), kept["rigid_holds"].copy()
            world._joints.gaps = kept["rigid_joints"].copy()
        return world

    def checkpoint(self) -> dict[str, Array]:
        """All that changes."""
        kept = {f"rigid_{name}": getattr(self.state, name).copy() for name in RigidState.__slots__}
        return {**kept, **{f"rigid_{name}": array.copy() for name, array in self._others().items()}}

    def _others(self) -> dict[str, Array]:
        return {"owed": self._owed, "holds": self._holds.kept, "joints": self._joints.gaps}

    @property
    def fastest(self) -> float:
        """Bound on the speed of anything that is rigid [m/s]."""
        turning = lengths(self.state.angular_velocities(self.bodies))
        return float((lengths(self.state.velocities) + turning * self.surfaces.radii).max())

    def poses(self) -> list[Pose]:
        """Of the bodies, from the reference positions to where they are."""
        if self._posed is None or self._posed[0] is not self.state:
            self._posed = (self.state, poses_of(self.bodies, self.state))
        return self._posed[1]

    def keep_out(
        self, velocities: Array, positions: Array, half_widths: Array, masses: Array, others: Array, step: float
    ) -> Array:
        """Velocities (N, 3) [m/s] with which points of what flows do not enter rigid bodies, after their step.

        As walls keep them out; what the bodies take of the points' momentum acts on them in their next step.

        Parameters
        ----------
        velocities, positions : (N, 3) [m/s], [m]
            Positions are those before the step.
        half_widths : (N,) [m]
            Of what points stand for.
        masses : (N,) [kg]
        others : (N,)
            Whose points they are, as in `PointCloud.body_ids`.
        """
        velocities, poses = velocities.copy(), self.poses()
        for body, other in itertools.product(range(len(self.bodies)), np.unique(others)):
            pose = poses[body]
            reach = self.surfaces.radii[body] + 2 * float(half_widths.max(initial=0.0))
            near = np.flatnonzero((np.sum((positions - pose.place) ** 2, axis=1) < reach**2) & (others == other))
            own = pose.velocities(positions[near])
            depth, slopes = self.surfaces.seen(body, pose, positions[near] + step * own)
            contact = self._problem.contact_between(int(other), int(self.bodies.bodies[body]))
            room = depth - half_widths[near]
            left = own + stopped(velocities[near] - own, unit(slopes), room, step, contact.contact, contact.friction)
            taken = masses[near, None] * (velocities[near] - left)
            velocities[near] = left
            self._owed[body, :3] += taken.sum(axis=0)
            self._owed[body, 3:] += crossed(positions[near] - pose.place, taken).sum(axis=0)
        return velocities

    def push(self, struck: Array, change: Array) -> None:
        """Let points, (N,) of bool of the cloud, take `change` (3,) [m/s] of an impulse."""
        weights = np.where(struck[self.bodies.rows], self.bodies.point_masses, 0.0)
        given = momenta_of(self.bodies, self.state, weights[:, None] * change)
        velocities = self.state.velocities + given[:, :3] / self.bodies.masses[:, None]
        self.state = replace(self.state, velocities=velocities, spins=self.state.spins + given[:, 3:])

    def step(self, time: float, step: float, nodes: GridNodes = NO_NODES) -> Array:
        """Go `step` [s] on from `time` [s], and give the velocities (K, 3) [m/s] that nodes have after contact."""
        bodies, state = self.bodies, self.state
        count = len(bodies)
        rotations = state.rotations
        inertias = np.zeros((count, 6, 6))
        inertias[:, [0, 1, 2], [0, 1, 2]] = bodies.masses[:, None]
        inertias[:, 3:, 3:] = np.einsum("bij,bj,bkj->bik", rotations, bodies.moments, rotations)
        carried = np.concatenate([bodies.masses[:, None] * state.velocities, state.spins], axis=1)
        momenta = carried + self._owed
        self._owed = np.zeros_like(self._owed)
        momenta[:, :3] += step * bodies.masses[:, None] * np.asarray(self._problem.gravity)
        momenta += wind_momenta(self._problem, bodies, state, time, step)
        held, prescribed = self._holds.at(state, time, step)
        for body in held:
            inertias[body] = np.eye(6)
            momenta[body] = carried[body] = prescribed[body]
        both = np.linalg.solve(inertias, np.stack([carried, momenta], axis=-1))
        before, velocities = both[..., 0], both[..., 1]
        contacts = contacts_of(
            self._problem,
            self._walls,
            bodies,
            self.surfaces,
            replace(state, velocities=velocities[:, :3]),
            velocities[:, 3:],
            time,
            step,
        )
        largest = float(self.surfaces.radii.max())
        contacts = self._joints.holding(contacts, before, state.places, largest, step)
        velocities, after = self._met(contacts, nodes, inertias, momenta, before, velocities, held, step)
        # Those of bodies that are held are found where these are driven round.
        spins = np.einsum("bij,bj->bi", inertias[:, 3:, 3:], velocities[:, 3:])
        way = self._pushed_apart(contacts, inertias, held, step)
        going = moved(bodies, replace(state, velocities=velocities[:, :3], spins=spins), step)
        going = driven_round(bodies, state, going, held, velocities[:, 3:], step)
        self.state = self._within_domain(replace(going, places=going.places + way))
        return after

    def _within_domain(self, state: RigidState) -> RigidState:
        """The state with no point beyond the edge of a domain that holds matter within."""
        domain = self._problem.domain
        if domain is None or domain.policy is not DomainPolicy.CLAMP:
            return state
        positions, owners = state.positions(self.bodies), self.bodies.owners
        short, over = np.zeros((len(self.bodies), 3)), np.zeros((len(self.bodies), 3))
        np.maximum.at(short, owners, np.asarray(domain.lower) - positions)
        np.maximum.at(over, owners, positions - np.asarray(domain.upper))
        # Of a body that is larger than the domain the lower side is within.
        back = np.where(short > 0, short, -over)
        velocities = np.where(back * state.velocities < 0, 0.0, state.velocities)
        return replace(state, places=state.places + back, velocities=velocities)

    def _met(
        self,
        contacts: Contacts,
        nodes: GridNodes,
        own_inertias: Array,
        own_momenta: Array,
        start: Array,
        velocities: Array,
        held: Sequence[int],
        step: float,
    ) -> tuple[Array, Array]:
        """Velocities (B, 6) of bodies and (K, 3) [m/s] of nodes after contact.

        `start` has those when the step began, `velocities` those with what has acted since.
        """
        gravity, centers = float(np.linalg.norm(self._problem.gravity)), self.state.places
        tolerance = _TOLERANCE * step * max(gravity, 1e-3)
        targets = targets_of(contacts, start, velocities, centers, step, _RESTING * step * gravity)
        stopping, bouncing = np.zeros((len(contacts), 3)), np.zeros((len(contacts), 3))
        conditions = np.where(nodes.welded, _STICKING, self._conditions[nodes.others, nodes.rigid])
        frictions = self._frictions[nodes.others, nodes.rigid]
        apart = np.where(nodes.welded | (nodes.gaps <= nodes.held_together), 0.0, np.inf)
        rooms = np.where(conditions == _PARTING, np.maximum(nodes.gaps, 0.0) / step, apart)
        gates = np.zeros((len(nodes), 2))
        places = (nodes.rigid, nodes.places)
        # A gap that closes within the step is a node that comes so much faster: then nodes touch or they do not.
        # So is one that is to come back to where it was.
        closing = np.where(np.isfinite(rooms), rooms, 0.0)[:, None] * nodes.normals - nodes.wanted
        ways_of_nodes = (nodes.masses, nodes.normals, conditions, frictions)
        met = (nodes.velocities + closing, *ways_of_nodes, np.where(np.isfinite(rooms), 0.0, np.inf))
        before = found = velocities
        for turn in range(_ROUNDS + 1 if len(nodes) else 1):
            inertias, momenta = own_inertias.copy(), own_momenta.copy()
            if turn == _ROUNDS:
                # Whatever has come out by now, so energy does not rise.
                met = (nodes.velocities, *ways_of_nodes, rooms)
            loaded(inertias, momenta, centers, before, *places, *met, gates)
            inverses = np.linalg.inv(inertias)
            found = np.einsum("bij,bj->bi", inverses, momenta)
            for body in held:
                inverses[body], found[body] = 0.0, velocities[body]
            at = (contacts.first, contacts.second, contacts.places, targets.frames, targets.offsets)
            ways = (contacts.conditions, contacts.frictions)
            faster = found.copy()
            solve(inverses, found, centers, *at, targets.stopped, *ways, stopping, tolerance, _SWEEPS)
            if targets.bounce:
                solve(inverses, faster, centers, *at, targets.bounced, *ways, bouncing, tolerance, _SWEEPS)
                both, pushes = (found, faster), (stopping, bouncing)
                shares = bounce_shares(contacts, targets.frames, centers, held, start, both, pushes)
                found += shares[:, None] * (faster - found)
            change = found - before
            # The last change is made whole, so that bodies have lost what nodes get.
            if np.abs(change).max() * max(1.0, float(self.surfaces.radii.max())) <= tolerance:
                break
            # What contacts ask for holds from the second on, and so on the way; what bounces is not the least of all.
            share = 1.0 if turn <= _SWINGING else 0.5
            if turn > 0 and not targets.bounce:
                own = (own_inertias, own_momenta, centers, before, change)
                share *= share_of_change(*own, *places, *met)
            before = before + share * change
        after = met[0].copy()
        settle_nodes(centers, found, *places, after, nodes.normals, gates)
        # By how much it changes: what does not touch keeps what it has, however fast a gap would close in a short step.
        after = nodes.velocities + (after - met[0])
        after[nodes.led] = nodes.velocities[nodes.led]
        return found, after

    def _pushed_apart(self, contacts: Contacts, inertias: Array, held: Sequence[int], step: float) -> Array:
        """By how much (B, 3) [m] bodies are moved that overlap: no velocity comes of it."""
        way = np.zeros((len(self.bodies), 3))
        deep = np.flatnonzero((contacts.gaps < -contacts.slacks) & (contacts.conditions == _PARTING))
        if not len(deep):
            return way
        inverses = np.linalg.inv(inertias)
        # Straight, without a turn.
        inverses[:, 3:], inverses[:, :, 3:] = 0.0, 0.0
        for body in held:
            inverses[body] = 0.0
        moving = np.zeros((len(self.bodies), 6))
        most = _PUSHING_SPEED * step * float(self.surfaces.radii.max())
        wanted = np.minimum(_PUSHED_APART * (-contacts.gaps[deep] - contacts.slacks[deep]), most)
        frames = np.repeat(contacts.normals[deep, None], 3, axis=1)
        impulses = np.zeros((len(deep), 3))
        nothing = np.zeros(len(deep))
        solve(
            inverses,
            moving,
            self.state.places,
            contacts.first[deep],
            contacts.second[deep],
            contacts.places[deep],
            frames,
            np.zeros((len(deep), 3)),
            wanted,
            contacts.conditions[deep],
            nothing,
            impulses,
            1e-3 * float(wanted.max()),
            _SWEEPS,
        )
        return moving[:, :3]


def _edges(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> list[Collider]:
    """Walls along which bodies slip: the edge of a domain that holds matter within."""
    found: list[Collider] = []
    for axis in range(3):
        for point, sign in ((lower, 1.0), (upper, -1.0)):
            normal = tuple(sign * np.eye(3)[axis])
            found.append(Collider(shape=HalfSpace(point=point, normal=normal), contact=ContactCondition.SEPARATE))
    return found
