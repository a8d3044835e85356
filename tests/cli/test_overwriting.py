"""What is there already stays there, whichever command would write it, until it is told otherwise."""

import importlib.util

import pytest

from gasp_core.cli.command_group import BUILT_IN, gasp

WRITES_NOTHING = {"materials", "engines", "verify"}
HAS_A_FOLDER_OF_ITS_OWN = {"demo"}
needs_renderer = pytest.mark.skipif(
    importlib.util.find_spec("gasp_renderer") is None, reason="no renderer is installed (plugins/renderer)"
)

CASES = [
    pytest.param(["new", "toy.ply", "-o"], "theirs.toml", id="new"),
    pytest.param(["convert", "toy.ply"], "theirs.spz", id="convert"),
    pytest.param(["export", "scene.gasp", "--frame", 1, "-o"], "theirs.ply", id="export"),
    pytest.param(["inspect", "toy.ply", "--slices"], "theirs.png", id="inspect"),
    pytest.param(["render", "scene.gasp", "--size", 32, "-o"], "theirs.png", id="render", marks=needs_renderer),
    pytest.param(
        ["run", "scene.toml", "--out", "other.gasp", "--size", 32, "--render"],
        "theirs.png",
        id="run",
        marks=needs_renderer,
    ),
    pytest.param(["run", "scene.toml", "--preview", "--render"], "theirs.png", id="preview", marks=needs_renderer),
]


@pytest.fixture
def recorded(gasp, workplace):
    assert gasp("run", "scene.toml").status == 0


@pytest.mark.parametrize(("command", "name"), CASES)
def test_a_file_is_kept_until_it_is_said_to_be_replaced(command, name, gasp, refused, recorded, workplace):
    (workplace / name).write_bytes(b"precious")
    refused(*command, name, says=[f"{name} is there already: --overwrite replaces it"])
    outcome = gasp(*command, name, "--overwrite")
    assert outcome.status == 0, outcome.err
    assert (workplace / name).read_bytes() != b"precious"


def test_frames_are_kept_and_the_end_of_a_longer_film_goes(gasp, refused, recorded, workplace):
    assert gasp("export", "scene.gasp", "--all", "-o", "frames").status == 0
    (workplace / "frames" / "notes.txt").write_text("mine")
    refused("export", "scene.gasp", "--all", "-o", "frames", says=["frames/scene_0000.ply is there already"])
    assert gasp("run", "scene.toml", "--overwrite", "--frames", 2).status == 0
    assert gasp("export", "scene.gasp", "--all", "-o", "frames", "--overwrite").status == 0
    assert sorted(path.name for path in (workplace / "frames").iterdir()) == [
        "notes.txt",
        "scene_0000.ply",
        "scene_0001.ply",
    ]


def frames_under(folder):
    return {path: path.read_bytes() for path in folder.rglob("*.ply")}


def test_an_export_that_ends_early_leaves_the_earlier_one_as_it_was(gasp, recorded, workplace, interrupted_at):
    assert gasp("export", "scene.gasp", "--all", "-o", "frames").status == 0
    before = frames_under(workplace)
    interrupted_at("scene_0002.ply")
    assert gasp("export", "scene.gasp", "--all", "-o", "frames", "--overwrite").status != 0
    assert gasp("export", "scene.gasp", "--all", "-o", "others").status != 0
    assert frames_under(workplace) == before


@needs_renderer
def test_a_run_that_goes_on_goes_on_with_its_film(gasp, workplace):
    assert gasp("run", "scene.toml", "--render", "a.png", "--size", 32, "--frames", 2).status == 0
    short = (workplace / "a.png").read_bytes()
    assert gasp("run", "scene.toml", "--render", "a.png", "--size", 32, "--resume").status == 0
    assert (workplace / "a.png").read_bytes() != short


def test_every_command_that_writes_has_the_option():
    for name in BUILT_IN.keys() - WRITES_NOTHING - HAS_A_FOLDER_OF_ITS_OWN:
        command = gasp.get_command(None, name)
        for each in getattr(command, "commands", {name: command}).values():
            assert any("--overwrite" in option.opts for option in each.params), name
