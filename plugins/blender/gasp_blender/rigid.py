"""Rigid bodies in motion: points ride on convex pieces in Blender's Bullet world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.bullet import RigidWorld
from gasp_blender.colliders import wall_of
from gasp_blender.impulses import Struck
from gasp_blender.initial_overlap import Pieces, collision_layers, depths_between, overlapping
from gasp_blender.kinematic_constraints import at_start, pose, rigid_motion
from gasp_core.contract import (
    ContactCondition,
    Driven,
    HalfSpace,
    Impulse,
    Pinned,
    PointProblem,
    Rigid,
    Side,
    SphereShape,
    Wind,
)
from gasp_core.errors import SceneError
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.checkpoint import checkpoint_arrays
from gasp_core.stepping.convex_pieces import convex_pieces

__all__ = ["LONGEST_STEP", "RigidBodies", "rigid_rows"]

Array = NDArray[Any]

LONGEST_STEP = 1 / 240
"""Of Bullet [s]: contact is found at the end of a step, as deep as the body flew within one."""
_DIRECTIONS = 2000
"""In which the farthest point of a body is looked for: they span its hull."""
_PIECES = 128
"""Convex bodies that a body of known shape is made of, at most: statues then go beyond their surface by a voxel."""
_INTO_WALLS = 1e-3
"""Of its size, how deep a body may start in a wall that it touches as the others do."""
_TURN = 0.5
"""By which a body is led at most, in radians and in its own sizes: the larger, the less float32 rounds a velocity."""


def rigid_rows(problem: PointProblem) -> Array:
    """Rows of points of a rigid material."""
    kinds = np.array([isinstance(material, Rigid) for material in problem.materials])
    return np.flatnonzero(kinds[problem.points.material_ids])


class RigidBodies:
    """All rigid bodies of a problem.

    Parameters
    ----------
    problem, rows
        What is simulated, and the rows of their points.
    struck
        What impulses strike.
    longest_step
        Of all steps [s].

    Raises
    ------
    SceneError
        Where the scene asks of them what Bullet does not do.
    """

    def __init__(self, problem: PointProblem, rows: Array, struck: Struck, longest_step: float) -> None:
        _refuse(problem)
        self._problem = problem
        self._struck = struck
        points = problem.points
        bodies = points.body_ids[rows]
        self._groups = [np.flatnonzero(bodies == body) for body in np.unique(bodies)]
        self._rest = points.reference_positions[rows]
        masses, velocities = problem.masses[rows], points.initial_velocities[rows]
        self._masses = masses
        sides = np.cbrt(points.reference_volumes[rows])
        self._origin = (self._rest.min(axis=0) + self._rest.max(axis=0)) / 2
        self._length = max(float(np.ptp(self._rest[own], axis=0).max() + sides[own].max()) for own in self._groups)
        self._centers = np.array([np.average(self._rest[own], axis=0, weights=masses[own]) for own in self._groups])
        # A frame may not be shorter than half a microsecond.
        self._unit = min(1.0, longest_step / LONGEST_STEP)
        self._world = RigidWorld(np.asarray(problem.gravity) * self._unit**2 / self._length)
        count = len(self._groups)
        self._speeds, self._spins = np.zeros((count, 3)), np.zeros((count, 3))
        shapes = body_shapes(problem)
        self._pieces: list[list[Array]] = []
        for number, (own, center) in enumerate(zip(self._groups, self._centers)):
            arms = self._rest[own] - center
            self._speeds[number], self._spins[number] = _rigid_velocity(arms, masses[own], velocities[own])
            shape = shapes.get(int(bodies[own[0]]))
            if shape is None:
                self._pieces.append([_hull(arms, float(sides[own].mean()) / 2)])
            else:
                self._pieces.append([piece - center for piece in convex_pieces(shape, _PIECES)])
        self._hulls = [np.concatenate(pieces) for pieces in self._pieces]
        places = [[piece + center for piece in pieces] for pieces, center in zip(self._pieces, self._centers)]
        inside = overlapping(places, _directions())
        self.told = _told(inside, [int(bodies[own[0]]) for own in self._groups])
        walls, touching = self._walls(problem, places)
        layers = collision_layers(
            np.block([[~inside, touching], [touching.T, np.ones((len(walls), len(walls)), bool)]])
        )
        for (wall, friction), own_layers in zip(walls, layers[count:]):
            self._world.add_wall([(piece - self._origin) / self._length for piece in wall], friction, own_layers)
        for number, (own, center) in enumerate(zip(self._groups, self._centers)):
            self._world.add_body(
                [piece / self._length for piece in self._pieces[number]],
                (center - self._origin) / self._length,
                float(masses[own].sum()),
                layers[number],
            )
        self._poses = np.tile(np.eye(4), (count, 1, 1))
        self._poses[:, :3, 3] = (self._centers - self._origin) / self._length
        self._held = np.zeros(count, dtype=bool)
        # By drive and body: where its centre was and how it was turned when the drive took hold of it.
        self._grips: dict[tuple[int, int], tuple[Array, Array]] = {}
        # By body: where its centre was and how it was turned when it touched what is sticky.
        self._stuck: dict[int, tuple[Array, Array]] = {}
        self._throw()
        self._start = self._poses
        self._steps: list[tuple[float, float, float]] = []

    def step(self, now: float, end: float, step: float) -> bool:
        """From `now` to `end` [s]; False where Blender's state is not finite."""
        pushed = self._push(now, step)
        goals = self._goals(now, end)
        held = np.isin(np.arange(len(self._groups)), list(goals))
        if pushed or (held != self._held).any():
            self._held = held
            self._throw()
        for number, (center, turn, _, _) in goals.items():
            goal = np.eye(4)
            goal[:3, :3], goal[:3, 3] = turn, (center - self._origin) / self._length
            self._world.lead(number, goal)
        before, after = self._poses, self._world.step(step / self._unit)
        if not np.isfinite(after).all():
            return False
        # Bullet moves a body by the velocity it has at the end of a step, so the difference is that velocity.
        self._speeds = (after[:, :3, 3] - before[:, :3, 3]) * (self._length / step)
        turns = after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1)
        twist = np.stack(
            [turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]]
        )
        sine = np.linalg.norm(twist, axis=0) / 2
        self._spins = (twist / 2 / np.sinc(np.arcsin(np.minimum(sine, 1.0)) / np.pi) / step).T
        for number, (_, _, speed, spin) in goals.items():
            self._speeds[number], self._spins[number] = speed, spin
        self._poses = after
        self._steps.append((now, end, step))
        return True

    def _walls(self, problem: PointProblem, bodies: Sequence[Pieces]) -> tuple[list[tuple[Pieces, float]], Array]:
        """Convex pieces [m] and friction of each wall, and which bodies touch it, (B, W) bool."""
        normals = [collider.shape.normal for collider in problem.colliders if isinstance(collider.shape, HalfSpace)]
        planes = np.array(normals, dtype=float).reshape(-1, 3)
        directions = np.concatenate([_directions(), -np.eye(3), planes, -planes])
        sizes = np.array([np.ptp(hull, axis=0).max() for hull in self._hulls])
        walls: list[tuple[Pieces, float]] = []
        touching: list[Array] = []
        for collider in problem.colliders:
            hollow = isinstance(collider.shape, SphereShape) and collider.side is Side.INSIDE
            if hollow and collider.contact is ContactCondition.STICK:
                # Bullet has no inside of a ball; what is in this one has only to be seen to touch it.
                continue
            for wall in wall_of(collider, self._length):
                depths, ways = depths_between(bodies, [wall], directions)
                deep = depths[:, 0] > _INTO_WALLS * sizes
                if not deep.all():
                    walls.append((wall, collider.friction))
                    touching.append(~deep)
                for body in np.flatnonzero(deep):
                    # The direction leads from the body into the wall.
                    back = directions[ways[body, 0]] * depths[body, 0]
                    walls.append(([piece + back for piece in wall], collider.friction))
                    touching.append(np.arange(len(bodies)) == body)
        return walls, np.array(touching, dtype=bool).reshape(-1, len(bodies)).T

    def _throw(self) -> None:
        """Have Bullet start from the poses and velocities that bodies have now."""
        speeds, spins = self._speeds * self._unit / self._length, self._spins * self._unit
        fastest = max(float(np.linalg.norm(vectors, axis=1).max()) for vectors in (speeds, spins))
        lead = min(_TURN / fastest, 1.0) if fastest > 0 else 1.0
        self._poses = self._world.throw(self._poses, speeds, spins, self._held, lead)

    def _push(self, now: float, step: float) -> bool:
        """Impulses that start now, and what wind does within a step; whether there was any."""
        impulses = [
            (number, drive)
            for number, drive in enumerate(self._problem.drives)
            if isinstance(drive, Impulse) and drive.start == now
        ]
        winds = [wind for wind in self._problem.force_fields if isinstance(wind, Wind) and wind.start <= now < wind.end]
        if not (impulses or winds):
            return False
        places, velocities = self.positions(), self.velocities()
        for number, impulse in impulses:
            kick = self._struck.kick(number, impulse)
            velocities[impulse.region.signed_distance(places) <= 0] += kick
        for wind in winds:
            taken = np.full(len(places), -np.expm1(-wind.drag * step))
            if wind.region is not None:
                taken[wind.region.signed_distance(places) > 0] = 0.0
            velocities += taken[:, None] * (np.asarray(wind.velocity) - velocities)
        for number, own in enumerate(self._groups):
            arms = places[own] - np.average(places[own], axis=0, weights=self._masses[own])
            self._speeds[number], self._spins[number] = _rigid_velocity(arms, self._masses[own], velocities[own])
        return True

    def _stick(self) -> None:
        """Bodies that touch a sticky collider stay as they are then."""
        for collider in self._problem.colliders:
            if collider.contact is not ContactCondition.STICK:
                continue
            sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
            for number, hull in enumerate(self._hulls):
                center = self._poses[number, :3, 3] * self._length + self._origin
                turn = self._poses[number, :3, :3]
                distance = sign * collider.shape.signed_distance(center + hull @ turn.T).min()
                if number not in self._stuck and distance <= _INTO_WALLS * np.ptp(hull, axis=0).max():
                    self._stuck[number] = center, turn

    def _goals(self, now: float, end: float) -> dict[int, tuple[Array, Array, Array, Array]]:
        """By body that is held: centre [m], turn (3, 3), velocity and angular velocity at the end of a step.

        A body is held as a whole with any point of it, by the last drive of several; and by what it has stuck to.
        """
        self._stick()
        still = np.zeros(3)
        found = {number: (center, turn, still, still) for number, (center, turn) in self._stuck.items()}
        places: Array | None = None
        for index, drive in enumerate(self._problem.drives):
            if not isinstance(drive, (Pinned, Driven)):
                continue
            if not drive.start <= now < drive.end:
                self._grips = {key: grip for key, grip in self._grips.items() if key[0] != index}
                continue
            places = self.positions() if places is None else places
            inside = drive.region.signed_distance(at_start(drive, now, places)) <= 0
            for number, own in enumerate(self._groups):
                if (index, number) not in self._grips:
                    if not inside[own].any():
                        continue
                    center = at_start(drive, now, self._poses[number][None, :3, 3] * self._length + self._origin)
                    self._grips[index, number] = center, pose(drive, now)[0].T @ self._poses[number, :3, :3]
                center, turn = self._grips[index, number]
                later, speed = rigid_motion(drive, end, center)
                total, spin = pose(drive, end)
                found[number] = later[0], total @ turn, speed[0], spin
        return found

    def positions(self) -> Array:
        """Of the points (N, 3) [m]."""
        places = np.empty_like(self._rest)
        for own, center, start, now in zip(self._groups, self._centers, self._start, self._poses):
            turn = now[:3, :3] @ start[:3, :3].T
            shift = (now[:3, 3] - start[:3, 3]) * self._length
            arms = self._rest[own] - center
            places[own] = self._rest[own] + shift + arms @ (turn - np.eye(3)).T
        return places

    def velocities(self) -> Array:
        """Of the points (N, 3) [m/s]."""
        velocities, positions = np.empty_like(self._rest), self.positions()
        for number, own in enumerate(self._groups):
            center = self._centers[number] + (self._poses[number] - self._start[number])[:3, 3] * self._length
            velocities[own] = self._speeds[number] + np.cross(self._spins[number], positions[own] - center)
        return velocities

    def keep(self) -> dict[str, Array]:
        """The steps taken: Bullet shows no velocities, but takes the same steps to the same bits."""
        return {"rigid_steps": np.array(self._steps).reshape(-1, 3), "struck": self._struck.masses.copy()}

    def restore(self, kept: Mapping[str, Array]) -> None:
        """Take the steps of `keep` again.

        Raises
        ------
        SceneError
            Where it is of another scene.
        """
        count = np.size(kept.get("rigid_steps", ())) // 3
        expected = {"rigid_steps": (count, 3), "struck": self._struck.masses.shape}
        arrays = checkpoint_arrays(kept, expected, "blender", may_be_nan=("struck",))
        steps, struck = arrays["rigid_steps"], arrays["struck"]
        self._struck.masses[:] = struck
        for now, end, step in steps.tolist():
            self.step(now, end, step)

    def close(self) -> None:
        """Let go of Blender's scene."""
        self._world.close()


