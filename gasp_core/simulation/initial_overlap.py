"""Matter that starts within a collider or another body: what a user has to be told of, as a picture may not show it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from gasp_core.contract import Collider, ContactCondition, PointCloud, PointProblem, Rigid, Side, SignedDistanceField
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.neighbours import point_distance
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["rigid_bodies_overlap", "starts_in_another", "starts_inside"]

Array = NDArray[Any]

_DEPTH = 0.5
"""In cells: how far inside a collider a point may start. Walls act at nodes, and nodes are felt no finer."""
_DEEP = 0.25
"""In cells: how far inside another body a point has to start."""
_NEAR = 0.75
"""In distances of points: no farther than that, along any axis, from the nearest one a place is in a body. A half would
do on a lattice; where points lie anyhow there are larger gaps."""
_AROUND = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_OFF = 1e-3
"""Of half a cube's width: what is no deeper in a collider lies on it."""


def starts_inside(problem: PointProblem, spacing: float, names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """For each body and each collider that it starts in: the body's number, and a sentence without its subject.

    It is told and not refused: a trained splat has a few points below any floor it is put on. Engines let nothing go
    further in. What is soft they do not throw out; rigid bodies come out, slowly: nothing of them can be left behind.

    Parameters
    ----------
    problem
        As an engine is given it.
    spacing
        Of its grid or cage [m].
    names
        Of its colliders, as a user would call them.
    """
    points, masses = problem.points, problem.masses
    for body in np.unique(points.body_ids):
        own = points.body_ids == body
        for name, collider in zip(names, problem.colliders):
            depth = -_room(collider, points.reference_positions[own])
            inside = depth > _DEPTH * spacing
            if inside.any():
                share = 100 * masses[own][inside].sum() / masses[own].sum()
                # Of a field the user knows the file, which the name leads to.
                kind = "" if isinstance(collider.shape, SignedDistanceField) else f" ({collider.shape.kind})"
                then = (
                    "it is pushed out, slowly, and may tilt by that"
                    if _is_rigid(problem, own)
                    else "they stay there, or leave, and are not pushed out"
                )
                yield (
                    int(body),
                    f"{int(inside.sum()):,} points, {share:.3g} % of its mass, start inside {name}{kind}, the deepest"
                    f" by {depth.max():.3g} m: {then}; move the object or the collider if that shows",
                )


def starts_in_another(problem: PointProblem, spacing: float, names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """For each two bodies of which one starts in the other: the number of the one that does so with more of its mass,
    and a sentence without its subject.

    Two that stick to each other may: they are one from there on. Sheets fill no cell and are in nobody's way.

    Parameters
    ----------
    problem
        As an engine is given it.
    spacing
        Of its grid or cage [m].
    names
        Of its bodies.
    """
    points, masses = problem.points, problem.masses
    numbers = np.unique(points.body_ids).tolist()
    rows = [np.flatnonzero(points.body_ids == body) for body in numbers]
    for one, other in itertools.combinations(range(len(rows)), 2):
        contact = problem.pair_contacts.get((numbers[one], numbers[other]), problem.body_contact)
        if contact.contact is ContactCondition.STICK:
            continue
        sides = [(one, other), (other, one)]
        inside = [
            _deep_within(points, rows[around], points.reference_positions[rows[own]], spacing) for own, around in sides
        ]
        shares = [
            100 * masses[rows[own]][found].sum() / masses[rows[own]].sum() for (own, _), found in zip(sides, inside)
        ]
        more = int(shares[1] > shares[0])
        if shares[more] > 0:
            own, around = sides[more]
            rigid = _is_rigid(problem, rows[own]) and _is_rigid(problem, rows[around])
            then = (
                "they are pushed apart, slowly, and may tilt by that"
                if rigid
                else "what is in each other stays so, or leaves, and is not pushed apart"
            )
            yield (
                numbers[own],
                f"{int(inside[more].sum()):,} points, {shares[more]:.3g} % of its mass, start inside object"
                f' "{names[numbers[around]]}": {then}; move one of the two if that shows',
            )


def _deep_within(points: PointCloud, rows: Array, places: Array, spacing: float) -> Array:
    """Which of places (M, 3) [m] are well within what the points `rows` fill, (M,)."""
    body = points.reference_positions[rows]
    deep = np.flatnonzero(_within(places, body.min(axis=0), body.max(axis=0)))
    if len(deep):
        apart = point_distance(body, points.reference_volumes[rows])
        near = _NEAR * apart
        low, high = places[deep].min(axis=0), places[deep].max(axis=0)
        tree = KDTree(body[_within(body, low - near - spacing, high + near + spacing)])
        # At least by as much as a half is exceeded: what touches is in nothing.
        for shift in max(_DEEP * spacing, (_NEAR - 0.5) * apart) * _AROUND:
            distances, _ = tree.query(places[deep] + shift, p=np.inf, distance_upper_bound=near)
            deep = deep[np.isfinite(distances)]
    inside = np.zeros(len(places), dtype=bool)
    inside[deep] = True
    return inside


def _within(positions: Array, low: Array, high: Array) -> Array:
    inside: Array = np.all((positions >= low) & (positions <= high), axis=1)
    return inside


def rigid_bodies_overlap(problem: PointProblem) -> bool:
    """Whether a rigid body may start inside a collider or another rigid one, out of which it will be pushed.

    Of colliders it is asked with the surface that touches them, which may be outside of all points. Boxes around bodies
    tell of two that they do not overlap; where the boxes do, the bodies may.
    """
    points = problem.points
    half = 0.5 * np.cbrt(points.reference_volumes)[:, None]
    known = body_shapes(problem)
    boxes: list[tuple[Array, Array]] = []
    for body in np.unique(points.body_ids):
        own = np.flatnonzero(points.body_ids == body)
        if not _is_rigid(problem, own):
            continue
        places = points.reference_positions[own]
        # Of what is known by its points the cubes that these stand for: making a surface of them would take as long as
        # all else of a start, and the engine makes it anyway.
        corners = (places[:, None] + half[own, None] * _CORNERS).reshape(-1, 3)
        surface, slacks = corners, np.repeat(_OFF * half[own, 0], len(_CORNERS))
        if int(body) in known:
            surface, slacks = _surface(known[int(body)], places[:1])
        for collider in problem.colliders:
            if (_room(collider, places) < 0).any() or (_room(collider, surface) < -slacks).any():
                return True
        reached = np.concatenate([corners, surface])
        boxes.append((reached.min(axis=0), reached.max(axis=0)))
    return any(
        bool((low < other_high).all() and (other_low < high).all())
        for (low, high), (other_low, other_high) in itertools.combinations(boxes, 2)
    )


def _is_rigid(problem: PointProblem, rows: Array) -> bool:
    """Whether some of the points, as rows or a mask, are of rigid matter alone."""
    return all(isinstance(problem.materials[row], Rigid) for row in np.unique(problem.points.material_ids[rows]))


def _surface(known: SignedDistanceField, center: Array) -> tuple[Array, Array]:
    """Places (S, 3) [m] on the surface of a rigid body about its centre (1, 3) [m], and by how much (S,) [m] each may
    be in a collider before it is pushed out."""
    # Only where something is rigid: what it imports takes half a second.
    from gasp_core.stepping.rigid.contacts import SLACK
    from gasp_core.stepping.rigid.surfaces import RigidSurfaces

    surfaces = RigidSurfaces.of([known], center)
    return surfaces.samples, SLACK * surfaces.reaches


def _room(collider: Collider, positions: Array) -> Array:
    """Signed distances (N,) [m] of positions (N, 3) [m] to where a collider is at the start; negative in it."""
    places = positions if collider.motion is None else pose_of(collider.motion, 0.0).before(positions)
    return (1.0 if collider.side is Side.OUTSIDE else -1.0) * collider.shape.signed_distance(places)
