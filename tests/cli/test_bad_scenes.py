"""Scenes that cannot be: one clear line that names file, key and remedy, status 2, nothing left behind."""

import pytest

MATERIAL = '{ model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }'


def material(**changes):
    values = {"model": '"elastic"', "density": "200", "youngs_modulus": "3e4", "poissons_ratio": "0.3"} | changes
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"


# What is replaced in the good scene, by what, and what the line has to say.
CASES = {
    "not TOML": ("[scene]", "[scene", ["scene.toml", "TOML"]),
    "unknown table": ("[engine]", "[motor]", ["motor", "unknown key", "engine"]),
    "unknown key": ("frame_rate", "framerate", ["scene.framerate", 'did you mean "frame_rate"?']),
    "unknown key of an object": ("height", "hight", ["object[0].hight", 'did you mean "height"?']),
    "unknown key of a material": (MATERIAL, material(colour="1"), ["object[0].material.colour", "density"]),
    "missing key": ("duration = 0.08\n", "", ["scene.duration", "missing"]),
    "text for a number": ("duration = 0.08", 'duration = "long"', ["scene.duration", "must be a number", "long"]),
    "number for a text": ('name = "toy"', "name = 3", ["object[0].name", "must be a text", "3"]),
    "two numbers for three": ("[0, 0, 0.2]", "[0, 0.2]", ["object[0].position", "3 numbers"]),
    "nan": ("0.08", "nan", ["duration", "finite"]),
    "no time": ("0.08", "0", ["duration", "> 0"]),
    "negative density": (MATERIAL, material(density="-1"), ["object[0].material.density", "> 0", "-1"]),
    "E = 0": (MATERIAL, material(youngs_modulus="0"), ["object[0].material.youngs_modulus", "> 0"]),
    "nu = 0.5": (MATERIAL, material(poissons_ratio="0.5"), ["material.poissons_ratio", "< 0.5", "0.49"]),
    "unknown material": (MATERIAL, material(model='"jelly"'), ["object[0].material.model", "jelly", "elastic"]),
    "splat that is not there": ("toy.ply", "bear.ply", ["object[0].splat", "no such file", "bear.ply"]),
    "tolerance": ("[engine]", "[accuracy]\ntolerance = 0.01\n[engine]", ["accuracy.tolerance", "resolution"]),
    "engine auto": ('"ballistic"', '"auto"', ["engine", "auto", "name an engine"]),
    "engine that is not installed": ('"ballistic"', '"balistic"', ["balistic", 'did you mean "ballistic"?']),
    "material the engine lacks": (
        MATERIAL,
        material(model='"sand"'),
        ['ballistic does not model sand (object "toy")', "engines that do: ", "reference-mpm"],
    ),
    "material that no engine for points has": (
        MATERIAL,
        '{ model = "rigid", density = 200 }',
        ["does not model rigid", "engines that do: ", "mujoco-flex"],
    ),
    "collider the engine lacks": (
        "[engine]",
        '[[collider]]\nshape = "plane"\nheight = 0.0\n[engine]',
        ["ballistic", "plane", "collider 1", "reference-mpm"],
    ),
    "device the engine lacks": ("[engine]", '[engine]\ndevice = "cuda"', ["ballistic", "cuda", "choose device cpu"]),
    "precision the engine lacks": (
        "[engine]",
        '[engine]\nprecision = "float32"',
        ["float32", "choose precision float64"],
    ),
    "option the engine lacks": (
        "[engine]",
        "[engine]\noptions = { threads = 2 }",
        ["options of engine ballistic", "threads", "time_scale"],
    ),
    "option of the wrong type": (
        "[engine]",
        '[engine]\noptions = { time_scale = "slow" }',
        ["options of engine ballistic", "time_scale must be a number", "slow"],
    ),
    "nothing left of an object": ('up = "+z"', 'up = "+z"\nmin_opacity = 1.0', ["toy", "opacity"]),
}


@pytest.mark.parametrize("case", CASES)
def test_scene_that_cannot_be(refused, workplace, case):
    before, after, says = CASES[case]
    scene = workplace / "scene.toml"
    text = scene.read_text()
    assert before in text
    scene.write_text(text.replace(before, after, 1))
    refused("run", scene, says=says)


def test_objects_of_one_name(refused, workplace):
    scene = workplace / "scene.toml"
    head, rest = scene.read_text().split("[[object]]")
    item, engine = rest.split("[engine]")
    scene.write_text(f"{head}[[object]]{item}[[object]]{item}[engine]{engine}")
    refused("run", scene, says=["object[1].name", '"toy" is taken'])


def test_scene_that_is_not_there(refused):
    refused("run", "nowhere.toml", says=["nowhere.toml", "no such scene file"])


def test_scene_that_is_a_splat(refused):
    refused("run", "toy.ply", says=["toy.ply: is a splat", "gasp new toy.ply"])


def test_scene_that_is_a_folder(refused, workplace):
    refused("run", workplace, says=["Is a directory"])


@pytest.mark.parametrize(
    ("fakes", "engine", "says"),
    [
        (["twin_one", "twin_two"], "twin", ["gasp-fake-twin-one and gasp-fake-twin-two", "uninstall all but one"]),
        (["unimportable"], "unimportable", ["gasp-fake-unimportable", "flux capacitor is missing", "pip install"]),
        (["misspelt"], "misspelt", ["unknown hook gasp_point_engine;", "gasp_point_engines"]),
        (["other_major"], "other-major", ["contract 2.0", "update gasp-core"]),
        (["no_factory"], "no-factory", ["fake_no_factory_engine", "pip install"]),
        (["no_backend"], "no-backend", ["fake_backend", 'pip install "fake-backend>=3"']),
    ],
)
def test_engine_that_is_broken(refused, installed, fakes, engine, says):
    installed(*fakes)
    refused("run", "scene.toml", "--engine", engine, says=[f'"{engine}"', *says])


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("toy.ply", ["toy.ply"]),
        ("toy.ply/run.gasp", ["toy.ply"]),
        (".", ["."]),
    ],
)
def test_place_that_cannot_hold_a_recording(refused, out, says):
    refused("run", "scene.toml", "--out", out, says=says)


def test_step_above_the_stable_bound(refused, workplace):
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text() + "\n[accuracy]\nsubstep = 0.1\n")
    refused("run", scene, "--engine", "reference-mpm", says=["substep under [accuracy]", "stable bound", "leave"])


def test_a_run_is_not_overwritten_unasked(gasp, refused):
    assert gasp("run", "scene.toml").status == 0
    refused("run", "scene.toml", says=["scene.gasp", "resume"])
    assert gasp("run", "scene.toml", "--overwrite").status == 0


def test_resume_of_another_scene(gasp, refused, workplace):
    assert gasp("run", "scene.toml", "--frames", 1).status == 0
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text().replace("density = 200", "density = 300"))
    refused("run", "scene.toml", "--resume", says=["scene.gasp"])
