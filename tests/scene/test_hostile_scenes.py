"""Scenes that carelessness or malice wrote: one line that says what and where, as for any other."""

import os

import pytest

from gasp_core import Elastic, EngineChoice, Gaussians, Scene, SplatObject, load_scene, write_splat
from gasp_core.errors import GaspError, SceneError
from gasp_core.simulation.splat_sources import prepare
from gasp_core.toy import make_toy

SCENE = """\
[scene]
duration = 0.2
frame_rate = 25

[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
height = 0.3
position = [0, 0, 0.2]
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }

[engine]
name = "warp-mpm"
seed = 0
"""


@pytest.fixture
def folder(tmp_path):
    write_splat(tmp_path / "toy.ply", make_toy(64))
    return tmp_path


@pytest.fixture
def refused(folder):
    """refused(old, new) -> the message of the refusal of the scene with that change."""

    def read(old, new):
        assert old in SCENE
        path = folder / "scene.toml"
        path.write_text(SCENE.replace(old, new, 1), encoding="utf-8")
        with pytest.raises(SceneError) as error:
            prepare(load_scene(path))
        said = str(error.value)
        assert said.isprintable()
        assert len(said) < 1500
        return said

    return read


CHANGES = {
    "a whole number of 5000 digits": ("seed = 0", "seed = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
    "a whole number of 400 digits": (
        "seed = 0",
        "seed = " + "9" * 400,
        "engine.seed: a whole number must be below 2^63",
    ),
    "digits in sixteens": ("seed = 0", "seed = 0x" + "f" * 9000, "engine.seed: a whole number must be below 2^63"),
    "digits of a height": (
        "height = 0.3",
        "height = " + "9" * 400,
        "object.0.height: a whole number must be below 2^63",
    ),
    "1e400": ("height = 0.3", "height = 1e400", "the number 1e400 is beyond 1e308"),
    "-1e400 in an array": ("[0, 0, 0.2]", "[0, 0, -1e400]", "the number -1e400 is beyond 1e308"),
    "infinity in words": ("height = 0.3", "height = inf", r"object[0].height: must be finite, found inf"),
    "infinitely many frames": ("0.2\nframe_rate = 25", "1e200\nframe_rate = 1e200", "makes inf frames, more than"),
    "a path of 6000 characters": ("toy.ply", "a/" * 3000, "object[0].splat: no such file: a/a/"),
    "a name of 300 characters": ("toy.ply", "n" * 300, "no such file: nnn"),
    "a home of nobody": ("toy.ply", "~nobody_of_this_name/x", "no such file: ~nobody_of_this_name/x"),
    "a null character in a path": ("toy.ply", "a\\u0000b", r"no such file: a\x00b"),
    "a line's end in a path": ("toy.ply", "a\\nb", r"no such file: a\nb"),
    "control characters in a name": ('"toy"', '"\\u001b[31m"', r"object[0].name: must be up to 200 printable"),
    "a name that turns the line around": ('"toy"', '"\\u202eyot"', "printable characters, found '\\u202eyot'"),
    "a name of a megabyte": ('"toy"', '"' + "x" * 1_100_000 + '"', "is longer than the 1,048,576 bytes"),
    "a long name": ('"toy"', '"' + "x" * 10_000 + '"', "object[0].name: must be up to 200 printable characters"),
    "control characters in a value": ('"+z"', '"\\u001b[31m"', r'found the text "\x1b[31m"'),
    "control characters in a key": ("height", '"\\u001b[31m"', r"object[0].\x1b[31m: unknown key"),
    "a key of 5000 characters": ("height", "h" * 5000, "hhh...: unknown key"),
    "arrays in arrays": ("[0, 0, 0.2]", "[" * 5000, "is nested too deep"),
    "tables in tables": ("seed = 0", "options." + "a." * 300 + "b = 1", "is nested too deep"),
    "a key of 100,000 parts": ("seed = 0", "options" + ".a" * 100_000 + " = 1", "has a key of more than 500 parts"),
    "a height of no matter": ("height = 0.3", "height = 1e-300", "a cell of this scene would be"),
    "a height of all matter": ("height = 0.3", "height = 1e300", "a cell of this scene would be"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_is_refused_in_one_line(case, refused):
    old, new, says = CHANGES[case]
    assert says in refused(old, new)


def test_a_file_without_an_end_is_no_scene():
    with pytest.raises(SceneError, match="is longer than the 1,048,576 bytes"):
        load_scene("/dev/zero")


def test_a_path_no_file_can_have_is_no_scene(tmp_path):
    with pytest.raises(SceneError, match="null"):
        load_scene("a\0b.toml")
    with pytest.raises(SceneError, match="cannot be read: File name too long"):
        load_scene(tmp_path / ("n" * 300))


def test_the_file_is_named_without_its_control_characters(tmp_path):
    path = tmp_path / "a\x1b[31m.toml"
    path.write_text("height")
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).isprintable()


class TestAFileThatIsMissing:
    def test_is_named_by_its_variable_and_not_by_what_that_stands_for(self, refused, monkeypatch):
        monkeypatch.setenv("GASP_TEST_SECRET", "/home/somebody/of-no-concern")
        said = refused("toy.ply", "$GASP_TEST_SECRET/bear.ply")
        assert "no such file: $GASP_TEST_SECRET/bear.ply (relative paths start" in said
        assert "somebody" not in said

    def test_says_which_variable_is_not_set(self, refused, monkeypatch):
        monkeypatch.delenv("GASP_TEST_UNSET", raising=False)
        said = refused("toy.ply", "${GASP_TEST_UNSET}/bear.ply")
        assert "${GASP_TEST_UNSET}/bear.ply (GASP_TEST_UNSET is not set in the environment)" in said

    def test_of_the_cameras_as_well(self, refused, monkeypatch):
        monkeypatch.setenv("GASP_TEST_SECRET", "/home/somebody")
        said = refused("[engine]", '[camera]\nfile = "$GASP_TEST_SECRET/cameras.json"\n[engine]')
        assert "camera.file: no such file: $GASP_TEST_SECRET/cameras.json" in said


@pytest.mark.parametrize("values", [{"seed": 10**400}, {"frame_limit": 10**400}])
def test_numbers_beyond_all_floats_are_refused_in_python_too(values):
    with pytest.raises(GaspError, match="must be below 1e308, found a whole number that is longer"):
        EngineChoice(**values)


def test_a_vector_beyond_all_floats_is_refused_in_python_too(cloud):
    with pytest.raises(SceneError, match="below 1e308"):
        item(cloud(), velocity=(0, 0, 10**400))


def test_infinitely_many_frames_are_refused_in_python_too(cloud):
    with pytest.raises(SceneError, match="makes inf frames"):
        Scene(duration=1e200, frame_rate=1e200, objects=(item(cloud()),))


def item(splat: Gaussians, **others):
    material = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    return SplatObject(name="thing", splat=splat, material=material, **others)


def test_a_pipe_is_read_as_a_scene(folder):
    """As a shell hands it over: gasp run <(make-scene)."""
    reader, writer = os.pipe()
    os.write(writer, SCENE.replace("toy.ply", str(folder / "toy.ply")).encode())
    os.close(writer)
    try:
        assert load_scene(f"/dev/fd/{reader}").frame_count == 6
    finally:
        os.close(reader)
