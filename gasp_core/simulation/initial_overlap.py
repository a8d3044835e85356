"""Matter that starts within a collider: what a user has to be told of it, as a picture may not show it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, PointProblem, Rigid, Side, SignedDistanceField
from gasp_core.stepping.body_shape import body_shapes
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["rigid_bodies_overlap", "starts_inside"]

Array = NDArray[Any]

_DEPTH = 0.5
"""In cells: how far inside a collider a point may start. Walls act at nodes, and nodes are felt no finer."""


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
                rigid = all(isinstance(problem.materials[row], Rigid) for row in np.unique(points.material_ids[own]))
                then = (
                    "it is pushed out, slowly, and may tilt by that"
                    if rigid
                    else "they stay there, or leave, and are not pushed out"
                )
                yield (
                    int(body),
                    f"{int(inside.sum()):,} points, {share:.3g} % of its mass, start inside {name}{kind}, the deepest"
                    f" by {depth.max():.3g} m: {then}; move the object or the collider if that shows",
                )


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
        if not all(isinstance(problem.materials[row], Rigid) for row in np.unique(points.material_ids[own])):
            continue
        places = points.reference_positions[own]
        if any((_room(collider, places) < 0).any() for collider in problem.colliders):
            return True
        corners = [places - half[own], places + half[own]]
        if problem.colliders or int(body) in known:
            surface, slacks = _surface(problem, own, known.get(int(body)))
            if any((_room(collider, surface) < -slacks).any() for collider in problem.colliders):
                return True
            corners.append(surface)
        reached = np.concatenate(corners)
        boxes.append((reached.min(axis=0), reached.max(axis=0)))
    return any(
        bool((low < other_high).all() and (other_low < high).all())
        for (low, high), (other_low, other_high) in itertools.combinations(boxes, 2)
    )


def _surface(problem: PointProblem, rows: Array, known: SignedDistanceField | None) -> tuple[Array, Array]:
    """Places (S, 3) [m] on the surface of the rigid body of the points `rows`, and by how much (S,) [m] each may be in
    a collider before it is pushed out."""
    # Only where something is rigid: what it imports takes half a second.
    from gasp_core.stepping.rigid.contacts import SLACK
    from gasp_core.stepping.rigid.surfaces import RigidSurfaces, cubes_field

    field = cubes_field(problem.points, rows) if known is None else known
    surfaces = RigidSurfaces.of([field], problem.points.reference_positions[rows[:1]])
    return surfaces.samples, SLACK * surfaces.reaches


def _room(collider: Collider, positions: Array) -> Array:
    """Signed distances (N,) [m] of positions (N, 3) [m] to where a collider is at the start; negative in it."""
    places = positions if collider.motion is None else pose_of(collider.motion, 0.0).before(positions)
    return (1.0 if collider.side is Side.OUTSIDE else -1.0) * collider.shape.signed_distance(places)
