"""A scene from the splat alone, keys set on the command line, and a first look."""

from pathlib import Path

import numpy as np
import pytest
from installed_engines import needs_renderer

from gasp_core import Recording, Rigid, load_scene, write_splat
from gasp_core.scene.standing import guess_up


def test_a_scene_for_a_splat_runs_as_it_is(gasp, workplace, toy):
    outcome = gasp("new", "toy.ply", "-o", "made.toml")
    assert (outcome.status, outcome.err) == (0, "")
    first, *_, last = outcome.out.splitlines()
    unsure = "" if guess_up(toy)[1] else " (a guess)"
    assert first == f"made.toml: 64 Gaussians, -y up{unsure}, 0.4 m tall (a guess), soft rubber (a guess)"
    assert last == "a first look: gasp run made.toml --preview"
    scene = load_scene("made.toml")
    (item,) = scene.objects
    assert (item.name, item.up, item.height, item.position) == ("toy", guess_up(toy)[0], 0.4, (0, 0, 0.2))
    assert len(scene.colliders) == 1 and scene.accuracy.resolution == 24
    text = Path("made.toml").read_text()
    assert "a guess: no file knows" in text and "gasp run made.toml --preview" in text


def test_what_is_said_is_not_guessed(gasp, workplace):
    told = gasp("new", "toy.ply", "-o", "made.toml", "--height", "1.7", "--material", "Wet-Sand", "--up", "+z")
    assert told.status == 0 and "guess" not in told.out
    (item,) = load_scene("made.toml").objects
    assert (item.height, item.up, item.material.name) == (1.7, "+z", "wet sand")
    assert "guess" not in Path("made.toml").read_text()


def test_a_scene_is_named_after_its_splat_and_finds_it_from_where_it_is(gasp, workplace, toy):
    (workplace / "there").mkdir()
    (workplace / "there" / "my bear.compressed.ply").write_bytes((workplace / "toy.ply").read_bytes())
    assert gasp("new", "there/my bear.compressed.ply").out.startswith("my bear.toml: ")
    assert load_scene("my bear.toml").objects[0].splat == Path("there/my bear.compressed.ply")
    (workplace / "here").mkdir()
    assert gasp("new", "toy.ply", "-o", "here/a.toml").status == 0
    assert load_scene("here/a.toml").objects[0].splat == workplace / "toy.ply"


@pytest.mark.parametrize(("material", "rigid"), [("stone", True), ("wood", True), ("steel", True), ("rubber", False)])
def test_what_is_hard_is_rigid(gasp, workplace, material, rigid):
    """Stone that is elastic springs back as rubber does."""
    assert gasp("new", "toy.ply", "-o", "made.toml", "--height", "1.7", "--material", material, "--yes").status == 0
    made = load_scene("made.toml").objects[0].material
    assert isinstance(made, Rigid) is rigid


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["none.ply"], ["none.ply"]),
        (["scene.toml"], ["scene.toml"]),
        (["toy.ply", "--height", "0"], ["--height"]),
        (["toy.ply", "--up", "y"], ["--up", "-y"]),
        (["toy.ply", "--material", "rubbre"], ['"rubbre"', "rubber"]),
        (["toy.ply", "-o", "none/a.toml"], ["none"]),
    ],
)
def test_what_no_scene_can_be_made_of(gasp, workplace, refused, arguments, says):
    before = sorted(workplace.iterdir())
    refused("new", *arguments, says=says)
    assert sorted(workplace.iterdir()) == before


def test_odd_names_and_odd_splats(gasp, workplace, toy):
    means = toy.means.copy()
    means[3] = np.nan
    name = 'a"b\\c [x].ply'
    write_splat(workplace / "odd.ply", toy.with_(means=means))
    (workplace / "odd.ply").rename(workplace / name)
    outcome = gasp("new", name, "-o", "made.toml")
    assert outcome.status == 0 and "odd: " in outcome.out
    assert load_scene("made.toml").objects[0].splat == Path(name)


