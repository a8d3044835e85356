"""What moves by itself, through the command line: run, film, export, and a run's own frames as a motion."""

import importlib.util

import numpy as np
import pytest

from gasp_core import Recording, Scene, SplatObject, read_splat
from gasp_core.dynamics.placed_scene import place_scene
from gasp_core.rendering.footage import open_footage

SWAY = """\
def sway(simplices, s):
    simplices[..., 0] += s * simplices[..., 2]
    return simplices
"""
SWAYING = '[object.motion]\nkind = "python"\nfunction = "sway:sway"\nrate = 2\n\n[engine]'
FRAMES = '[object.motion]\nkind = "frames"\n\n[engine]'


@pytest.fixture
def scene(workplace):
    """Writes the scene with a motion; the toy falls as ever."""

    def write(motion, name="moving.toml", splat="toy.ply"):
        text = (workplace / "scene.toml").read_text().replace("[engine]", motion).replace("toy.ply", splat)
        (workplace / name).write_text(text)
        return workplace / name

    return write


def test_a_function_beside_the_scene(gasp, workplace, scene, toy):
    (workplace / "sway.py").write_text(SWAY)
    assert gasp("run", scene(SWAYING), "--trust-code").status == 0
    assert gasp("run", "scene.toml").status == 0
    moved, still = (Recording.open(workplace / name) for name in ("moving.gasp", "scene.gasp"))
    # The toy is scaled to 0.3 m and not turned; at frame 2 psi has sheared it by s = 2 * 0.08.
    shift = moved.gaussians(2).means - still.gaussians(2).means
    expected = 0.16 * toy.means[:, 2] * moved.placement("toy").scale
    np.testing.assert_allclose(shift[:, 0], expected, atol=1e-6)
    np.testing.assert_allclose(shift[:, 1:], 0.0, atol=1e-6)
    (workplace / "sway.py").unlink()
    assert gasp("export", "moving.gasp", "--all", "--out", "frames").status == 0
    exported = read_splat(sorted((workplace / "frames").iterdir())[2])
    np.testing.assert_allclose(exported.means, moved.gaussians(2).means, atol=1e-6)
    np.testing.assert_allclose(open_footage("moving.gasp").positions(2), moved.gaussians(2).means, atol=1e-6)


def test_frames_that_lie_as_trained_splats_do_are_read_as_they_stood(gasp, workplace, scene):
    assert gasp("run", "scene.toml").status == 0
    assert gasp("export", "scene.gasp", "--frame", "2", "--up", "-y", "-o", "lying.ply").status == 0
    item = SplatObject(name="again", splat=workplace / "lying.ply", static=True)
    stood = place_scene(Scene(duration=1.0, frame_rate=1, objects=(item,))).gaussians
    np.testing.assert_allclose(stood.means, Recording.open(workplace / "scene.gasp").gaussians(2).means, atol=1e-6)


def test_the_frames_of_a_run_are_a_motion(gasp, workplace, scene):
    """A toy that falls by psi, three frames of a run, and by physics again: twice as far."""
    assert gasp("run", "scene.toml").status == 0
    assert gasp("export", "scene.gasp", "--all", "--out", "frames").status == 0
    again = scene(FRAMES, splat="frames")
    again.write_text(again.read_text().replace("height = 0.3\nposition = [0, 0, 0.2]\n", ""))
    assert gasp("run", again).status == 0
    first, twice = (Recording.open(workplace / name) for name in ("scene.gasp", "moving.gasp"))
    fallen = first.gaussians(2).means - first.gaussians(0).means
    np.testing.assert_allclose(twice.gaussians(2).means, first.gaussians(0).means + 2 * fallen, atol=1e-6)


# The core works without a renderer, which is a plugin; `make test` installs it.
@pytest.mark.skipif(
    importlib.util.find_spec("gasp_renderer") is None, reason="no renderer here: pip install -e plugins/renderer"
)
@pytest.mark.thorough
def test_a_film_of_it(gasp, workplace, scene):
    (workplace / "sway.py").write_text(SWAY)
    outcome = gasp("run", scene(SWAYING), "--trust-code", "--render", "film.mp4", "--size", "64x48")
    assert outcome.status == 0
    assert (workplace / "film.mp4").stat().st_size > 0
    assert gasp("render", "moving.gasp", "-o", "sheet.png", "--size", "64x48").status == 0


def test_what_cannot_be_played(refused, workplace, scene):
    refused("run", scene(SWAYING), "--trust-code", says=["motion sway:sway", "No module named 'sway'"])
    refused("run", scene(FRAMES), says=["toy.ply", "is no folder", "a splat for each frame"])
    (workplace / "empty").mkdir()
    refused("run", scene(FRAMES, splat="empty"), says=["empty", "is empty"])
    refused("run", scene("[engine]", splat="empty"), says=["folder of frames wants motion"])
    late = FRAMES.replace('"frames"', '"frames"\nstart = 5')
    (workplace / "one").mkdir()
    (workplace / "toy.ply").rename(workplace / "one" / "toy.ply")
    refused("run", scene(late, splat="one"), says=['object "toy"', "start = 5 s", "its last, at 0 s"])
