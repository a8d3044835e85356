"""Thirty mistakes that people make in scenes: each is one line that leads to what to do."""

import pytest

from gasp_core.io import write_splat
from gasp_core.toy import make_toy

OBJECT = """\
[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
height = 0.3
position = [0, 0, 0.05]
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }
"""
SCENE = f"""\
[scene]
duration = 0.08
frame_rate = 25

{OBJECT}
[[collider]]
shape = "plane"
height = 0.0
friction = 0.4

[accuracy]
resolution = 8

[engine]
name = "ballistic"
"""
ELASTIC = 'model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3'
MATERIAL = f"material = {{ {ELASTIC} }}"
PIN = '[[drive]]\nkind = "pinned"\nregion = { shape = "sphere", center = [0, 0, 5], radius = 0.1 }\n[accuracy]'

REFUSED = {
    "a model misspelt": ('"elastic"', '"elasic"', 'did you mean "elastic"?'),
    "a preset misspelt": (MATERIAL, 'material = "ruber"', 'did you mean "rubber"'),
    "a key misspelt": ("youngs_modulus", "young_modulus", 'did you mean "youngs_modulus"?'),
    "a table misspelt": ("[[object]]", "[[objects]]", 'did you mean "object"?'),
    "an object in single brackets": ("[[object]]", "[object]", "written [[object]]"),
    "a collider in single brackets": ("[[collider]]", "[collider]", "written [[collider]]"),
    "a splat that is not there": (
        "toy.ply",
        "toi.ply",
        "no such file: toi.ply (relative paths start at the scene file)",
    ),
    "no material": (MATERIAL, "", "name one, or say static = true"),
    "Poisson's ratio of rubber": ("poissons_ratio = 0.3", "poissons_ratio = 0.5", "use 0.49, or a fluid"),
    "an axis without its sign": ('up = "+z"', 'up = "z"', "must be one of +x, -x, +y, -y, +z, -z"),
    "a reduction that is a text": (
        MATERIAL,
        f'{MATERIAL}\nreduction = "volume"',
        'reduction: must be a table, found the text "volume": write reduction = { mode = "volume" }',
    ),
    "a drive that is none": ("[accuracy]", PIN.replace("pinned", "pin"), 'did you mean "pinned"?'),
    "a box by its size": (
        "[accuracy]",
        PIN.replace('"sphere"', '"box"').replace("radius = 0.1", "size = [1, 1, 1]"),
        "known here: center, half_extents, shape",
    ),
    "friction of what sticks": ("friction = 0.4", 'friction = 0.4\ncontact = "stick"', 'use contact "separate"'),
    "gravity as a number": ("frame_rate = 25", "frame_rate = 25\ngravity = 9.81", "must be an array of 3 numbers"),
    "an engine misspelt": ('"ballistic"', '"balistic"', 'did you mean "ballistic"?'),
    "a resolution in words": ("resolution = 8", 'resolution = "high"', 'must be a whole number or "auto"'),
    "no frames": ("frame_rate = 25", "frame_rate = 0", "scene.frame_rate: must be > 0"),
    "a time with its unit": ("duration = 0.08", 'duration = "2 s"', "scene.duration: must be a number"),
    "a quote that is open": ('name = "toy"', 'name = "toy', "is not valid TOML: Illegal character '\\n' (at line 6"),
    "a place of two numbers": ("[0, 0, 0.05]", "[0, 0]", "object[0].position: must be an array of 3 numbers"),
    "a contact with nobody": ("[accuracy]", '[[contact]]\nbetween = ["toy", "ball"]\n[accuracy]', 'between "ball"'),
    "two of a name": ("[[collider]]", f"{OBJECT}\n[[collider]]", "give each object a name of its own"),
    "Young's modulus of water": (
        ELASTIC,
        'model = "fluid", density = 1000, youngs_modulus = 1e4',
        'did you mean "bulk_modulus"?',
    ),
    "a material without its density": ("density = 200, ", "", "material.density: missing, expected a number"),
}
TOLD = {
    "density in g/cm^3": ("density = 200", "density = 0.2", "is less than any solid's or liquid's: water has 1000"),
    "Young's modulus in MPa": ("youngs_modulus = 3e4", "youngs_modulus = 2", "it is in Pa, rubber has 2e6"),
    "a height in centimetres": ("height = 0.3", "height = 30", "m long: lengths are in metres"),
    "below the floor": ("[0, 0, 0.05]", "[0, 0, -0.2]", "start inside collider 1 (plane), the deepest by"),
    "gravity upside down": ("frame_rate = 25", "frame_rate = 25\ngravity = [0, 0, 9.81]", "in a scene down is -z"),
    "y taken for up": ("frame_rate = 25", "frame_rate = 25\ngravity = [0, -9.81, 0]", "in a scene down is -z"),
    "a pin that holds nothing": ("[accuracy]", PIN, "its region holds nothing at the start, the nearest matter is"),
}


@pytest.fixture
def write(workplace):
    write_splat(workplace / "toy.ply", make_toy(400))

    def scene(old, new):
        assert SCENE.count(old) >= 1
        (workplace / "scene.toml").write_text(SCENE.replace(old, new, 1))

    return scene


@pytest.mark.parametrize("mistake", REFUSED)
def test_what_cannot_be_is_refused_with_a_word_about_what_to_do(write, refused, mistake):
    old, new, says = REFUSED[mistake]
    write(old, new)
    refused("run", "scene.toml", says=[says])


def test_an_engine_that_is_a_text_is_told_how_it_is_written(workplace, gasp, refused):
    meant, scene = 'engine = { name = "ballistic" }', workplace / "scene.toml"
    write_splat(workplace / "toy.ply", make_toy(400))
    rest = f"[scene]\nduration = 0.08\nframe_rate = 25\n\n{OBJECT}"
    scene.write_text(f'engine = "ballistic"\n{rest}')
    refused("run", "scene.toml", says=[f'engine: must be a table, found the text "ballistic": write {meant}'])
    scene.write_text(f"{meant}\n{rest}")
    assert gasp("run", "scene.toml", "--frames", 1).status == 0


@pytest.mark.parametrize("mistake", TOLD)
def test_what_can_be_and_is_not_meant_is_told(write, gasp, mistake):
    old, new, says = TOLD[mistake]
    write(old, new)
    pytest.importorskip("gasp_reference_mpm", reason="the engine of the tests knows no colliders")
    # One frame, the start: the engine is asked what it can, and not opened.
    outcome = gasp("run", "scene.toml", "--frames", "1", "--engine", "reference-mpm")
    assert outcome.status == 0, outcome
    assert [line for line in outcome.out.splitlines() if says in line]


def test_thirty_mistakes():
    assert len(REFUSED) + len(TOLD) >= 30
