"""Colliders that files describe: read, written, known by their content."""

import dataclasses

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import Elastic, HalfSpace, SplatObject, load_scene, scene_to_toml
from gasp_core.contract import BodyContact, Collider, ContactCondition, SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.io import write_splat
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.file_shapes import MeshShape, SplatShape, known_by_content, resolved
from gasp_core.scene.loading import read_scene, read_stored_scene

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")

HEAD = '[scene]\nduration = 1.0\nframe_rate = 25\n[[object]]\nname = "toy"\nsplat = "toy.ply"\n'
HEAD += 'material = { model = "elastic", density = 400, youngs_modulus = 5e4, poissons_ratio = 0.3 }\n'


@pytest.fixture
def folder(tmp_path):
    write_splat(tmp_path / "toy.ply", shell(SHAPES["sphere"], count=3000))
    trimesh.creation.box(extents=(2, 4, 6)).export(tmp_path / "block.glb")
    trimesh.creation.box(extents=(2, 4, 6)).export(tmp_path / "block.stl")
    return tmp_path


def loaded(folder, text):
    path = folder / "scene.toml"
    path.write_text(HEAD + text)
    return load_scene(path)


def test_a_mesh_is_placed_as_objects_are(folder):
    scene = loaded(
        folder,
        '[[collider]]\nshape = "mesh"\nmesh = "block.glb"\nheight = 0.4\nposition = [1, 0, 0.1]\ncells = 32\n'
        'friction = 0.3\ncontact = "separate"\n',
    )
    (collider,) = scene.colliders
    assert isinstance(collider.shape, MeshShape) and collider.friction == 0.3
    field = resolved(collider).shape
    assert isinstance(field, SignedDistanceField)
    # glTF has +y up: 4 units become .4 m; the lower face is at .1, the middle of it at x = 1.
    places = np.array([[1, 0, 0.12], [1, 0, 0.08], [1, 0, 0.48], [1, 0, 0.52], [1.09, 0, 0.3], [1, 0.29, 0.3]])
    inside = field.signed_distance(places) < 0
    assert inside.tolist() == [True, False, True, False, True, True]
    assert (collider.shape.signed_distance(places) == field.signed_distance(places)).all()


def test_other_meshes_have_z_up(folder):
    field = MeshShape(file=folder / "block.stl", height=0.6, position=(0, 0, 0), cells=32).resolve()
    assert (field.signed_distance(np.array([[0.0, 0.19, 0.59], [0.09, 0.0, 0.01]])) < 0).all()


def test_a_mesh_is_as_large_as_its_vertices_however_they_are_spread(folder):
    """Most of them on top: what is left out of a splat as noise would be the legs of a table."""
    top = trimesh.creation.box(extents=(1, 1, 0.02)).subdivide_loop(iterations=0)
    for _ in range(6):
        top = top.subdivide()
    top.apply_translation([0, 0, 0.74])
    legs = [trimesh.creation.box(extents=(0.04, 0.04, 0.73)) for _ in range(4)]
    for leg, (x, y) in zip(legs, [(-0.4, -0.4), (-0.4, 0.4), (0.4, -0.4), (0.4, 0.4)]):
        leg.apply_translation([x, y, 0.365])
    table = trimesh.util.concatenate([top, *legs])
    assert len(table.vertices) / 500 > 4 * 8, "a thousandth at the bottom is all of the legs' feet"
    table.export(folder / "table.stl")
    field = MeshShape(file=folder / "table.stl", height=0.75, position=(0, 0, 0), cells=64).resolve()
    places = np.array([[0, 0, 0.74], [0.4, 0.4, 0.02], [0.4, 0.4, 0.5], [0, 0, 0.5], [0, 0, -0.05]])
    assert (field.signed_distance(places) < 0).tolist() == [True, True, True, False, False]


def test_a_splat_is_the_solid_behind_it(folder):
    scene = loaded(folder, '[[collider]]\nshape = "splat"\nsplat = "toy.ply"\nup = "+z"\nposition = [0, 0, 0]\n')
    (collider,) = scene.colliders
    assert isinstance(collider.shape, SplatShape)
    sphere = SHAPES["sphere"]
    field = resolved(collider).shape
    places = np.random.default_rng(0).uniform(-1, 1, (2000, 3)) * sphere.size + [0, 0, sphere.size / 2]
    off = field.signed_distance(places) - sphere.distance(places)
    near = np.abs(sphere.distance(places)) < 2 * field.spacing
    assert np.percentile(np.abs(off[near]), 95) <= field.error


