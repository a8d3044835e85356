"""Where rigid bodies touch walls and each other, or will within a step."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BodyContact, Collider, ContactCondition, PointProblem
from gasp_core.stepping.rigid.bodies import RigidBodies, RigidState, poses_of
from gasp_core.stepping.rigid.surfaces import RigidSurfaces, onto, unit
from gasp_core.stepping.rigid_motion import pose_of
from gasp_core.stepping.vectors import crossed, lengths
from gasp_core.stepping.walls import wall_distances, wall_surface

__all__ = ["CONDITIONS", "NO_BODY", "SLACK", "Contacts", "contacts_of", "relative_velocities"]

Array = NDArray[Any]

CONDITIONS = {ContactCondition.STICK: 0, ContactCondition.SLIP: 1, ContactCondition.SEPARATE: 2}
NO_BODY = -1
"""In place of a body: a wall."""
SLACK = 2e-3
"""Of a sample's reach: surfaces may overlap by so much."""
_NEAR = 0.05
"""Of a sample's reach: surfaces this near to each other are looked at, besides those that may meet within the step."""
_CLOSER = 2
_FLAT = 30.0
"""Times a sample's reach: what is bent by less is a face. A ball has 8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contacts:
    """Places where two surfaces are near each other, C of them.

    Parameters
    ----------
    first, second : (C,)
        Rigid bodies, `second` being `NO_BODY` where the other surface is a wall's.
    others : (C,)
        Whose the other surface is: bodies, and behind them the walls.
    places : (C, 3) [m]
    normals : (C, 3)
        From the second to the first.
    gaps : (C,) [m]
        Between the surfaces, negative where they overlap.
    slacks : (C,) [m]
        By how much they may overlap before they are moved apart.
    nears : (C,) [m]
        Nearer than this they touch.
    velocities : (C, 3) [m/s]
        Of the wall; zero between bodies.
    turns : (C, 3) [rad/s]
        Its angular velocity.
    conditions : (C,)
        As in `CONDITIONS`.
    frictions : (C,)
    restitutions : (C,)
    """

    first: Array
    second: Array
    others: Array
    places: Array
    normals: Array
    gaps: Array
    slacks: Array
    nears: Array
    velocities: Array
    turns: Array
    conditions: Array
    frictions: Array
    restitutions: Array

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All of them, in their order."""
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__})


def contacts_of(
    problem: PointProblem,
    walls: Sequence[Collider],
    bodies: RigidBodies,
    surfaces: RigidSurfaces,
    state: RigidState,
    angular_velocities: Array,
    time: float,
    step: float,
) -> Contacts:
    """What touches at `time` [s], or may do so within `step` [s]."""
    seen = _Seen(bodies, surfaces, state)
    speeds = lengths(state.velocities) + surfaces.radii * lengths(angular_velocities)
    found = [_none()]
    for body, (number, wall) in itertools.product(range(len(bodies)), enumerate(walls)):
        found.append(_with_wall(seen, body, wall, len(bodies) + number, time, step, speeds[body]))
    for first, second in itertools.combinations(range(len(bodies)), 2):
        apart = np.linalg.norm(state.places[first] - state.places[second])
        way = step * (speeds[first] + speeds[second])
        if apart < surfaces.radii[first] + surfaces.radii[second] + way:
            contact = problem.contact_between(int(bodies.bodies[first]), int(bodies.bodies[second]))
            found.append(_with_body(seen, first, second, contact, way))
            found.append(_with_body(seen, second, first, contact, way))
    return Contacts.joined(found)


def relative_velocities(contacts: Contacts, velocities: Array, centers: Array) -> Array:
    """Velocities (C, 3) [m/s] of the first surface over the second, of bodies with velocities (B, 6)."""
    found = _at(velocities, centers, contacts.first, contacts.places) - contacts.velocities
    bodies = contacts.second != NO_BODY
    found[bodies] -= _at(velocities, centers, contacts.second[bodies], contacts.places[bodies])
    return found


