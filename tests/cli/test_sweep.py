"""`gasp sweep`: a table for people, JSON for programs, and one line where it cannot be."""

import csv
import json

import pytest


@pytest.fixture
def both(installed):
    installed("frail", "ballistic")


def test_a_table_and_again(gasp, both, workplace):
    words = [
        "sweep",
        "scene.toml",
        "--set",
        "object.toy.height=0.3,-1",
        "--set",
        "engine.options.spin=1",
        "--jobs",
        "2",
    ]
    found = gasp(*words, "--engine", "frail")
    assert found.status == 0
    lines = found.out.splitlines()
    assert lines[0].split()[:3] == ["height", "STATUS", "SUBSTEPS"] and lines[0].split()[-1] == "toy.moved"
    assert lines[1].split()[:3] == ["0.3", "complete", "80"] and lines[2].split()[:3] == ["-1", "refused", "-"]
    assert "must be > 0" in found.out and "1 complete, 1 refused" in found.out
    with (workplace / "scene.sweep" / "sweep.csv").open() as stream:
        assert [row["status"] for row in csv.DictReader(stream)] == ["complete", "refused"]
    again = gasp(*words, "--engine", "frail")
    assert again.status == 0 and "2 were there already" in again.out
    other = gasp(*words, "--engine", "ballistic")
    assert other.status == 2 and "of another scene" in other.err and "--overwrite" in other.err


def test_json_and_a_table_of_settings(gasp, both, workplace):
    (workplace / "settings.csv").write_text("object.toy.height,scene.duration\n0.3,0.04\n0.4,\n")
    (workplace / "mine.py").write_text("def counted(recording):\n    return recording.frame_count\n")
    found = gasp(
        "sweep", "scene.toml", "--table", "settings.csv", "--observe", "mine.py:counted", "--json", "--out", "look"
    )
    assert (found.status, found.err) == (0, "")
    said = json.loads(found.out)
    assert [(row["object.toy.height"], row["status"], row["counted"]) for row in said["rows"]] == [
        (0.3, "complete", 2.0),
        (0.4, "complete", 3.0),
    ]


def test_preview_keeps_nothing(gasp, both, workplace):
    found = gasp("sweep", "scene.toml", "--set", "object.toy.height=0.3,0.4,-1", "--preview", "--jobs", "2")
    assert (found.status, found.err) == (0, "")
    above, _, below = found.out.partition("\n\n")
    said = dict(line.split(maxsplit=1) for line in above.splitlines())
    assert said["runs"].startswith("3, 2 at a time; 2 of them")
    assert below.startswith("refused: object.toy.height=-1\n  ") and "must be > 0" in below
    assert said["refused"] == "1, see below" and said["points"] == "256"
    assert "MB each" in said["memory"] and "between" in said["time"]
    assert not (workplace / "scene.sweep").exists()
    asked = gasp("sweep", "scene.toml", "--set", "object.toy.height=0.3,0.4", "--preview", "--json", "--keep")
    assert json.loads(asked.out)["disk"] > 1000


def test_where_nothing_came_to_its_end(gasp, both, workplace):
    found = gasp("sweep", "scene.toml", "--set", "engine.options.fault=open:refuse", "--set", "engine.name=frail")
    assert found.status == 2
    assert found.err.startswith("gasp: no run came to its end: unable: ")
    assert (workplace / "scene.sweep" / "sweep.csv").is_file()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["scene.toml"], ["--set KEY=V,V,.. or --table"]),
        (["scene.toml", "--set", "a=1", "--table", "b.csv"], ["one of the two"]),
        (["scene.toml", "--table", "none.csv"], ["none.csv"]),
        (["scene.toml", "--table", "none.csv", "--zip"], ["--zip"]),
        (["scene.toml", "--set", "object.toy.colour=1,2"], ["unknown key"]),
        (["scene.toml", "--set", "object.toy.height"], ["KEY=VALUE"]),
        (["nowhere.toml", "--set", "a=1"], ["nowhere.toml"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--engine", "balistic"], ["balistic", "ballistic"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--reference", "none.gasp"], ["none.gasp"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--observe", "none.py:f"], ["none.py"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--jobs", "0"], ["--jobs"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--time-limit", "nan"], ["time_limit"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--memory-limit", "big"], ["--memory-limit"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--scheduler", "tcp://a:1"], ["a scheduler is of dask or ray"]),
        (["scene.toml", "--set", "scene.duration=1,2", "--backend", "slurm"], ["--backend"]),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(refused, arguments, says):
    refused("sweep", *arguments, says=says)