def test_keys_are_set_on_the_command_line_and_said_again_by_the_hint(gasp, workplace, refused):
    assert gasp("run", "scene.toml", "--set", "scene.duration=0.04", "--set", "object.toy.height=0.5").status == 0
    recording = Recording.open("scene.gasp")
    assert recording.frame_count == 2 and recording.scene.objects[0].height == 0.5
    again = gasp("run", "scene.toml", "--set", "scene.duration=0.04", "--set", "object.toy.height=0.5", "--resume")
    assert again.status == 0
    refused("run", "scene.toml", "--set", "object.bear.height=1", says=['there is no object "bear", there is "toy"'])
    from gasp_core.cli.settings import Settings

    assert Settings(changes=("a.b=1", "c.d=2")).words() == ["--set", "a.b=1", "--set", "c.d=2"]


@needs_renderer
@pytest.mark.thorough
def test_a_first_look_is_coarse_short_and_made_anew(gasp, workplace):
    changes = ("--set", "scene.duration=5", "--set", "scene.frame_rate=50", "--set", "accuracy.resolution=40")
    for _ in range(2):
        outcome = gasp("run", "scene.toml", "--preview", *changes)
        assert outcome.status == 0, outcome
        assert "a first look, coarse: scene.preview.mp4; all of it: gasp run scene.toml" in outcome.out
    recording = Recording.open("scene.preview.gasp")
    assert recording.frame_count == 26 and recording.scene.accuracy.resolution == 12
    assert Path("scene.preview.mp4").stat().st_size > 1000 and not Path("scene.gasp").exists()


def test_a_first_look_is_of_whole_frames(workplace):
    from gasp_core.cli.run import previewed

    def looked(duration, frame_rate):
        changes = [f"scene.duration={duration}", f"scene.frame_rate={frame_rate}"]
        scene = previewed(load_scene("scene.toml", changes))
        return scene.duration, scene.frame_rate, scene.frame_count

    assert looked(5, 50) == (2.0, 12.5, 26)
    assert looked(0.5, 50) == (0.48, 12.5, 7)
    assert looked(1.1, 10) == (1.1, 10, 12)
    # Shorter than a frame of a first look.
    assert looked(0.06, 50) == (0.06, 50, 4)


def test_a_first_look_has_a_place_of_its_own(gasp, workplace, refused):
    for option in (["--resume"], ["--out", "a.gasp"], ["--dry-run"]):
        refused("run", "scene.toml", "--preview", *option, says=["--preview has a place of its own"])


def test_quiet_says_nothing_and_verbose_a_line_a_frame(gasp, workplace, refused):
    quiet = gasp("run", "scene.toml", "--quiet")
    assert (quiet.status, quiet.out, quiet.err) == (0, "", "")
    verbose = gasp("run", "scene.toml", "--overwrite", "--verbose")
    told = verbose.err.splitlines()
    assert verbose.status == 0 and [line.split(":")[0] for line in told] == ["frame 1", "frame 2"]
    assert "0.04 s, " in told[0] and " substeps, the smallest of " in told[0]
    refused("run", "scene.toml", "--quiet", "--verbose", says=["contradict each other"])


def test_a_frame_is_written_as_its_name_ends(gasp, workplace, refused):
    assert gasp("run", "scene.toml").status == 0
    for name in ("a.splat", "b.spz", "c.ply"):
        assert gasp("export", "scene.gasp", "--frame", 1, "-o", name).out == f"{name}\n"
        assert Path(name).stat().st_size > 0
    said = ("export", "scene.gasp", "--frame", "1", "-o", "d.splat", "--format", "ply")
    refused(*said, says=["d.splat does not end in .ply"])
    refused("export", "scene.gasp", "--frame", "1", "-o", "d.obj", says=["d.obj", ".splat"])


def test_a_shell_can_ask_how_a_command_goes_on(monkeypatch, capsys):
    from gasp_core.cli.main import main

    monkeypatch.setenv("_GASP_COMPLETE", "bash_source")
    assert main([]) == 0 and "_GASP_COMPLETE=bash_complete" in capsys.readouterr().out
    monkeypatch.setenv("_GASP_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "gasp ma")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert main([]) == 0 and "materials" in capsys.readouterr().out
