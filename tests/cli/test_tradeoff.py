"""Error against time from the command line: what it says, what it leaves, and what it refuses."""

import csv
import json

import pytest

from gasp_core import Recording

TRUTH = """\
import numpy as np
def falls(points, time):
    return points + np.array([0, 0, -9.81]) * time**2 / 2
def falls_late(points, time):
    return falls(points, time) + [0.3 * time, 0, 0]
def is_short(points, time):
    return points[1:]
def is_nan(points, time):
    return points * np.where(time > 0.05, np.nan, 1)
def fails(points, time):
    raise RuntimeError("no idea")
def works_in_place(points, time):
    points[:, 2] -= 9.81 * time**2 / 2
    return points
number = 7
"""


@pytest.fixture
def truth(workplace):
    (workplace / "truth.py").write_text(TRUTH)
    return workplace


@pytest.mark.thorough
def test_a_closed_form(gasp, truth):
    outcome = gasp(
        *("tradeoff", "scene.toml", "--resolutions", "8,12", "--fractions", "all,0.5", "--precisions", "float64"),
        *("--repeats", 2, "--truth", "truth.py:falls_late"),
    )
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.splitlines()[0].split()[:4] == ["RESOLUTION", "CORES", "PRECISION", "SUBSTEP"]
    assert "errors are against the closed form truth.py:falls_late" in outcome.out
    folder = truth / "scene.tradeoff"
    assert sorted(path.name for path in folder.iterdir()) == [
        f"tradeoff.{ending}" for ending in ("csv", "json", "png", "svg")
    ]
    told = json.loads((folder / "tradeoff.json").read_text())
    assert len(told["settings"]) == 4
    first = told["settings"][0]
    # 0.3 t at 0, 0.04 and 0.08 s, over the diagonal of a toy 0.3 m high.
    expected = 0.3 * 0.04 * ((0 + 1 + 4) / 3) ** 0.5
    diagonal = first["error_share"] / expected
    for row in told["settings"]:
        assert row["error_share"] == pytest.approx(expected * diagonal, rel=1e-5)
        # All of it is the centre's, and nobody is unsure of it.
        assert row["centre_share"] == pytest.approx(row["error_share"], rel=1e-5)
        assert row["shape_share"] < 1e-6
        assert row["error_low"] == row["error_share"] == row["error_high"]
        assert len(row["run_seconds_of_repeats"]) == 2
        assert row["run_seconds_low"] <= row["run_seconds"] <= row["run_seconds_high"]
        assert not row["repeats_differ"]
        assert row["points"] > 0 and row["substeps"] == 2
    assert told["machine"]["versions"]["numpy"]
    with (folder / "tradeoff.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["resolution"], row["cores"]) for row in rows] == [
        (resolution, cores) for resolution in ("8", "12") for cores in ("all", "0.5")
    ]
    assert rows[0]["reason"] == ""
    assert (folder / "tradeoff.png").read_bytes()[:4] == b"\x89PNG"
    assert b"</svg>" in (folder / "tradeoff.svg").read_bytes()
    again = gasp("tradeoff", "scene.toml", "--truth", "truth.py:falls")
    assert again.status == 2 and "there is a result already" in again.err


@pytest.mark.thorough
def test_a_finer_run_as_truth_and_a_row_that_cannot_be(gasp, workplace):
    """What flies in closed form is right at any resolution; the engine has no float32."""
    outcome = gasp(
        *("tradeoff", "scene.toml", "--resolutions", "6", "--fractions", "all", "--precisions", "float32,float64"),
        *("--repeats", 1, "--json", "--keep", "--out", "kept"),
    )
    assert (outcome.status, outcome.err) == (0, "")
    told = json.loads(outcome.out)
    single, double = told["settings"]
    assert single["ending"] == "unable" and "float32" in single["reason"]
    assert single["error_share"] is None and not single["on_front"]
    assert double["ending"] == "complete" and double["on_front"]
    # Displacements are kept as float32, and vertices at other spacings lie elsewhere.
    assert double["error_share"] < 1e-6
    assert told["truth"]["resolutions"] == [4, 6, 9]
    assert Recording.open(workplace / "kept" / "recordings" / "6-all-float64-0.5.gasp").status == "complete"


