"""Distances to triangles against closed forms; what encloses nothing."""

import numpy as np
import pytest

from gasp_core.contract import BoxShape, SphereShape
from gasp_core.errors import SceneError
from gasp_core.solid import mesh_distance
from gasp_core.solid.mesh_distance import field_of_mesh

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")

CELLS = 48
RADIUS = 0.2
BALL = SphereShape(center=(0.0, 0.0, 0.0), radius=RADIUS)


def ball(subdivisions=4):
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=RADIUS)
    return np.asarray(made.vertices), np.asarray(made.faces)


def off(field, known, seed=0):
    """Errors in cells at places within two cells of a surface."""
    places = np.random.default_rng(seed).uniform(-0.3, 0.3, (40_000, 3))
    true = known.signed_distance(places)
    near = np.abs(true) < 2 * field.spacing
    return (field.signed_distance(places[near]) - true[near]) / field.spacing


def test_a_ball_is_what_it_is():
    vertices, faces = ball()
    field = field_of_mesh(vertices, faces, CELLS)
    # Chords: r (1 - cos) of half an edge of r / 16; interpolation: h^2 / 8r along two directions at most.
    chord = RADIUS * (1 / 16) ** 2 / 2 / field.spacing
    assert np.abs(off(field, BALL)).max() <= chord + 2 * field.spacing / (8 * (RADIUS - 2 * field.spacing))
    assert np.percentile(np.abs(off(field, BALL)), 95) * field.spacing <= field.error


def test_a_box_keeps_its_faces():
    made = trimesh.creation.box(extents=(0.2, 0.3, 0.4))
    field = field_of_mesh(np.asarray(made.vertices), np.asarray(made.faces), CELLS)
    errors = off(field, BoxShape(center=(0, 0, 0), half_extents=(0.1, 0.15, 0.2)))
    assert np.sqrt(np.mean(errors**2)) <= 0.2 and np.abs(errors).max() <= 0.5
    assert np.percentile(np.abs(errors), 95) * field.spacing <= field.error


def test_which_way_a_mesh_faces_does_not_matter():
    vertices, faces = ball()
    out, into = (field_of_mesh(vertices, each, CELLS) for each in (faces, faces[:, ::-1]))
    np.testing.assert_allclose(out.values, into.values, atol=1e-6)


@pytest.mark.parametrize("kind", ["holes", "cap"])
def test_holes_are_closed(kind):
    vertices, faces = ball()
    if kind == "holes":
        left = faces[np.random.default_rng(0).random(len(faces)) > 0.05]
    else:
        left = faces[vertices[faces].mean(axis=1)[:, 2] > -0.95 * RADIUS]
    errors = off(field_of_mesh(vertices, left, CELLS), BALL)
    # The cap is replaced by something flat, as deep as it was high: .05 r, that is 1.2 cells.
    assert np.sqrt(np.mean(errors**2)) <= (0.1 if kind == "holes" else 0.3)
    assert np.abs(errors).max() <= (0.5 if kind == "holes" else 0.05 * RADIUS / (2 * RADIUS / CELLS) + 0.5)


def test_parts_that_overlap_are_one():
    one, other = (trimesh.creation.box(extents=(0.2, 0.2, 0.2)), trimesh.creation.box(extents=(0.2, 0.2, 0.2)))
    other.apply_translation([0.1, 0.0, 0.0])
    both = trimesh.util.concatenate([one, other])
    field = field_of_mesh(np.asarray(both.vertices), np.asarray(both.faces), CELLS)
    assert (field.signed_distance(np.array([[0.0, 0, 0], [0.05, 0, 0], [0.15, 0, 0]])) < 0).all()


def test_what_encloses_nothing_is_refused_or_a_sheet():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    with pytest.raises(SceneError, match=r"floor\.obj.*enclose next to nothing: say thickness = 0\.042"):
        field_of_mesh(*square, CELLS, name="floor.obj")
    field = field_of_mesh(*square, CELLS, thickness=0.05)
    heights = np.array([[0.5, 0.5, height] for height in (-0.06, -0.02, 0.0, 0.02, 0.06)])
    # Linear on both sides; the kink in the middle is cut off by half a cell at most.
    expected = np.abs(heights[:, 2]) - 0.025
    np.testing.assert_allclose(field.signed_distance(heights), expected, atol=field.spacing / 2 + 1e-9)
    np.testing.assert_allclose(field.signed_distance(heights[[0, 4]]), expected[[0, 4]], atol=1e-6)
    with pytest.raises(SceneError, match="less than a cell"):
        field_of_mesh(*square, CELLS, thickness=0.001)


def test_a_grid_that_the_machine_has_no_room_for_is_refused_before_it_is_made(monkeypatch):
    monkeypatch.setattr(mesh_distance, "available_memory", lambda: 2**20)
    with pytest.raises(SceneError, match=r"tub: a grid of 48 cells .* takes 0\.0 GiB .*lower cells"):
        field_of_mesh(*ball(2), CELLS, name="tub")