def _at(velocities: Array, centers: Array, bodies: Array, places: Array) -> Array:
    """Velocities (C, 3) [m/s] of what bodies (C,) have at places (C, 3) [m]."""
    own = velocities[bodies]
    return own[:, :3] + crossed(own[:, 3:], places - centers[bodies])


class _Seen:
    """Surfaces where the bodies are now."""

    def __init__(self, bodies: RigidBodies, surfaces: RigidSurfaces, state: RigidState) -> None:
        self.surfaces, self.restitutions = surfaces, bodies.restitutions
        self._poses = poses_of(bodies, state)

    def rows(self, body: int) -> slice:
        """Of a body's samples."""
        return slice(int(self.surfaces.sample_starts[body]), int(self.surfaces.sample_starts[body + 1]))

    def samples(self, body: int) -> tuple[Array, Array]:
        """Places (S, 3) [m] and normals (S, 3)."""
        rows, pose = self.rows(body), self._poses[body]
        places = (self.surfaces.samples[rows] - pose.center) @ pose.rotation.T + pose.place
        return places, self.surfaces.normals[rows] @ pose.rotation.T

    def distances(self, body: int, places: Array) -> tuple[Array, Array]:
        """Of places (K, 3) [m] to the surface, (K,) [m], and gradients (K, 3)."""
        return self.surfaces.seen(body, self._poses[body], places)

    def bends(self, body: int, rows: Array) -> Array:
        """Radii of curvature (K,) [m] at samples of a body."""
        return self.surfaces.bends[self.rows(body).start + rows]

    def onto(self, body: int, places: Array) -> Array:
        """Places (K, 3) [m] near a surface, brought onto it."""
        return onto(places, *self.distances(body, places))

    def ways(self, body: int, rows: Array, across: Array) -> tuple[Array, Array]:
        """How far (K,) [m] to where the surface faces a direction, per unit of what is across its normal (K, 3), and
        whether it goes on so from a sample (K,).

        A sample is seldom the place where a round body touches; what it knows of the bend says where that is.
        """
        length = lengths(across)
        reach = self.surfaces.reaches[self.rows(body).start + rows]
        most = reach / np.maximum(length, 1e-12)
        bends = self.bends(body, rows)
        return np.minimum(bends, most), bends <= most


def _with_wall(seen: _Seen, body: int, wall: Collider, number: int, time: float, step: float, speed: float) -> Contacts:
    places, normals = seen.samples(body)
    reaches = seen.surfaces.reaches[seen.rows(body)]
    rooms = wall_distances(wall, places, time)
    near = np.flatnonzero(rooms < reaches)
    if not len(near):
        return _none()
    outward, _ = wall_surface(wall, places[near], time)
    across = _across(-outward, normals[near])
    ways, within = seen.ways(body, near, across)
    flat = seen.bends(body, near) > _FLAT * reaches[near]
    foremost = seen.onto(body, places[near] + ways[:, None] * across)
    # Once more from there: the bend is not known to better than a twentieth.
    outward, _ = wall_surface(wall, foremost, time)
    _, slopes = seen.distances(body, foremost)
    left = _across(-outward, unit(slopes))
    foremost = seen.onto(body, foremost + np.minimum(ways, seen.ways(body, near, left)[0])[:, None] * left)
    gaps = wall_distances(wall, foremost, time)
    outward, own = wall_surface(wall, foremost, time)
    turns = np.zeros_like(own)
    if wall.motion is not None:
        pose = pose_of(wall.motion, time)
        turns += pose.angular_velocity
        if wall.contact is not ContactCondition.SEPARATE:
            # What holds on to it goes where it goes within the step (see `gasp_core.stepping.rigid.joints`).
            own += 0.5 * step * crossed(turns, own - pose.velocity)
    way = step * (speed + float(lengths(own).max()))
    # What is beyond the reach of a sample is within that of another one. Of what rolls it is the part that comes down
    # next: it is turned out of the way before it touches, which a step that goes straight on does not know.
    known = flat | within | (gaps < -SLACK * reaches[near])
    kept = _known(gaps < _NEAR * reaches[near] + way, known, gaps)
    return _made(
        body,
        NO_BODY,
        number,
        foremost[kept],
        outward[kept],
        gaps[kept],
        reaches[near][kept],
        own[kept],
        turns[kept],
        BodyContact(contact=wall.contact, friction=wall.friction),
        seen.restitutions[body],
    )


