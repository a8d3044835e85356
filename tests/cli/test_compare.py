"""`gasp compare`: a table for people, JSON for programs, and one line where it cannot be."""

import json

import pytest


@pytest.fixture
def both(installed):
    installed("frail", "ballistic")


@pytest.mark.thorough
def test_a_table_and_a_page(gasp, both, workplace):
    found = gasp("compare", "scene.toml", "--engines", "ballistic, away", "--size", "64x48")
    assert (found.status, found.err) == (0, "")
    lines = found.out.splitlines()
    assert lines[0].split() == ["ENGINE", "STATUS", "FRAMES", "START", "s", "RUN", "s", "SUBSTEPS", "MEMORY", "MB"]
    assert lines[1].split()[:3] == ["ballistic", "complete", "3"]
    assert lines[2].split() == ["away", "unable", "0", lines[2].split()[3], "-", "-", "-"]
    assert "gasp engines install away" in found.out
    assert lines[-1] == "to look at: scene.compare/comparison.html"
    assert (workplace / "scene.compare" / "comparison.html").is_file()
    again = gasp("compare", "scene.toml", "--engines", "ballistic")
    assert again.status == 2
    assert "--overwrite" in again.err


@pytest.mark.thorough
def test_json_for_programs(gasp, both, workplace):
    found = gasp("compare", "scene.toml", "--engines", "ballistic,frail", "--json", "--size", "64", "--out", "look")
    assert (found.status, found.err) == (0, "")
    said = json.loads(found.out)
    assert said["folder"] == "look"
    assert [row["status"] for row in said["engines"]] == ["complete", "complete"]
    assert said["pairs"][0]["distance"]["frames"] == 3
    kept = json.loads((workplace / "look" / "comparison.json").read_text())
    assert {key: value for key, value in said.items() if key != "folder"} == kept


def test_where_nothing_came_to_the_end_that_is_an_error_and_there_is_a_page(gasp, both, workplace):
    found = gasp("compare", "scene.toml", "--engines", "away")
    assert found.status == 2
    assert found.err.startswith("gasp: no engine came to the end of scene.toml")
    assert "gasp engines install away" in found.err
    assert "unable" in found.out
    assert (workplace / "scene.compare" / "comparison.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["scene.toml", "--engines", "balistic"], ['"balistic"', "ballistic"]),
        (["scene.toml", "--engines", ","], ["no engine was named"]),
        (["scene.toml", "--engines", "ballistic,ballistic"], ["twice"]),
        (["nowhere.toml"], ["nowhere.toml"]),
        (["scene.toml", "--resolution", "0"], ["--resolution"]),
        (["scene.toml", "--jobs", "0"], ["--jobs"]),
        (["scene.toml", "--time-limit", "0"], ["--time-limit"]),
        (["scene.toml", "--time-limit", "nan"], ["time_limit"]),
        (["scene.toml", "--size", "big"], ["--size"]),
        (["scene.toml", "--size", "0x5"], ["picture's width"]),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(refused, arguments, says):
    refused("compare", *arguments, says=says)