def _refuse(problem: PointProblem) -> None:
    for number, collider in enumerate(problem.colliders, start=1):
        if collider.contact is ContactCondition.SLIP:
            raise SceneError(
                f'blender\'s rigid bodies know no contact "slip" (collider {number}): use "separate" without friction'
            )


def _rigid_velocity(arms: Array, masses: Array, velocities: Array) -> tuple[Array, Array]:
    """Velocity (3,) and angular velocity (3,) of the rigid motion with the momenta of points about their centre."""
    mean = np.average(velocities, axis=0, weights=masses)
    momentum = (masses[:, None] * np.cross(arms, velocities - mean)).sum(axis=0)
    square = (masses * (arms**2).sum(axis=1)).sum() * np.eye(3)
    inertia = square - (masses[:, None, None] * arms[:, :, None] * arms[:, None, :]).sum(axis=0)
    # Points on a line have no inertia about it.
    return mean, np.linalg.pinv(inertia, rcond=1e-12, hermitian=True) @ momentum


def _told(inside: Array, bodies: list[int]) -> list[str]:
    """A line for the user where bodies, by their ids, start inside each other."""
    pairs = [f"{bodies[one]} and {bodies[other]}" for one, other in np.argwhere(np.triu(inside))]
    if not pairs:
        return []
    more = f" and {len(pairs) - 3} more pairs" if len(pairs) > 3 else ""
    return [
        f"the hulls of rigid bodies {', '.join(pairs[:3])}{more} start inside each other: these do not touch, as they"
        " would be thrown apart; move them apart if they should"
    ]


def _directions() -> Array:
    """Unit vectors in which the farthest points of a body are looked for, (D, 3), those of the axes among them."""
    drawn = np.random.default_rng(0).normal(size=(_DIRECTIONS, 3))
    return np.concatenate([drawn / np.linalg.norm(drawn, axis=1)[:, None], np.eye(3)])


def _hull(arms: Array, margin: float) -> Array:
    """Points that span the hull of what the points (N, 3) stand for, each a cube with half a side of `margin`."""
    directions = _directions()
    spanning = arms if len(arms) <= _DIRECTIONS else arms[np.unique((arms @ directions.T).argmax(axis=0))]
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * margin
    grown = (spanning[:, None] + corners).reshape(-1, 3)
    return grown[np.unique((grown @ directions.T).argmax(axis=0))]
