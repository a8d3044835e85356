"""Presets: the table against reality and against the docs, and how a scene names them.

    python tests/scene/test_presets.py

writes the section of docs/scene.md anew from the table.
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from gasp_core import Elastic, Metal, NeoHookean, Plasticine, Rigid, material_preset
from gasp_core.contract import MATERIALS
from gasp_core.errors import SceneError
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.loading import read_scene, read_stored_scene
from gasp_core.scene.preset_table import PRESETS
from gasp_core.scene.presets import find_preset
from gasp_core.scene.writing import scene_to_toml
from gasp_core.stepping.time_step import rest_bound

PAGE = Path(__file__).parents[2] / "docs" / "scene.md"
BEGIN, END = "<!-- presets: python tests/scene/test_presets.py writes them -->", "<!-- end of presets -->"

TEXT = """
[scene]
duration = 1.0
frame_rate = 10
[[object]]
name = "a"
splat = "a.ply"
material = {}
"""


def scene_of(material):
    return read_scene(TEXT.replace("{}", material), file="a.toml", folder=None)


def material_of(material):
    return scene_of(material).objects[0].material


every = pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.name)


# --- the table ------------------------------------------------------------------------------------------------------


@every
def test_every_number_is_one_of_reality_or_says_why_not(preset):
    assert preset.ranges.keys() == preset.numbers.keys()
    assert preset.stand_ins.keys() <= preset.numbers.keys()
    for name, value in preset.numbers.items():
        low, high = preset.ranges[name]
        assert low <= high
        assert low <= value <= high or name in preset.stand_ins, name
    assert preset.source
    assert preset.summary


def test_there_is_a_preset_of_every_model_but_rigid():
    # What is rigid is so because nobody looks, whatever it is made of.
    assert {type(preset.material) for preset in PRESETS} == set(MATERIALS.values()) - {Rigid}


def test_no_name_means_two_things():
    names = [re.sub("[ _-]", "", name) for preset in PRESETS for name in (preset.name, *preset.aliases)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(("name", "hardness"), [("soft rubber", 10), ("rubber", 45)])
def test_rubber_is_as_stiff_as_its_hardness_says(name, hardness):
    # Gent 1958, of Shore A and MPa. To a tenth: numbers are given to one digit.
    modulus = 0.0981 * (56 + 7.62336 * hardness) / (0.137505 * (254 - 2.54 * hardness))
    assert 1e6 * modulus == pytest.approx(material_preset(name).youngs_modulus, rel=0.1)


@pytest.mark.parametrize("name", ["water", "oil", "honey"])
def test_a_fluid_changes_its_density_by_a_hundredth_where_it_says_so(name):
    preset = find_preset(name)
    fallen = float(re.search(r"has fallen ([\d.]+) m", preset.stand_ins["bulk_modulus"])[1])
    longer = float(re.search(r"steps be (\d+)", preset.stand_ins["bulk_modulus"])[1])
    sound = math.sqrt(preset.material.bulk_modulus / preset.material.density)
    # The heights are given to two digits at most, the speed goes with their root.
    assert math.sqrt(2 * 9.81 * fallen) == pytest.approx(sound / 10, rel=0.05)
    low, high = preset.ranges["bulk_modulus"]
    assert math.floor(math.sqrt(low / 1e6)) <= longer <= math.sqrt(high / 1e6)


@pytest.mark.parametrize("name", ["rubber", "soft rubber", "jelly", "flesh"])
def test_what_hardly_changes_its_volume_costs_as_much_more_as_it_says(name):
    preset = find_preset(name)
    said = re.search(r"changes by (\d+) % of a strain, and steps are (\d+) times", preset.stand_ins["poissons_ratio"])
    assert float(said[1]) == pytest.approx(100 * (1 - 2 * preset.material.poissons_ratio))
    real = dataclasses.replace(preset.material, poissons_ratio=0.4995)
    # As a whole number.
    assert rest_bound(preset.material, 0.01) / rest_bound(real, 0.01) == pytest.approx(float(said[2]), abs=0.5)
    low, high = preset.ranges["poissons_ratio"]
    assert low <= 0.4995 <= high


def test_wet_sand_rubs_like_dry_sand_and_coheres():
    wet, dry = material_preset("wet sand"), material_preset("dry sand")
    assert (wet.friction_angle, wet.cone, dry.cohesion) == (dry.friction_angle, dry.cone, 0)
    # A wall of it stands upright up to 4 c / (rho g) tan(45 degrees + phi / 2): castles of some decimetres.
    height = 4 * wet.cohesion / (wet.density * 9.81) * math.tan(math.radians(45 + wet.friction_angle / 2))
    assert 0.3 < height < 0.6


def test_a_heap_of_dry_sand_is_pressed_as_little_as_it_says():
    sand = material_preset("dry sand")
    assert sand.density * 9.81 * 0.3 / sand.youngs_modulus < 0.005


# --- names ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("written", ["wet sand", "Wet Sand", "WET_SAND", "wet-sand", "  wet   sand ", "damp_sand"])
def test_case_spaces_underscores_and_hyphens_are_alike(written):
    assert find_preset(written).name == "wet sand"
    assert material_preset(written) == material_preset("wet sand")


@every
def test_every_name_is_found(preset):
    assert all(find_preset(name) is preset for name in (preset.name, *preset.aliases))
    assert material_preset(preset.name) == preset.material
    assert material_preset(preset.name).name == preset.name


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("rubbr", ['"rubbr"', 'did you mean "rubber"', "there are aluminium, clay"]),
        ("stel", ['"steel"']),
        ("metal", ['a model is: { model = "metal"']),
        ("foam", ['{ model = "foam"', '"foam rubber" or "shaving foam"']),
        ("xyzzy", ['"xyzzy"; there are aluminium']),
        ("", ['called ""']),
        ("x" * 500, ["x" * 60 + '"']),
    ],
)
def test_an_unknown_name_is_told_the_nearest_and_all(name, says):
    with pytest.raises(SceneError) as caught:
        find_preset(name)
    for said in [*says, "wet sand, wood"]:
        assert said in str(caught.value)
    assert len(str(caught.value)) < 700


# --- in Python ------------------------------------------------------------------------------------------------------


def test_a_preset_is_adapted():
    assert material_preset("rubber", youngs_modulus=5e6) == NeoHookean(
        density=930, youngs_modulus=5e6, poissons_ratio=0.47
    )
    assert material_preset("steel", model="rigid") == Rigid(density=7850)
    elastic = material_preset("steel", model="elastic", youngs_modulus=2e8)
    assert elastic == Elastic(density=7850, youngs_modulus=2e8, poissons_ratio=0.29)
    assert elastic.name == "steel"
    assert material_preset("water", model="rigid") == Rigid(density=998)


@pytest.mark.parametrize(
    ("name", "changes", "says"),
    [
        ("rubber", {"yield_stress": 1.0}, '"yield_stress" is no number of neo-hookean ("rubber")'),
        ("rubber", {"density": -1.0}, "density must be > 0"),
        ("snow", {"model": "metal"}, 'preset "snow" cannot be taken as "metal"'),
        ("snow", {"model": "ice"}, 'no model is called "ice"'),
        ("water", {"model": "elastic"}, 'preset "water" has no youngs_modulus, which elastic needs'),
    ],
)
def test_what_cannot_be_adapted_says_so(name, changes, says):
    with pytest.raises(SceneError, match=re.escape(says)):
        material_preset(name, **changes)


# --- in a scene file ------------------------------------------------------------------------------------------------


@every
def test_a_scene_names_it(preset):
    material = material_of(f'"{preset.name.upper()}"')
    assert material == preset.material
    assert material.name == preset.name
    assert material_of(f'{{ preset = "{preset.name}" }}') == material
    assert material_of(f'{{ preset = "{preset.name}", density = 7 }}') == dataclasses.replace(material, density=7)


def test_a_scene_adapts_it():
    assert material_of('{ preset = "steel", model = "rigid" }') == Rigid(density=7850)
    assert material_of('{ preset = "steel", yield_stress = 1e8 }') == Metal(
        density=7850, youngs_modulus=2.1e11, poissons_ratio=0.29, yield_stress=1e8, hardening=8e8
    )
    assert material_of('{ preset = "clay", name = "mud" }').name == "mud"
    assert material_of('{ model = "rigid", density = 5, name = "hull" }').name == "hull"


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ('"rubbr"', ["a.toml: object[0].material: no material preset", 'did you mean "rubber"']),
        ("3", ["object[0].material: must be the name of a preset, or a table, found 3"]),
        ('{ preset = "rubbr" }', ["object[0].material.preset: no material preset"]),
        ("{ preset = 3 }", ["object[0].material.preset: must be a text"]),
        ('{ preset = "rubber", model = "rubbery" }', ["object[0].material.model: must be one of"]),
        ('{ preset = "snow", model = "metal" }', ["object[0].material.model: ", "numbers mean something else"]),
        ('{ preset = "rubber", youngs_modulos = 3 }', ["object[0].material.youngs_modulos", "youngs_modulus"]),
        ('{ preset = "rubber", youngs_modulus = "soft" }', ["object[0].material.youngs_modulus: must be a number"]),
        ('{ preset = "rubber", youngs_modulus = -1 }', ["object[0].material.youngs_modulus", "> 0"]),
        ('{ preset = "water", model = "elastic" }', ["object[0].material.youngs_modulus: missing"]),
        ('{ preset = "rubber", name = 3 }', ["object[0].material.name: must be a text"]),
        ('{ preset = "rubber", name = "a\\u0007b" }', ["object[0].material.name: must be up to 100 printable"]),
        ("{ density = 3 }", ["object[0].material.model: missing"]),
    ],
)
def test_what_is_wrong_with_it_is_said_with_its_place(written, says):
    with pytest.raises(SceneError) as caught:
        scene_of(written)
    for said in says:
        assert said in str(caught.value)


@every
def test_a_recording_keeps_the_numbers_and_not_the_preset(preset):
    scene = scene_of(f'{{ preset = "{preset.name}", density = 123.25 }}')
    text = scene_to_toml(scene)
    assert "preset =" not in text
    assert "density = 123.25" in text
    again, forgotten = read_stored_scene(text, file="kept")
    material = again.objects[0].material
    assert (material, material.name, forgotten) == (scene.objects[0].material, preset.name, ())
    assert scene_digest(again, ["00"]) == scene_digest(scene, ["00"])


def test_a_name_decides_nothing():
    named = scene_of('"jelly"')
    plain = scene_of('{ model = "elastic", density = 1050, youngs_modulus = 1e4, poissons_ratio = 0.45 }')
    assert named == plain
    assert hash(named.objects[0].material) == hash(plain.objects[0].material)
    assert scene_digest(named, ["00"]) == scene_digest(plain, ["00"])
    (line,) = [line for line in scene_to_toml(plain).splitlines() if line.startswith("material")]
    assert "name" not in line


@pytest.mark.parametrize("name", [3, None, "x" * 101, "a\nb"])
def test_a_name_is_a_short_line(name):
    with pytest.raises(SceneError, match=r"Rigid\.name must be up to 100 printable characters"):
        Rigid(density=1, name=name)


# --- the docs -------------------------------------------------------------------------------------------------------


def number(value: float) -> str:
    mantissa, _, exponent = f"{value:.5g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def between(low: float, high: float) -> str:
    return number(low) if low == high else f"{number(low)} to {number(high)}"


def documented() -> str:
    """The section of docs/scene.md: each number with the range that it has in reality, and why where it is another."""
    rows = ["| preset | | model | numbers (in reality) | source |", "|---|---|---|---|---|"]
    notes: list[str] = []
    for preset in PRESETS:
        also = f", {', '.join(f'`{alias}`' for alias in preset.aliases)}" if preset.aliases else ""
        numbers = "; ".join(
            f"`{name}` {number(value)} ({between(*preset.ranges[name])})" for name, value in preset.numbers.items()
        )
        rows.append(
            f"| `{preset.name}`{also} | {preset.summary} | `{preset.material.kind}` | {numbers} | {preset.source} |"
        )
        notes += [f"- `{preset.name}`, `{name}`: {why}." for name, why in preset.stand_ins.items()]
    return "\n".join([*rows, "", "Where a number is not that of reality, or not all of it:", "", *notes])


def test_the_docs_have_the_table_as_it_is():
    written = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    assert written.strip() == documented(), "docs/scene.md: python tests/scene/test_presets.py writes it anew"


def test_plasticine_and_clay_are_what_their_models_take():
    assert isinstance(material_preset("clay"), Plasticine)
    assert material_preset("plasticine").softening == 0


if __name__ == "__main__":
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n\n{documented()}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")
