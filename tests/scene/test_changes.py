"""Keys of a scene file that are set from outside of it."""

import pytest

from gasp_core import load_scene
from gasp_core.errors import SceneError
from gasp_core.scene.changes import value_of

SCENE = """
[scene]
duration = 1.0
frame_rate = 25
[[object]]
name = "plant"
splat = "plant.ply"
height = 0.2
material = "rubber"
[[object]]
name = "pot"
splat = "plant.ply"
velocity = [0, 0, 1]
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }
[[collider]]
shape = "plane"
height = 0.0
[accuracy]
resolution = 24
"""


@pytest.fixture
def load(tmp_path):
    (tmp_path / "plant.ply").touch()
    (tmp_path / "scene.toml").write_text(SCENE)
    return lambda *changes: load_scene(tmp_path / "scene.toml", changes)


def test_keys_are_set_by_where_they_stand(load):
    scene = load(
        "scene.duration=2",
        "object.pot.material.youngs_modulus = 1e6",
        "object[0].height=0.5",
        "object.0.up=-y",
        "collider.height=0.25",
        "object.pot.position=[0, 0, 1]",
        "object.pot.position.2=0.5",
        "object.pot.motion={ kind='swing', axis=[1, 0, 0], amplitude=1, frequency=1, pivot=[0, 0, 0] }",
        "object.pot.motion.schedule=[[0, 0], [1, 3]]",
        "object.pot.motion.schedule.1.1=2",
        "accuracy.resolution=12",
        "engine.name=reference-mpm",
    )
    assert scene.duration == 2 and scene.accuracy.resolution == 12 and scene.engine.name == "reference-mpm"
    plant, pot = scene.objects
    assert plant.height == 0.5 and pot.material.youngs_modulus == 1e6 and pot.position == (0, 0, 0.5)
    assert pot.motion.schedule == ((0, 0), (1, 2))
    assert pot.material.density == 200
    assert scene.colliders[0].shape.point[2] == 0.25


def test_a_number_of_a_preset_and_a_whole_material(load):
    rubber = load().objects[0].material
    heavy = load("object.plant.material.density=2000").objects[0].material
    assert heavy.density == 2000 and heavy.youngs_modulus == rubber.youngs_modulus
    assert load("object.plant.material=jelly").objects[0].material.density == 1050
    mud = 'object.plant.material={ model = "elastic", density = 9, youngs_modulus = 1e3, poissons_ratio = 0.2 }'
    assert load(mud).objects[0].material.density == 9


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (".2", 0.2),
        ("-.5e-3", -0.0005),
        ("2.", 2.0),
        ("1.e5", 1e5),
        ("[0., -.5, +.25]", [0, -0.5, 0.25]),
        ("{ height = .5 }", {"height": 0.5}),
        ('"a .5"', "a .5"),
        *((text, text) for text in (".hidden", "../a.5", "v1.", "1..2", "1.2.3", ".", "toy.5.ply", "1\nb=.2")),
    ],
)
def test_decimals_without_digits_before_or_after_the_point_are_numbers(text, value):
    assert value_of(text) == value


def test_without_changes_a_scene_is_what_its_file_says(load):
    assert load() == load("scene.duration=1.0")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("scene.duration", "--set scene.duration: must be KEY=VALUE"),
        ("=3", "must be KEY=VALUE"),
        ("scene..duration=3", "must be KEY=VALUE"),
        ("object.flower.height=3", 'there is no object "flower", there are plant, pot'),
        ("object.2.height=3", 'there is no object "2", there are plant, pot'),
        ("object.height=3", "object are several tables: say which"),
        ("scene.duration.long=3", "scene.duration is 1.0 there, and no table"),
        ("scene.lenght=3", "lenght"),
        ("object.plant.heigth=3", r"object\[0\].*heigth"),
        ("scene.duration=long", "duration"),
        ("scene.duration=1\nframe_rate=3", "duration"),
        ("collider.0=3", "collider are several tables"),
        ("object.pot.position.2=1", r"position: must be an array of 3 numbers, found a table"),
        ("object.pot.velocity.3=1", 'there is no object.pot.velocity "3", there are 0, 1, 2'),
        ("object.pot.velocity.z=1", 'there is no object.pot.velocity "z", there are 0, 1, 2'),
        ("accuracy.resolution=99999999999999999999", "below 2"),
    ],
)
def test_what_cannot_be_set_is_told(load, change, says):
    with pytest.raises(SceneError, match=says) as error:
        load(change)
    assert "\n" not in str(error.value) or "frame_rate" in change


def test_a_fault_that_was_set_is_told_with_what_was_set(load, tmp_path):
    """And one of the file's own is not."""
    with pytest.raises(
        SceneError, match=r"scene\.toml, with --set object\.plant\.height=-1: object\[0\]\.height: must be > 0"
    ):
        load("object.plant.height=-1")
    (tmp_path / "scene.toml").write_text(SCENE.replace("duration", "duratio"))
    with pytest.raises(SceneError, match=r"scene\.toml: scene\.duratio: unknown key"):
        load("object.plant.height=1")