@pytest.mark.thorough
def test_a_crash_is_a_row_and_where_all_crash_nothing_is_left(gasp, truth, installed):
    installed("frail", "ballistic")
    scene = truth / "scene.toml"
    text = scene.read_text()
    scene.write_text(text.replace("ballistic", "frail") + '[engine.options]\nfault = "segfault"\nfault_time = 0.06\n')
    before = {path.name for path in truth.iterdir()} | {"__pycache__"}
    few = ("--resolutions", "8", "--fractions", "all", "--repeats", 1)
    outcome = gasp("tradeoff", "scene.toml", *few, "--truth", "truth.py:falls")
    assert outcome.status == 2
    assert "none of 1 settings could be run: crashed" in outcome.err
    outcome = gasp("tradeoff", "scene.toml", *few)
    assert outcome.status == 2
    assert "the truth cannot be made" in outcome.err and "closed form" in outcome.err
    # Python may keep what it compiled beside truth.py.
    assert {path.name for path in truth.iterdir()} <= before


@pytest.mark.thorough
def test_what_is_there_already_is_not_touched(refused, gasp, truth):
    mine = truth / "scene.tradeoff" / "recordings"
    mine.mkdir(parents=True)
    (mine / "vinyl.txt").write_text("all I have")
    few = ("--resolutions", "8", "--fractions", "all", "--repeats", 1, "--truth", "truth.py:works_in_place")
    refused("tradeoff", "scene.toml", *few, says=["is left from before"])
    refused("tradeoff", "scene.toml", *few, "--overwrite", says=["vinyl.txt", "choose another --out"])
    (mine / "vinyl.txt").rename(mine / "left.gasp")
    refused("tradeoff", "scene.toml", *few, "--overwrite", says=["left.gasp", "choose another --out"])
    (mine / "left.gasp").unlink()
    assert gasp("run", "scene.toml", "--out", mine / "left.gasp").status == 0
    outcome = gasp("tradeoff", "scene.toml", *few, "--overwrite")
    assert outcome.status == 0
    assert not mine.exists()


@pytest.mark.parametrize(
    "name",
    [
        "is_short",
        pytest.param("is_nan", marks=pytest.mark.thorough),
        pytest.param("fails", marks=pytest.mark.thorough),
    ],
)
def test_a_truth_that_is_none(gasp, truth, name):
    outcome = gasp(
        *("tradeoff", "scene.toml", "--resolutions", "8", "--fractions", "all", "--repeats", 1),
        *("--truth", f"truth.py:{name}"),
    )
    assert outcome.status == 2
    says = {"is_short": "expected (", "is_nan": "is not finite at", "fails": "RuntimeError: no idea"}[name]
    assert f"truth truth.py:{name} at 0" in outcome.err and says in outcome.err
    assert not (truth / "scene.tradeoff").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--engine", "nothing"], ['no engine named "nothing"']),
        (["--resolutions", "0"], ["--resolutions", "whole numbers from 2", 'found "0"']),
        (["--resolutions", "8,,9"], ["--resolutions", 'found ""']),
        (["--fractions", "0"], ["--fractions", 'or "all"', 'found "0"']),
        (["--fractions", "all,2"], ["--fractions", 'found "2"']),
        (["--fractions", "nan"], ["--fractions", 'found "nan"']),
        (["--precisions", "float16"], ["--precisions", "float32 or float64"]),
        (["--substep-fractions", "1.5"], ["--substep-fractions", 'found "1.5"']),
        (["--repeats", "0"], ["--repeats", "0"]),
        (["--time-limit", "0"], ["--time-limit"]),
        (["--truth", "absent.py:position"], ["there is no file absent.py"]),
        (["--truth", "scene.toml"], ["FILE.py:FUNCTION"]),
        (["--out", "toy.ply"], ["toy.ply", "choose a folder"]),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_run(refused, arguments, says):
    refused("tradeoff", "scene.toml", *arguments, says=says)


def test_a_spacing_in_the_scene_wants_resolutions(refused, workplace):
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text() + "[accuracy]\nspacing = 0.01\n")
    refused("tradeoff", "scene.toml", says=["names a spacing", "--resolutions"])
