"""Cloth of the faces of a mesh."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gasp_core.contract import BoxShape, Collider, Field, HalfSpace, Impulse, Pinned, PointCloud, PointProblem
from gasp_core.errors import SceneError
from gasp_core.io.meshes import face_areas
from gasp_core.stepping.body_faces import BodyFaces

FLOOR = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
POSITIONS = frozenset({Field.POSITIONS})


def strip(across, along, side):
    """Equilateral triangles, in a plane upright: vertices (V, 3), faces (F, 3)."""
    row, column = np.divmod(np.arange(across * along), across)
    places = np.stack([side * (column + row % 2 / 2), 0.0 * row, side * np.sqrt(0.75) * row], axis=1)
    faces = []
    for r in range(along - 1):
        for c in range(across - 1):
            a, b = r * across + c, (r + 1) * across + c
            faces += [[a, a + 1, b + 1], [a, b + 1, b]] if r % 2 else [[a, a + 1, b], [a + 1, b + 1, b]]
    return places, np.array(faces)


def places_of_the_edge(faces):
    """Vertices of sides that belong to one face alone."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    found, counts = np.unique(sides, axis=0, return_counts=True)
    return found[counts == 1]


def sheet(kit, places, faces, thickness, **scene):
    area = face_areas(places, faces).sum()
    # The kit's points stand for the cubes of half a spacing.
    spacing = 2 * float(np.cbrt(area * thickness / len(places)))
    return kit.problem(places, spacing, hints=(BodyFaces(body=0, faces=faces),), **scene)


def swing(kit, places, *nets):
    """Half of how far the lower ends of strips [m] swing down, of which each is one body's rows and faces."""
    gravity = 0.02
    volumes = np.zeros(len(places))
    hints, bodies = [], np.zeros(len(places))
    for number, (rows, faces) in enumerate(nets):
        volumes[rows] = face_areas(places, faces).sum() * 0.01 / len(rows)
        bodies[rows] = number
        hints.append(BodyFaces(body=number, faces=faces))
    cloud = PointCloud(
        reference_positions=places,
        initial_velocities=np.zeros_like(places),
        reference_volumes=volumes,
        material_ids=np.zeros(len(places)),
        body_ids=bodies,
    )
    length = np.ptp(places[:, 2])
    top = BoxShape(center=(0.25, 0, length + 1), half_extents=(9, 9, 1.001))
    problem = PointProblem(
        points=cloud,
        materials=(kit.rubber,),
        gravity=(0, 0, -gravity),
        drives=(Pinned(region=top),),
        hints=tuple(hints),
    )
    period = 4 * length * np.sqrt(kit.rubber.density / kit.rubber.youngs_modulus)
    sunk = []
    with kit.open(problem, elastic="cloth") as session:
        for time in np.linspace(0, 0.75 * period, 301)[1:]:
            session.advance_to(time)
            fall = (places - session.read(POSITIONS).positions)[:, 2]
            sunk.append([fall[rows][places[rows, 2] < 1e-9].mean() for rows, _ in nets])
    static = kit.rubber.density * gravity * length**2 / (2 * kit.rubber.youngs_modulus)
    return np.max(sunk, axis=0) / 2 / static


@pytest.mark.parametrize(("jitter", "softer"), [(0.0, 0.02), (0.3, 0.25)])
def test_a_strip_of_triangles_hangs_as_long_as_young_says(kit, jitter, softer):
    """It swings by rho g L^2 / 2 E about where it would hang, so that its lowest place is twice as far down.

    Springs are as stiff as if all vertices went with the stretch. In a lattice they do, and two per cent are what steps
    damp; irregular ones find an easier way, so that such a net is softer, and never stiffer.
    """
    places, faces = strip(13, 29, 0.04)
    inner = np.setdiff1d(faces, places_of_the_edge(faces))
    shift = 0.04 * jitter * np.random.default_rng(0).uniform(-1, 1, (len(inner), 2))
    places[np.ix_(inner, [0, 2])] += shift
    (ratio,) = swing(kit, places, (np.arange(len(places)), faces))
    assert 0.98 <= ratio <= 1 + softer


def test_two_strips_of_other_triangles_hang_alike(kit):
    """Blender's cloth knows one mass and one length of springs for an object: each body is one."""
    coarse, coarse_faces = strip(7, 15, 0.08)
    fine, fine_faces = strip(13, 29, 0.04)
    places = np.concatenate([coarse, fine + [2.0, 0, 0]])
    rows = np.arange(len(places))
    first = len(coarse)
    ratios = swing(kit, places, (rows[:first], coarse_faces), (rows[first:], first + fine_faces))
    np.testing.assert_allclose(ratios, 1.0, atol=0.02)


def test_an_impulse_moves_all_vertices_alike(kit):
    places, faces = strip(9, 9, 0.05)
    problem = sheet(kit, places, faces, 0.02, gravity=(0, 0, 0))
    volumes = problem.points.reference_volumes * np.random.default_rng(1).uniform(0.2, 2, len(places))
    points = dataclasses.replace(problem.points, reference_volumes=volumes)
    everywhere = BoxShape(center=(0, 0, 0), half_extents=(9, 9, 9))
    mass = kit.rubber.density * volumes.sum()
    struck = dataclasses.replace(
        problem, points=points, drives=(Impulse(region=everywhere, impulse=(0, mass, 0), start=0.0),)
    )
    with kit.open(struck, elastic="cloth") as session:
        session.advance_to(0.01)
        np.testing.assert_allclose(session.read(POSITIONS).positions - places, [[0, 0.01, 0]] * len(places), atol=1e-6)


def test_a_bent_sheet_falls_flat_and_lies_upon_the_floor(kit):
    """A roof: no cloth of quads could be had of it. Its middle rests at half of its thickness."""
    places, faces = strip(9, 9, 0.05)
    roof = np.stack([places[:, 0], places[:, 2], 0.2 - 0.6 * np.abs(places[:, 0] - 0.2)], axis=1)
    problem = sheet(kit, roof, faces, 0.02, colliders=(Collider(shape=FLOOR, friction=0.2),), gravity=(0, 0, -9.81))
    with kit.open(problem, elastic="cloth") as session:
        session.advance_to(1.0)
        heights = session.read(POSITIONS).positions[:, 2]
    assert heights.min() >= 0.01 - 1e-6
    assert np.median(heights) == pytest.approx(0.01, abs=2e-3)


def test_cloth_without_faces_has_to_be_flat(kit):
    places, faces = strip(9, 9, 0.05)
    roof = np.stack([places[:, 0], places[:, 2], 0.2 - 0.6 * np.abs(places[:, 0] - 0.2)], axis=1)
    with pytest.raises(SceneError, match="no sheet across an axis"):
        kit.open(kit.problem(roof, 0.05), elastic="cloth")
    with pytest.raises(SceneError, match="no points of it"):
        kit.open(kit.problem(roof, 0.05, hints=(BodyFaces(body=0, faces=faces + 1),)), elastic="cloth")


@pytest.mark.parametrize(
    ("faces", "said"),
    [([], "in no face"), ([[0, 1, 1], [1, 2, 3]], "three corners"), ([[0, 1, 2], [0, 2, 3]], "no area")],
)
def test_faces_that_are_no_sheet_are_refused(kit, faces, said):
    places = np.linspace(0, 1, 4)[:, None] * [1.0, 0, 0]
    hint = BodyFaces(body=0, faces=np.array(faces, dtype=int).reshape(-1, 3))
    with pytest.raises(SceneError, match=said):
        kit.open(kit.problem(places, 0.05, hints=(hint,)), elastic="cloth")