def _with_body(seen: _Seen, body: int, other: int, contact: BodyContact, way: float) -> Contacts:
    places, normals = seen.samples(body)
    reaches = seen.surfaces.reaches[seen.rows(body)]
    depth, slopes = seen.distances(other, places)
    near = np.flatnonzero(depth < reaches + way)
    if not len(near):
        return _none()
    places, normals, reaches = places[near], normals[near], reaches[near]
    flat = seen.bends(body, near) > _FLAT * reaches
    before = _across(-unit(slopes[near]), normals)
    ways, within = seen.ways(body, near, before)
    # On a face it is everywhere as far: it is asked at the sample.
    ways[flat] = 0.0
    first = seen.onto(body, places + ways[:, None] * before)
    # On the way there the other surface has turned, too: by a secant to where it faces this one, and on from there.
    after = _facing(seen, body, other, first)
    squares = np.sum(before * before, axis=1)
    change = squares - np.sum(before * after, axis=1)
    ways *= np.clip(np.where(change > 0, squares / np.where(change > 0, change, 1.0), 1.0), 0.0, 1.0)
    foremost = seen.onto(body, places + ways[:, None] * before)
    for _ in range(_CLOSER):
        left = _facing(seen, body, other, foremost)
        foremost = seen.onto(body, foremost + np.minimum(ways, seen.ways(body, near, left)[0])[:, None] * left)
    gaps, slopes = seen.distances(other, foremost)
    outward = unit(slopes)
    # A flat face says better than an edge that slides over it where the two are going.
    outward[flat] = -normals[flat]
    # What is beyond the reach of a sample is within that of another one.
    kept = _known(gaps < _NEAR * reaches + way, flat | within, gaps)
    zero = np.zeros((int(kept.sum()), 3))
    bounce = float(seen.restitutions[body] * seen.restitutions[other])
    return _made(
        body, other, other, foremost[kept], outward[kept], gaps[kept], reaches[kept], zero, zero, contact, bounce
    )


def _known(close: Array, known: Array, gaps: Array) -> Array:
    """Which (K,) of those that are close are known; the nearest one where none is.

    Samples lie up to two reaches apart in places: what touches between them is beyond the reach of all.
    """
    kept = close & known
    if close.any() and not kept.any():
        kept[np.where(close, gaps, np.inf).argmin()] = True
    return kept


def _facing(seen: _Seen, body: int, other: int, places: Array) -> Array:
    """What (K, 3) of the other surface's normals is across those of a body at places (K, 3) [m] on it."""
    _, one = seen.distances(body, places)
    _, two = seen.distances(other, places)
    return _across(-unit(two), unit(one))


def _across(vectors: Array, normals: Array) -> Array:
    """What of vectors (K, 3) is across unit normals (K, 3)."""
    return vectors - np.sum(vectors * normals, axis=1, keepdims=True) * normals


def _made(
    body: int,
    second: int,
    other: int,
    places: Array,
    normals: Array,
    gaps: Array,
    reaches: Array,
    velocities: Array,
    turns: Array,
    contact: BodyContact,
    restitution: float,
) -> Contacts:
    count = len(places)
    return Contacts(
        first=np.full(count, body),
        second=np.full(count, second),
        others=np.full(count, other),
        places=places,
        normals=normals,
        gaps=gaps,
        slacks=SLACK * reaches,
        nears=_NEAR * reaches,
        velocities=velocities,
        turns=turns,
        conditions=np.full(count, CONDITIONS[contact.contact]),
        frictions=np.full(count, contact.friction),
        restitutions=np.full(count, restitution),
    )


@cache
def _none() -> Contacts:
    nothing = np.zeros((0, 3))
    return _made(0, 0, 0, nothing, nothing, np.zeros(0), np.zeros(0), nothing, nothing, BodyContact(), 0.0)
