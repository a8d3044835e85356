import shutil
import time

import numpy as np
import pytest
from gasp_viewer.packing import PackedSplats
from gasp_viewer.server import free_port, serving
from gasp_viewer.session import Exhibit, Session, wait_for_frame

from gasp_core import Recording, pack
from gasp_core.errors import RecordingError
from gasp_core.io import write_splat
from gasp_core.rendering.footage import open_footage

HOST = "127.0.0.1"


class Viewing:
    """A session whose clock is ours."""

    def __init__(self, session):
        self.session, self.panel, self.now = session, session.panel, 0.0

    def step(self, elapsed=0.0, *, poll=False):
        """One turn; `poll` lets so much time go by that the run is looked at, at no elapsed time of the film."""
        self.now += 1.0 if poll else max(elapsed, 1e-3)
        self.session.step(self.now, elapsed)

    def until(self, condition):
        """Turn, without the film moving, until something has come from the background."""
        deadline = time.monotonic() + 60
        while not condition():
            assert time.monotonic() < deadline, "it does not come"
            self.step(poll=True)
            self.session.wait(0.02)

    def shown(self):
        """Where the picture on the page stands: the first Gaussian's centre, as packed."""
        return self.session.picture.packed.buffer[0, :3].view(np.float32).tolist()

    def text(self, name):
        handle = self.panel.texts[name]
        return handle.content if handle.visible else ""


@pytest.fixture
def watch():
    """Opens a session on a path."""
    sessions, contexts = [], []

    def go(path, *, layer="gaussians", colouring="trained", up="-y"):
        exhibit = Exhibit(open_footage(path, up))
        context = serving(HOST, free_port(HOST, 0), "test")
        server = context.__enter__()
        contexts.append(context)
        sessions.append(Session(exhibit, server, layer=layer, colouring=colouring))
        viewing = Viewing(sessions[-1])
        viewing.until(lambda: sessions[-1].picture is not None or viewing.text("message"))
        return viewing

    yield go
    for session in sessions:
        session.close()
    for context in contexts:
        context.__exit__(None, None, None)


@pytest.fixture
def copied(tmp_path, toy_run):
    """The toy's run, to be spoilt."""
    shutil.copytree(toy_run, tmp_path / "run.gasp")
    return tmp_path / "run.gasp"


@pytest.mark.parametrize("layer", ["gaussians", "triangles"])
def test_a_moving_splat_has_a_timeline_too(watch, toy_run, tmp_path, layer):
    pack(Recording.open(toy_run), tmp_path / "toy.moving.sog")
    viewing = watch(tmp_path / "toy.moving.sog", layer=layer)
    assert viewing.panel.controls["frame"].visible
    first = viewing.session.picture
    viewing.panel.controls["frame"].value = 5
    viewing.until(lambda: viewing.session.picture is not first)
    assert viewing.session.head.frame == 5
    assert "5 of 5" in viewing.text("facts") and "0.2 s" in viewing.text("facts")
    viewing.panel.press_play()
    viewing.step(0.04)
    assert viewing.session.head.playing and viewing.session.head.frame < 5


def test_the_timeline_shows_the_frame_it_is_moved_to(watch, toy_run):
    viewing = watch(toy_run)
    first = viewing.shown()
    viewing.panel.controls["frame"].value = 5
    viewing.until(lambda: viewing.shown() != first)
    assert viewing.session.head.frame == 5
    assert "5 of 5" in viewing.text("facts") and "0.2 s" in viewing.text("facts")
    viewing.panel.controls["frame"].value = 0
    viewing.until(lambda: viewing.shown() == first)


def test_play_moves_by_the_clock_and_stops_at_the_end(watch, toy_run):
    viewing = watch(toy_run)
    viewing.panel.controls["loop"].value = False
    viewing.until(lambda: viewing.session.packed == 6)
    viewing.panel.press_play()
    viewing.step()
    for expected in (1, 2, 3):
        viewing.step(0.0401)
        assert viewing.session.head.frame == expected == viewing.panel.controls["frame"].value
    viewing.panel.controls["speed"].value = 0.5
    viewing.step(0.0401)
    assert viewing.session.head.frame == 3
    viewing.panel.controls["speed"].value = 4.0
    viewing.step(0.4)
    assert viewing.session.head.frame == 5 and not viewing.session.head.playing


def test_the_film_holds_until_a_frame_is_packed(watch, toy_run):
    viewing = watch(toy_run)
    viewing.session.close()
    viewing.panel.controls["colouring"].value = "speed"
    viewing.step()
    viewing.panel.press_play()
    for _ in range(50):
        viewing.step(0.02)
    # Nothing is packed of it, nor will be: the packer has ended.
    assert viewing.session.head.frame == 0 and viewing.session.head.playing


