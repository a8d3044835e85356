"""Where rigid bodies touch walls and each other, or will within a step."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import BodyContact, Collider, ContactCondition, PointProblem
from gasp_core.stepping.rigid.bodies import RigidBodies, RigidState
from gasp_core.stepping.rigid.surfaces import RigidSurfaces, distances
from gasp_core.stepping.walls import wall_distances, wall_surface

__all__ = ["CONDITIONS", "NO_BODY", "Contacts", "contacts_of"]

Array = NDArray[Any]

CONDITIONS = {ContactCondition.STICK: 0, ContactCondition.SLIP: 1, ContactCondition.SEPARATE: 2}
NO_BODY = -1
"""In place of a body: a wall."""
_NEAR = 0.05
"""Of a sample's reach: surfaces this near to each other are looked at, besides those that may meet within the step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contacts:
    """Places where two surfaces are near each other, C of them.

    Parameters
    ----------
    first, second : (C,)
        Rigid bodies, `second` being `NO_BODY` where the other surface is a wall's.
    places : (C, 3) [m]
    normals : (C, 3)
        From the second to the first.
    gaps : (C,) [m]
        Between the surfaces, negative where they overlap.
    slacks : (C,) [m]
        By how much they may overlap before they are moved apart.
    velocities : (C, 3) [m/s]
        Of the wall; zero between bodies.
    conditions : (C,)
        As in `CONDITIONS`.
    frictions : (C,)
    """

    first: Array
    second: Array
    places: Array
    normals: Array
    gaps: Array
    slacks: Array
    velocities: Array
    conditions: Array
    frictions: Array

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
    speeds = np.linalg.norm(state.velocities, axis=1) + surfaces.radii * np.linalg.norm(angular_velocities, axis=1)
    found = [_none()]
    for body, wall in itertools.product(range(len(bodies)), walls):
        found.append(_with_wall(seen, body, wall, time, step, speeds[body]))
    for first, second in itertools.combinations(range(len(bodies)), 2):
        apart = np.linalg.norm(state.places[first] - state.places[second])
        way = step * (speeds[first] + speeds[second])
        if apart < surfaces.radii[first] + surfaces.radii[second] + way:
            contact = problem.contact_between(int(bodies.bodies[first]), int(bodies.bodies[second]))
            found.append(_with_body(seen, first, second, contact, way))
            found.append(_with_body(seen, second, first, contact, way))
    return Contacts.joined(found)


class _Seen:
    """Surfaces where the bodies are now."""

    def __init__(self, bodies: RigidBodies, surfaces: RigidSurfaces, state: RigidState) -> None:
        self.surfaces = surfaces
        self._centers, self._places = bodies.centers, state.places
        # From the reference positions to now.
        self._turns = state.rotations @ bodies.axes.transpose(0, 2, 1)

    def rows(self, body: int) -> slice:
        """Of a body's samples."""
        return slice(int(self.surfaces.sample_starts[body]), int(self.surfaces.sample_starts[body + 1]))

    def samples(self, body: int) -> tuple[Array, Array]:
        """Places (S, 3) [m] and normals (S, 3)."""
        rows = self.rows(body)
        arms = self.surfaces.samples[rows] - self._centers[body]
        return arms @ self._turns[body].T + self._places[body], self.surfaces.normals[rows] @ self._turns[body].T

    def distances(self, body: int, places: Array) -> tuple[Array, Array]:
        """Of places (K, 3) [m] to the surface, (K,) [m], and gradients (K, 3)."""
        surfaces = self.surfaces
        before = (places - self._places[body]) @ self._turns[body] + self._centers[body]
        found = distances(
            surfaces.values,
            surfaces.starts[body],
            surfaces.shapes[body],
            surfaces.origins[body],
            surfaces.spacings[body],
            before,
        )
        return found[:, 0], found[:, 1:] @ self._turns[body].T

    def foremost(self, body: int, rows: Array, places: Array, normals: Array, towards: Array) -> Array:
        """Where the surface around samples is foremost in directions `towards` (K, 3), (K, 3) [m].

        A sample is seldom the place where a round body touches; what it knows of the bend says where that is.
        """
        across = towards - np.sum(towards * normals, axis=1, keepdims=True) * normals
        length = np.linalg.norm(across, axis=1)
        start = self.rows(body).start
        bend, reach = self.surfaces.bends[start + rows], self.surfaces.reaches[start + rows]
        way = np.minimum(bend, reach / np.maximum(length, 1e-12))
        moved = places + way[:, None] * across
        depth, slopes = self.distances(body, moved)
        return moved - (depth / np.maximum(np.sum(slopes**2, axis=1), 0.1))[:, None] * slopes


def _with_wall(seen: _Seen, body: int, wall: Collider, time: float, step: float, speed: float) -> Contacts:
    places, normals = seen.samples(body)
    reaches = seen.surfaces.reaches[seen.rows(body)]
    rooms = wall_distances(wall, places, time)
    near = np.flatnonzero(rooms < reaches)
    if not len(near):
        return _none()
    outward, own = wall_surface(wall, places[near], time)
    foremost = seen.foremost(body, near, places[near], normals[near], -outward)
    gaps = wall_distances(wall, foremost, time)
    outward, own = wall_surface(wall, foremost, time)
    way = step * (speed + float(np.linalg.norm(own, axis=1).max()))
    kept = gaps < _NEAR * reaches[near] + way
    return _made(
        body,
        NO_BODY,
        foremost[kept],
        outward[kept],
        gaps[kept],
        reaches[near][kept],
        own[kept],
        BodyContact(contact=wall.contact, friction=wall.friction),
    )


def _with_body(seen: _Seen, body: int, other: int, contact: BodyContact, way: float) -> Contacts:
    places, normals = seen.samples(body)
    reaches = seen.surfaces.reaches[seen.rows(body)]
    depth, slopes = seen.distances(other, places)
    near = np.flatnonzero(depth < reaches + way)
    if not len(near):
        return _none()
    foremost = seen.foremost(body, near, places[near], normals[near], -_unit(slopes[near]))
    gaps, slopes = seen.distances(other, foremost)
    kept = gaps < _NEAR * reaches[near] + way
    zero = np.zeros((int(kept.sum()), 3))
    return _made(body, other, foremost[kept], _unit(slopes[kept]), gaps[kept], reaches[near][kept], zero, contact)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


_SLACK = 2e-3
"""Of a sample's reach."""


def _made(
    body: int,
    other: int,
    places: Array,
    normals: Array,
    gaps: Array,
    reaches: Array,
    velocities: Array,
    contact: BodyContact,
) -> Contacts:
    count = len(places)
    return Contacts(
        first=np.full(count, body),
        second=np.full(count, other),
        places=places,
        normals=normals,
        gaps=gaps,
        slacks=_SLACK * reaches,
        velocities=velocities,
        conditions=np.full(count, CONDITIONS[contact.contact]),
        frictions=np.full(count, contact.friction),
    )


def _none() -> Contacts:
    nothing = np.zeros((0, 3))
    return _made(0, 0, nothing, nothing, np.zeros(0), np.zeros(0), nothing, BodyContact())
