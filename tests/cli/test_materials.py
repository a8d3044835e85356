"""The list of materials that have a name."""

import json

from gasp_core.scene.preset_table import PRESETS


def test_the_list_has_every_preset_with_the_engines_that_model_it(gasp):
    outcome = gasp("materials")
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0].split() == ["PRESET", "MODEL", "KG/M^3", "STIFFNESS", "PA", "POISSON", "ENGINES"]
    for preset in PRESETS:
        (line,) = [line for line in lines if line.startswith(f"{preset.name}  ")]
        # The engine of the tests models what is elastic.
        assert ("ballistic" in line.split()) == (preset.material.kind == "elastic")
    assert "2.1e11" in outcome.out


def test_one_says_what_its_numbers_are_in_reality_and_where_they_are_from(gasp):
    outcome = gasp("materials", "WET_sand", "water")
    assert (outcome.status, outcome.err) == (0, "")
    assert "wet sand (also: damp sand, moist sand): " in outcome.out
    assert "Sci. Rep. 2, 549" in outcome.out
    assert "bulk_modulus  1e6, in reality 1.9e9 to 2.3e9: 1e6 lets sound go" in outcome.out


def test_json_has_all_of_it(gasp):
    found = json.loads(gasp("materials", "--json").out)["materials"]
    assert [one["name"] for one in found] == [preset.name for preset in PRESETS]
    (steel,) = json.loads(gasp("materials", "steel", "--json").out)["materials"]
    assert steel["model"] == "metal"
    assert steel["numbers"]["youngs_modulus"] == 2.1e11
    assert steel["ranges"]["youngs_modulus"] == [2e11, 2.16e11]
    assert "Ashby" in steel["source"]
    assert "ballistic" not in steel["engines"]


def test_an_unknown_one_is_told_the_nearest(refused):
    refused("materials", "steal", says=['no material preset is called "steal"', '"steel"', "wet sand, wood"])


def test_a_scene_whose_preset_an_engine_does_not_model_is_refused_by_name(workplace, refused):
    scene = (workplace / "scene.toml").read_text()
    before, _, after = scene.partition("material = ")
    text = f'{before}material = "clay"\n{after.partition(chr(10))[2]}'
    (workplace / "scene.toml").write_text(text)
    refused("run", "scene.toml", says=['ballistic does not model plasticine, the model of "clay" (object "toy")'])