def test_layers_and_colours_change_what_is_shown_and_the_legend_with_it(watch, toy_run):
    viewing = watch(toy_run)
    assert viewing.text("legend") == ""
    viewing.panel.controls["colouring"].value = "displacement"
    viewing.until(lambda: "displacement" in viewing.text("legend"))
    scale = viewing.session.picture.scale
    assert f"{scale.top:g} m" in viewing.text("legend")
    viewing.panel.controls["layer"].value = "triangles"
    viewing.until(lambda: not isinstance(viewing.session.picture.packed, PackedSplats))
    viewing.panel.controls["colouring"].value = "body"
    viewing.until(lambda: "toy" in viewing.text("legend"))


def test_a_page_that_sends_nonsense_changes_nothing(watch, toy_run):
    viewing = watch(toy_run)
    picture = viewing.session.picture
    for name, nonsense in (("layer", "ghosts"), ("colouring", "octarine"), ("speed", float("nan"))):
        viewing.panel.controls[name].value = nonsense
    viewing.step()
    assert viewing.session.picture is picture and viewing.panel.speed == 1.0
    viewing.panel.controls["frame"].value = 10**9
    viewing.step()
    assert viewing.session.head.frame == 5


def test_trained_colours_follow_the_camera_once_it_stands_still(watch, toy_run):
    stage = Exhibit(open_footage(toy_run)).stage
    viewing = watch(toy_run)
    viewing.until(lambda: viewing.session.packed == 6)
    before = viewing.session.picture
    there = np.array([0.0, 6.0, 1.0])
    viewing.session.camera_moved(there)
    viewing.step(0.01)
    viewing.session.camera_moved(there)
    viewing.step(0.2)
    viewing.step(0.05)
    # It moved a moment ago.
    assert viewing.session.picture is before
    viewing.until(lambda: viewing.session.picture is not before)
    eye = np.array(viewing.session.picture.eye)
    # The same place in the world, by the same arithmetic.
    np.testing.assert_array_equal(eye, stage.world(there))
    after = viewing.session.picture
    # The rim light of the toy moved: other colours, on the same shapes.
    assert (after.packed.buffer[:, 7] != before.packed.buffer[:, 7]).any()
    np.testing.assert_array_equal(after.packed.buffer[:, :7], before.packed.buffer[:, :7])
    # A hand's breadth is not worth packing anew.
    viewing.until(lambda: viewing.session.packed == 6)
    viewing.session.camera_moved(there + 0.1)
    for _ in range(5):
        viewing.step(0.2)
    assert viewing.session.picture is after


def test_a_file_is_one_picture_without_a_film(watch, tmp_path, toy):
    write_splat(tmp_path / "toy.ply", toy)
    viewing = watch(tmp_path / "toy.ply", up="+z")
    assert not viewing.panel.controls["frame"].visible
    assert not viewing.panel.controls["colouring"].visible
    assert "toy.ply" in viewing.text("facts")


def test_a_real_splat_is_shown_upright(watch, data):
    viewing = watch(data / "splats" / "playbot" / "4_0")
    centres = viewing.session.picture.packed.buffer[:, :3].view(np.float32)
    assert len(centres) == 8406
    # A robot above a square of ground: wider than high, and most Gaussians are of the ground.
    extent = np.ptp(centres, axis=0)
    assert extent[2] < extent[0] and extent[2] < extent[1]
    assert np.median(centres[:, 2]) < (centres[:, 2].min() + centres[:, 2].max()) / 2
    assert "8,406" in viewing.text("facts")
    viewing.panel.controls["layer"].value = "triangles"
    viewing.until(lambda: not isinstance(viewing.session.picture.packed, PackedSplats))
    viewing.until(lambda: "triangles, drawn at random" in viewing.text("facts"))


def test_a_run_that_goes_on_is_followed_and_may_be_looked_back_at(watch, gated_run):
    gated_run.let(1)
    viewing = watch(gated_run.path)
    assert viewing.panel.controls["follow"].visible and viewing.panel.follow
    viewing.until(lambda: viewing.session.head.frame == 1)
    gated_run.let(3)
    viewing.until(lambda: viewing.session.head.frame == 3)
    assert viewing.panel.controls["frame"].max == 3
    viewing.panel.controls["frame"].value = 1
    viewing.step(poll=True)
    assert not viewing.panel.follow
    gated_run.let(4)
    viewing.until(lambda: viewing.panel.controls["frame"].max == 4)
    assert viewing.session.head.frame == 1
    gated_run.kill()
    viewing.until(lambda: "incomplete: the process that wrote it ended" in viewing.text("facts"))
    assert not viewing.panel.controls["follow"].visible


def test_frames_that_are_taken_back_move_the_timeline_back(watch, copied):
    viewing = watch(copied)
    viewing.panel.controls["frame"].value = 5
    viewing.until(lambda: "5 of 5" in viewing.text("facts"))
    for frame in (5, 4):
        shutil.rmtree(copied / "commits" / f"{frame:08d}")
    viewing.until(lambda: "3 of 3" in viewing.text("facts"))
    assert viewing.session.head.frame == 3 and viewing.text("message") == ""


