"""Colliders that move, as scenes and files say it."""

import pytest

from gasp_core.contract import KeyframedMotion, SteadyMotion
from gasp_core.errors import SceneError
from gasp_core.scene.loading import read_scene
from gasp_core.scene.writing import scene_to_toml

TEXT = """
[scene]
duration = 1.0
frame_rate = 10
[[object]]
name = "a"
splat = "a.ply"
material = { model = "elastic", density = 400, youngs_modulus = 5e4, poissons_ratio = 0.3 }
[[collider]]
shape = "sphere"
center = [0, 0, 1]
radius = 0.2
"""
MOMENTS = "time, x, y, z, qw, qx, qy, qz, note\n0, 0,0,1, 1,0,0,0, hand\n0.5, 0,0,0.8, 1,0,0,1, down\n"


def motion_of(text, folder=None):
    (collider,) = read_scene(TEXT + text, file="a.toml", folder=folder).colliders
    return collider.motion


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (
            "motion = { velocity = [1, 0, 0], angular_velocity = [0, 0, 3], center = [0, 0, 1], start = 0.2 }",
            SteadyMotion(velocity=(1, 0, 0), angular_velocity=(0, 0, 3), center=(0, 0, 1), start=0.2),
        ),
        (
            "motion = { times = [0, 1], places = [[0, 0, 0], [0, 0, 1]] }",
            KeyframedMotion(times=(0, 1), places=((0, 0, 0), (0, 0, 1)), center=(0, 0, 1)),
        ),
        (
            "motion = { times = [0, 1], quaternions = [[1, 0, 0, 0], [1, 0, 0, 1]], center = [0, 0, 1] }",
            KeyframedMotion(
                times=(0, 1),
                places=((0, 0, 1),) * 2,
                quaternions=((1, 0, 0, 0), (1, 0, 0, 1)),
                center=(0, 0, 1),
            ),
        ),
        ("", None),
    ],
)
def test_a_motion_is_read_and_written_as_it_was(text, wanted):
    assert motion_of(text) == wanted
    scene = read_scene(TEXT + text, file="a.toml", folder=None)
    assert read_scene(scene_to_toml(scene), file="b.toml", folder=None).colliders == scene.colliders


def test_moments_in_a_file_are_kept_in_the_scene(tmp_path):
    (tmp_path / "hand.csv").write_text(MOMENTS)
    (tmp_path / "a.ply").touch()
    text = 'motion = { file = "hand.csv", center = [0, 0, 1] }'
    scene = read_scene(TEXT + text, file="a.toml", folder=tmp_path)
    assert scene.colliders[0].motion == KeyframedMotion(
        times=(0, 0.5), places=((0, 0, 1), (0, 0, 0.8)), quaternions=((1, 0, 0, 0), (1, 0, 0, 1)), center=(0, 0, 1)
    )
    # A run goes on without the file.
    (tmp_path / "hand.csv").unlink()
    assert read_scene(scene_to_toml(scene), file="b.toml", folder=None).colliders == scene.colliders


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (None, "cannot be read as a file of moments"),
        ("", 'has no column "time"'),
        ("time,x,y\n0,0,0\n", 'has no column "z"'),
        ("time,x,y,z,qw\n0,0,0,0,1\n", 'has no column "qx"'),
        ("time,x,y,z\n", "has no moment: a line of 4 numbers"),
        ("time,x,y\n0,0,0\n", "must name time, x, y, z (and qw"),
        ("time,x,y,z\n0,0,0,0\n1,0,left,0\n", "line 3 is no moment"),
        ("time,x,y,z\n0,0,0\n", "line 2 is no moment: 4 numbers"),
        ("time,x,y,z\n0,0,0,nan\n", "line 2 has a number that is not finite"),
        ("time,x,y,z\n0,0,0,0\n0,0,0,1\n", "must rise"),
        (b"\xff\xfe\x00\x01", "cannot be read as a file of moments"),
    ],
)
def test_a_file_of_no_moments_is_refused(tmp_path, content, wanted):
    (tmp_path / "a.ply").touch()
    if content is not None:
        (tmp_path / "hand.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SceneError) as caught:
        motion_of('motion = { file = "hand.csv" }', tmp_path)
    assert wanted in str(caught.value)
    assert "hand.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("motion = { speed = 1 }", "collider[0].motion.speed"),
        ("motion = { times = [0, 1], places = [[0, 0], [0, 0]] }", "lists of 3 numbers"),
        ("motion = { times = [0, true] }", "list of numbers"),
        ("motion = { times = [0, 1], places = [[0, 0, 0]] }", "as many places"),
        ("motion = { velocity = [1, 0, 0], end = 0 }", "motion.end: must be > start"),
        ("motion = 3", "motion"),
    ],
)
def test_a_motion_that_is_none_is_refused(text, wanted):
    with pytest.raises(SceneError) as caught:
        motion_of(text)
    assert wanted in str(caught.value)


PLANE = TEXT[: TEXT.index("[[collider]]")] + '[[collider]]\nshape = "plane"\nheight = 0\n'


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("motion = { angular_velocity = [0, 0, 1] }", "angular_velocity"),
        ("motion = { times = [0, 1], places = [[0, 0, 0], [0, 0, 1]] }", "places"),
        ('motion = { file = "hand.csv" }', "file"),
    ],
)
def test_what_has_no_middle_of_its_own_wants_one_where_it_decides(text, key):
    told = rf"^a\.toml: collider\[0\]\.motion\.center: missing: the point \[m\] of it, in the scene, that {key} is of$"
    with pytest.raises(SceneError, match=told):
        read_scene(PLANE + text, file="a.toml", folder=None)
    straight = read_scene(PLANE + "motion = { velocity = [0, 0, 1] }", file="a.toml", folder=None)
    assert straight.colliders[0].motion == SteadyMotion(velocity=(0, 0, 1))
