"""Films through the command line: `gasp render` and `gasp run --render`, with the renderer that is installed."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from installed_engines import needs_renderer
from PIL import Image

from gasp_core import Recording

FAKES = Path(__file__).parents[1] / "fake_plugins"


@pytest.fixture
def run(gasp, workplace):
    assert gasp("run", "scene.toml").status == 0
    return workplace / "scene.gasp"


def frame_count(path):
    import av

    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(container.streams.video[0]))


@needs_renderer
def test_a_film_a_sheet_and_pictures(gasp, run, workplace):
    outcome = gasp("render", run, "-o", "a.mp4", "-o", "a.png", "-o", "frames", "--size", "64x48")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.split() == ["a.mp4", "a.png", "frames"]
    assert frame_count("a.mp4") == 3
    first, *_, last = sorted(Path("frames").iterdir())
    assert np.asarray(Image.open(first)).shape == (48, 64, 3)
    assert not np.array_equal(np.asarray(Image.open(first)), np.asarray(Image.open(last)))
    assert not list(workplace.glob(".*"))


@needs_renderer
def test_without_a_name_the_film_is_called_after_the_run_and_a_picture_after_the_splat(gasp, run):
    assert gasp("render", "scene.gasp", "--size", "32").out.split() == ["scene.mp4"]
    assert gasp("render", "scene.gasp", "--size", "32", "--frame", 1).out.split() == ["scene.png"]
    assert gasp("render", "toy.ply", "--size", "32", "--up", "+z").out.split() == ["toy.png"]
    assert np.asarray(Image.open("toy.png")).shape == (32, 32, 3)


@needs_renderer
def test_a_scene_is_shown_as_it_begins(gasp, refused, workplace):
    assert gasp("render", "scene.toml", "--size", "48").out.split() == ["scene.png"]
    assert gasp("run", "scene.toml", "--frames", "1").status == 0
    assert gasp("render", "scene.gasp", "-o", "run.png", "--size", "48").status == 0
    # One frame is no motion, of a scene or of a run: the same camera, and the same picture.
    assert np.array_equal(np.asarray(Image.open("scene.png")), np.asarray(Image.open("run.png")))
    scene = workplace / "scene.toml"
    scene.write_text(scene.read_text().replace("toy.ply", "none.ply"))
    refused("render", "scene.toml", "-o", "other.png", says=["scene.toml", "none.ply"])


@needs_renderer
def test_cameras(gasp, run):
    pictures = []
    for options in (
        ["--camera", "front"],
        ["--camera", "top"],
        ["--from", 1, 1, 1, "--to", 0, 0, 0.2],
        ["--turntable"],
    ):
        outcome = gasp(
            "render", run, "-o", "frames", "--size", "48", "--background", "transparent", "--overwrite", *options
        )
        assert (outcome.status, outcome.err) == (0, ""), options
        pictures.append(np.asarray(Image.open("frames/frame_0001.png")))
        assert pictures[-1].shape == (48, 48, 4)
        assert (pictures[-1][:, :, 3] == 255).any(), options
    assert not any(np.array_equal(a, b) for a, b in itertools.pairwise(pictures))


@needs_renderer
def test_a_run_is_filmed_as_it_goes(gasp, workplace):
    outcome = gasp("run", "scene.toml", "--render", "a.mp4", "--render", "a.png", "--size", "64x36")
    assert (outcome.status, outcome.err) == (0, "")
    assert frame_count("a.mp4") == 3
    assert "gasp render" not in outcome.out


@needs_renderer
@pytest.mark.parametrize("there", [1, 2, 3])
def test_a_run_that_is_gone_on_with_is_filmed_from_its_beginning(gasp, workplace, there):
    """Killed between its last frame and the end of its film, too: then no frame is left to be computed."""
    gasp("run", "scene.toml", "--frames", there)
    outcome = gasp("run", "scene.toml", "--resume", "--render", "a.mp4", "--size", "64x36")
    assert (outcome.status, outcome.err) == (0, "")
    assert frame_count("a.mp4") == 3


@needs_renderer
def test_an_unfinished_run_is_shown_as_far_as_it_came(gasp, workplace):
    gasp("run", "scene.toml", "--frames", 2)
    assert gasp("render", "scene.gasp", "-o", "a.mp4", "--size", "32").status == 0
    assert frame_count("a.mp4") == 2


@needs_renderer
@pytest.mark.thorough
def test_a_run_that_is_still_going_is_shown_as_far_as_it_is(workplace, gasp):
    """Another process writes; this one films what is there at that moment."""
    scene = (workplace / "scene.toml").read_text().replace("duration = 0.08", "duration = 40")
    (workplace / "long.toml").write_text(scene)
    environment = os.environ | {"PYTHONPATH": str(FAKES / "ballistic")}
    writer = subprocess.Popen(
        [sys.executable, "-m", "gasp_core.cli.main", "run", "long.toml"],
        cwd=workplace,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        until = time.monotonic() + 60
        while not (workplace / "long.gasp" / "commits" / "00000002").exists():
            assert time.monotonic() < until and writer.poll() is None
            time.sleep(0.05)
        assert Recording.open("long.gasp").status == "running"
        outcome = gasp("render", "long.gasp", "-o", "a.png", "--size", "32")
        assert (outcome.status, outcome.err) == (0, "")
        assert writer.poll() is None
    finally:
        writer.send_signal(signal.SIGINT)
        writer.wait(60)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-o", "a.avi"], ["a.avi: can be a film (.mp4, .webm, .gif)"]),
        (["-o", "none/a.mp4"], ["none/a.mp4: there is no folder none"]),
        (["--size", "big"], ["must be WIDTHxHEIGHT in pixels", "gasp render --help"]),
        (["--size", "0x3"], ["width must be 1 to 16384"]),
        (["--size", "99999"], ["width must be 1 to 16384"]),
        (["--camera", "sideways"], ['no view "sideways"', "three-quarter"]),
        (["--camera", "none.json"], ["none.json: there is no such camera file"]),
        (["--from", "1", "1", "1"], ["--from and --to belong together"]),
        (["--from", "nan", "1", "1", "--to", "0", "0", "0"], ["--from, --to", "finite"]),
        (["--from", "1", "1", "1", "--to", "1", "1", "1"], ["must not be the position"]),
        (["--from", "1", "1", "1", "--to", "0", "0", "0", "--camera", "front"], ["contradict each other"]),
        (["--from", "1", "1", "1", "--to", "0", "0", "0", "--turntable"], ["a turntable starts from a named view"]),
        (["--frame", "3"], ["has frames 0 to 2, not 3"]),
        (["--background", "blurple"], ['background "blurple" is no colour']),
        (["--background", "transparent"], ["a film cannot be transparent"]),
        (["--slower", "0"], ["--slower"]),
        (["--slower", "nan"], ["slower must be a number"]),
        (["--up", "down"], ["--up must be one of +x"]),
        (["--renderer", "oil"], ['no renderer named "oil" is installed']),
    ],
)
@needs_renderer
def test_bad_arguments(run, refused, arguments, says):
    refused("render", "scene.gasp", *arguments, says=says)


def test_things_that_cannot_be_shown(refused, workplace):
    refused("render", "none.gasp", says=["none.gasp: there is no such recording, scene or splat file"])
    (workplace / "empty.gasp").mkdir()
    refused("render", "empty.gasp", says=["empty.gasp: is no recording"])


def test_without_a_renderer_it_says_what_to_install(run, refused, monkeypatch):
    from gasp_core.discovery import registry

    found = [plugin for plugin in registry.installed_plugins() if "renderer" not in plugin.name]
    monkeypatch.setattr(registry, "installed_plugins", lambda: found)
    registry.discover.cache_clear()
    refused("render", "scene.gasp", says=["no renderer is installed: pip install gasp-renderer"])
    refused("run", "scene.toml", "--out", "b.gasp", "--render", "a.mp4", says=["pip install gasp-renderer"])


@needs_renderer
def test_a_camera_in_a_file_of_its_own(gasp, refused, run, workplace):
    camera = workplace / "camera.toml"
    camera.write_text("[camera]\nposition = [1, 1, 1]\ntarget = [0, 0, 0.2]\n")
    assert gasp("render", run, "-o", "a.png", "--frame", 1, "--size", 48, "--camera", "camera.toml").status == 0
    said = ["--from", 1, 1, 1, "--to", 0, 0, 0.2]
    assert gasp("render", run, "-o", "b.png", "--frame", 1, "--size", 48, *said).status == 0
    assert np.array_equal(np.asarray(Image.open("a.png")), np.asarray(Image.open("b.png")))
    camera.write_text("[camera]\nposition = [1, 1, 1]\n")
    refused(
        "render",
        "scene.gasp",
        "--camera",
        "camera.toml",
        says=["camera.toml: camera.target: belongs to position: give both"],
    )
    camera.write_text("[scene]\nduration = 1\n")
    refused("render", "scene.gasp", "--camera", "camera.toml", says=["camera.toml: camera: missing"])
    refused("render", "scene.gasp", "--camera", "none.toml", says=["none.toml: no such scene file"])