def test_a_run_that_vanishes_is_a_message_and_the_picture_stays(watch, copied):
    viewing = watch(copied)
    viewing.panel.press_play()
    viewing.step()
    picture = viewing.session.picture
    shutil.rmtree(copied)
    viewing.until(lambda: viewing.text("message"))
    assert "run.gasp" in viewing.text("message")
    assert viewing.session.picture is picture and not viewing.session.head.playing


def test_another_run_in_its_place_is_a_message(watch, copied, toy, scene_of, record):
    viewing = watch(copied)
    # All frames are packed, so that the engine's maps and the packer's do not run at once.
    viewing.panel.controls["frame"].value = 4
    viewing.until(lambda: "4 of 5" in viewing.text("facts") and viewing.session.packed == 6)
    record(scene_of(toy.select(np.arange(500))), copied, overwrite=True)
    viewing.until(lambda: "Another run is here now" in viewing.text("message"))
    for frame in range(6):
        viewing.panel.controls["frame"].value = frame
        viewing.step(poll=True)


@pytest.mark.parametrize("frame", [0, 2])
def test_a_damaged_frame_is_a_message_and_the_others_can_be_seen(watch, copied, frame):
    chunk = copied / "frames" / "displacements" / f"c.{frame}.0.0"
    chunk.write_bytes(chunk.read_bytes()[:10])
    viewing = watch(copied)
    viewing.panel.controls["frame"].value = frame
    viewing.until(lambda: f"frame {frame} is damaged" in viewing.text("message"))
    viewing.panel.controls["frame"].value = 3
    viewing.until(lambda: viewing.text("message") == "" and "3 of 5" in viewing.text("facts"))


def test_names_are_no_markup(watch, tmp_path, toy, scene_of, record):
    record(scene_of(toy.select(np.arange(100)), name="<img src=x>", frames=2), tmp_path / "run.gasp")
    viewing = watch(tmp_path / "run.gasp", colouring="body")
    viewing.until(lambda: viewing.text("legend"))
    assert "<img" not in viewing.text("legend") and "&lt;img src=x&gt;" in viewing.text("legend")


def test_waiting_for_the_first_frame(gated_run, tmp_path):
    path = gated_run.path
    gated_run.let(0)
    (path / "commits" / "00000000").rename(tmp_path / "aside")
    said = []

    def say(sentence):
        said.append(sentence)
        (tmp_path / "aside").rename(path / "commits" / "00000000")

    wait_for_frame(open_footage(path), say=say, pause=0.01)
    assert said == [f"{path}: is running and holds no frame yet, waiting for the first"]


def test_a_run_that_dies_before_its_first_frame(gated_run, tmp_path):
    path = gated_run.path
    gated_run.let(0)
    (path / "commits" / "00000000").rename(tmp_path / "aside")
    with pytest.raises(RecordingError, match="holds no frame, and nothing writes to it"):
        wait_for_frame(open_footage(path), say=lambda sentence: gated_run.kill(), pause=0.01)


def test_a_scene_is_shown_as_it_begins(watch, tmp_path, toy):
    write_splat(tmp_path / "toy.ply", toy)
    (tmp_path / "scene.toml").write_text(
        "[scene]\nduration = 1\nframe_rate = 10\n"
        '[[object]]\nname = "toy"\nsplat = "toy.ply"\nup = "+z"\nheight = 0.3\nposition = [0, 0, 0.2]\n'
        'material = "rubber"\n'
        '[[collider]]\nshape = "plane"\nheight = 0\n'
    )
    for layer in ("gaussians", "triangles"):
        viewing = watch(tmp_path / "scene.toml", layer=layer)
        viewing.until(lambda shown=viewing: shown.session.picture is not None)
        assert viewing.text("message") == ""
    assert open_footage(tmp_path / "scene.toml").positions(0)[:, 2].min() > 0.15


def test_views_are_kept_in_the_world_at_the_time_of_the_film(watch, toy_run):
    viewing = watch(toy_run)
    session, stage = viewing.session, Exhibit(open_footage(toy_run)).stage

    def camera(place):
        return type(
            "Camera", (), {"position": stage.place(place), "look_at": stage.place((0, 0, 0.1)), "fov": np.pi / 4}
        )

    session.panel.set_shots(session.keep_view(camera((1, -2, 0.5))))
    assert "position = [1, -2, 0.5]" in viewing.text("camera") and "field_of_view = 45" in viewing.text("camera")
    viewing.panel.controls["frame"].value = 5
    viewing.until(lambda: session.head.frame == 5)
    text = session.keep_view(camera((3, 0, 0.5)))
    assert "time = 0, position = [1, -2, 0.5]" in text and "time = 0.2, position = [3, 0, 0.5]" in text
    assert session.keep_view(None) == ""