@pytest.mark.parametrize("turned", ["", "rotation = [20, 30, 40]\n"])
def test_a_thin_wall_has_no_holes_and_is_met_where_the_filled_body_is(folder, turned):
    text = '[[collider]]\nshape = "splat"\nsplat = "toy.ply"\nup = "+z"\nposition = [0, 0, 0]\n' + turned
    hollow, filled = (
        resolved(loaded(folder, text + more).colliders[0]).shape
        for more in ('solid = { interior = "hollow", wall = 0.002 }\n', "")
    )
    # Corners of cells that the surface cuts are at most a diagonal of one off it.
    beside = np.abs(filled.values) <= np.sqrt(3) * filled.spacing
    assert np.array_equal(hollow.values[beside], filled.values[beside])
    assert hollow.signed_distance(np.array([[0, 0, SHAPES["sphere"].size / 2]])) > 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('shape = "mesh"\nmesh = "gone.glb"\n', "collider[0].mesh: no such file"),
        ('shape = "mesh"\nsplat = "toy.ply"\n', "collider[0].splat: unknown key"),
        ('shape = "mesh"\n', "collider[0].mesh: missing"),
        ('shape = "splat"\nspalt = "toy.ply"\n', 'collider[0].spalt: unknown key, did you mean "splat"'),
        ('shape = "splat"\nsplat = "toy.ply"\nfile = "toy.ply"\n', "collider[0].file: unknown key"),
        ('shape = "splat"\nsplat = "toy.ply"\nfrictoin = 1\n', 'frictoin: unknown key, did you mean "friction"'),
        ('shape = "mesh"\nmesh = "block.glb"\nheigth = 1\n', 'unknown key, did you mean "height"'),
        ('shape = "mesh"\nmesh = "block.glb"\ncells = 3\n', "collider[0].cells: must be >= 8"),
        ('shape = "mesh"\nmesh = "block.glb"\nup = "y"\n', "collider[0].up: must be one of"),
        ('shape = "mesh"\nmesh = "block.glb"\nheight = 1\nmetres_per_unit = 1\n', "contradict each other"),
        ('shape = "mesh"\nmesh = "block.glb"\nthickness = 0\n', "thickness: must be > 0"),
        ('shape = "splat"\nsplat = "toy.ply"\ncells = 32\n', "cells: unknown key"),
        ('shape = "cone"\n', "must be one of plane, box, sphere, splat, mesh"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(folder, text, says):
    with pytest.raises(SceneError) as caught:
        loaded(folder, "[[collider]]\n" + text)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_a_scene_comes_back_from_its_text(folder):
    text = '[[collider]]\nshape = "mesh"\nmesh = "block.glb"\nheight = 0.4\nrotation = [0, 90, 0]\n'
    text += '[[collider]]\nshape = "splat"\nsplat = "toy.ply"\nsolid = { interior = "hollow", wall = 0.05 }\n'
    text += '[[object]]\nname = "shelf"\nsplat = "toy.ply"\nstatic = true\ncollider = { friction = 0.4 }\n'
    scene = loaded(folder, text)
    assert scene.objects[1].collider == BodyContact(friction=0.4)
    written = scene_to_toml(scene, folder)
    assert 'mesh = "block.glb"' in written
    stored, forgotten = read_stored_scene(written, file="scene.toml", beside=folder)
    assert (stored, forgotten) == (scene, ())
    assert read_scene(scene_to_toml(scene), file="scene.toml", folder=None) == scene


def test_colliders_are_known_by_their_content(folder):
    text = '[[collider]]\nshape = "mesh"\nmesh = "block.glb"\n'
    scene = loaded(folder, text)
    told = dataclasses.replace(scene, colliders=tuple(map(known_by_content, scene.colliders)))
    digest = scene_digest(scene, ["0"])
    assert digest == scene_digest(told, ["0"])
    (folder / "block.glb").rename(folder / "moved.glb")
    assert scene_digest(loaded(folder, text.replace("block", "moved")), ["0"]) == digest
    trimesh.creation.box(extents=(2, 4, 7)).export(folder / "block.glb")
    assert scene_digest(loaded(folder, text), ["0"]) != digest
    with pytest.raises(SceneError, match="is not the file that the collider was made of"):
        resolved(told.colliders[0])


def test_a_file_that_changes_is_another_collider(folder):
    table = Collider(shape=MeshShape(file=folder / "block.stl", cells=16))
    before = resolved(table).shape
    assert resolved(table).shape is before
    trimesh.creation.box(extents=(2, 4, 7)).export(folder / "block.stl")
    assert resolved(table).shape != before


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("true", BodyContact()),
        ("false", None),
        ('{ contact = "stick" }', BodyContact(contact=ContactCondition.STICK)),
    ],
)
def test_objects_that_stand_still_are_colliders_if_they_say_so(folder, value, expected):
    scene = loaded(folder, f'[[object]]\nname = "shelf"\nsplat = "toy.ply"\nstatic = true\ncollider = {value}\n')
    assert scene.objects[1].collider == expected


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ('"yes"', "must be true, false or a table"),
        ("{ friction = -1 }", "friction: must be >= 0"),
        ('{ contact = "stick", friction = 0.4 }', "has no meaning with contact"),
        ("{ side = 1 }", "unknown key"),
    ],
)
def test_contacts_that_cannot_be(folder, value, says):
    with pytest.raises(SceneError, match=says):
        loaded(folder, f'[[object]]\nname = "shelf"\nsplat = "toy.ply"\nstatic = true\ncollider = {value}\n')


def test_what_moves_is_no_collider():
    soft = Elastic(density=400, youngs_modulus=5e4, poissons_ratio=0.3)
    with pytest.raises(SceneError, match="has no meaning without static"):
        SplatObject(name="toy", splat="toy.ply", material=soft, collider=BodyContact())


def test_colliders_of_formulas_stay_as_they_are():
    floor = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
    assert resolved(floor) is floor and known_by_content(floor) is floor
