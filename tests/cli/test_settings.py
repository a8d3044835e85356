"""Resolution, device, precision and cores on the command line, the same words for every command."""

import json

import pytest

from gasp_core import Recording


def test_a_run_takes_resolution_and_cores_and_is_gone_on_with_by_the_same_words(gasp, workplace):
    told = gasp("run", "scene.toml", "--resolution", "12", "--cores", "0.25", "--device", "cpu", "--frames", "2")
    assert told.status == 0, told
    recording = Recording.open(workplace / "scene.gasp")
    assert recording.scene.accuracy.resolution == 12
    assert recording.scene.objects[0].reduction.fraction == 0.25
    assert recording.scene.engine.device == "cpu"
    again = gasp("run", "scene.toml", "--resume", "--resolution", "12", "--cores", "0.25", "--device", "cpu")
    assert (again.status, recording.status) == (0, "complete"), again
    other = gasp("run", "scene.toml", "--resume", "--resolution", "13", "--cores", "0.25", "--device", "cpu")
    assert other.status == 2
    assert "the scene, or a file that it names, has changed" in other.err


@pytest.mark.parametrize(
    ("cores", "mode", "fraction", "count"),
    [("all", "all", None, None), ("7", "cores", None, 7), ("1.0", "cores", 1.0, None), ("0.5", "cores", 0.5, None)],
)
def test_cores_are_a_share_a_number_or_all(gasp, workplace, cores, mode, fraction, count):
    assert gasp("run", "scene.toml", "--cores", cores, "--frames", "1").status == 0
    reduction = Recording.open(workplace / "scene.gasp").scene.objects[0].reduction
    assert (reduction.mode, reduction.fraction, reduction.count) == (mode, fraction, count)


def test_the_hint_after_a_stop_repeats_what_was_set():
    from gasp_core.cli.settings import Settings
    from gasp_core.contract import Precision

    settings = Settings(resolution=12, device="cuda", precision=Precision.FLOAT32, cores=0.1)
    words = "--resolution 12 --device cuda --precision float32 --cores 0.1"
    assert " ".join(settings.words()) == words
    assert Settings().words() == []


@pytest.mark.parametrize("command", ["run", "compare"])
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--resolution", "1"], ["--resolution"]),
        (["--precision", "half"], ["--precision", "float32"]),
        (["--cores", "0"], ["--cores", "share above 0"]),
        (["--cores", "-3"], ["--cores", '"-3"', "a whole number"]),
        (["--cores", "1.5"], ["--cores", "share above 0 up to 1"]),
        (["--cores", "nan"], ["--cores"]),
        (["--cores", "some"], ["--cores", '"all"']),
    ],
)
def test_what_no_setting_can_be_is_refused(refused, command, arguments, says):
    refused(command, "scene.toml", *arguments, says=says)


def test_a_device_or_precision_asked_for_by_name_is_not_replaced(refused):
    refused("run", "scene.toml", "--device", "moon", says=["moon", "cpu"])
    refused("run", "scene.toml", "--precision", "float32", says=["float32"])


@pytest.mark.thorough
def test_compare_and_tradeoff_take_a_device_too(gasp, refused, workplace):
    found = gasp("compare", "scene.toml", "--engines", "ballistic", "--device", "moon", "--size", "64")
    assert found.status == 2
    assert "moon" in found.err
    refused("tradeoff", "scene.toml", "--device", "moon", "--fractions", "all", "--repeats", "1", says=["moon"])


@pytest.fixture
def single(workplace):
    """A scene of another engine, on a device and in a precision that the engines of the tests do not have."""
    text = (workplace / "scene.toml").read_text()
    own = 'name = "warp-mpm"\nprecision = "float32"\ndevice = "cuda"'
    assert 'name = "ballistic"' in text
    (workplace / "single.toml").write_text(text.replace('name = "ballistic"', own))
    return workplace


def test_a_scene_in_single_precision_runs_with_an_engine_that_has_none(gasp, single):
    """With a real engine: the reference computes in double precision alone, and says so."""
    told = gasp("run", "single.toml", "--engine", "reference-mpm", "--resolution", "4")
    assert told.status == 0, told
    recording = Recording.open(single / "single.gasp")
    assert (recording.status, recording.engine.precision, recording.engine.device) == ("complete", "float64", "cpu")
    for note in (
        "reference-mpm does not run on cuda, which the scene names for warp-mpm: it runs on cpu",
        "reference-mpm does not compute in float32, which the scene names for warp-mpm: it computes in float64",
    ):
        assert note in told.out
        assert note in recording.notes


@pytest.mark.thorough
def test_a_comparison_tells_the_same_and_of_a_broken_engine_only_that_it_is_broken(gasp, installed, single):
    installed("ballistic", "unimportable")
    told = gasp("compare", "single.toml", "--engines", "ballistic,unimportable", "--size", "64", "--json")
    assert told.status == 0, told
    found = json.loads(told.out)
    assert [row["status"] for row in found["engines"]] == ["complete", "unable"]
    assert "installed but cannot be used" in found["engines"][1]["reason"]
    assert [note for note in found["notes"] if "the scene names" in note] == [
        "ballistic does not run on cuda, which the scene names for warp-mpm: it runs on cpu",
        "ballistic does not compute in float32, which the scene names for warp-mpm: it computes in float64",
    ]


@pytest.mark.thorough
def test_a_trade_tells_of_the_device_and_names_its_precisions_itself(gasp, single):
    few = ("--engine", "ballistic", "--resolutions", "6", "--fractions", "all", "--repeats", "1")
    told = gasp("tradeoff", "single.toml", *few, "--out", "trade")
    assert told.status == 0, told
    note = "ballistic does not run on cuda, which the scene names for warp-mpm: it runs on cpu"
    assert note in told.out.splitlines()
    assert json.loads((single / "trade" / "tradeoff.json").read_text())["notes"] == [note]
    named = gasp("tradeoff", "single.toml", *few, "--device", "cpu", "--out", "named", "--json")
    assert json.loads(named.out)["notes"] == []
