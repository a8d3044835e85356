import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core.errors import RenderingError
from gasp_core.rendering.footage import RecordedFootage, open_footage
from gasp_core.rendering.framing import Motion, frame_motion, motion_of
from gasp_core.scene.settings import VIEWS


def at_once(points):
    return Motion(points=points, frames=np.zeros(len(points), dtype=int))


def shaped(seed, stretch, offset):
    rng = np.random.default_rng(seed)
    return at_once(rng.normal(size=(50, 3)) * stretch + offset)


sizes = st.integers(1, 4000)
stretches = st.tuples(*[st.floats(1e-3, 1e2)] * 3).map(np.array)
offsets = st.tuples(*[st.floats(-1e4, 1e4)] * 3).map(np.array)


@given(st.integers(0, 10), stretches, offsets, sizes, sizes, st.sampled_from(sorted(VIEWS)))
@settings(max_examples=50, deadline=None)
def test_everything_is_in_the_picture(seed, stretch, offset, width, height, view):
    motion = shaped(seed, stretch, offset)
    camera = frame_motion(motion, width=width, height=height, around=VIEWS[view][0], above=VIEWS[view][1])
    places, depths = camera.project(motion.points)
    assert (depths > camera.near).all()
    # The margin of 8 % is to one side at most, and the aim, found in three rounds, is off by less than that.
    assert (places > 0).all() and (places < [width, height]).all()


@pytest.mark.parametrize("view", sorted(VIEWS))
def test_the_picture_is_filled_one_way_or_the_other(view):
    motion = shaped(0, np.array([1.0, 2.0, 0.5]), 0.0)
    camera = frame_motion(motion, width=800, height=600, around=VIEWS[view][0], above=VIEWS[view][1])
    places, _ = camera.project(motion.points)
    filled = (np.ptp(places, axis=0) / [800, 600]).max()
    # 1 / 1.08 were the sides alike; perspective makes the nearer one larger.
    assert filled > 0.8


def test_what_has_no_finite_place_is_not_framed_and_nothing_is_an_error():
    class Footage:
        path, frame_count = "flown.gasp", 1

        def __init__(self, places):
            self.places = np.array(places)

        def positions(self, frame):
            return self.places

    seen = motion_of(Footage([[0.0, 0, 0], [1, 1, 1], [np.nan, 0, 0], [0, np.inf, 0]]))
    assert (seen.lower == 0).all() and (seen.upper == 1).all()
    with pytest.raises(RenderingError, match=r"flown\.gasp: .*nothing to see"):
        motion_of(Footage([[np.nan, 0, 0]]))


def test_the_front_looks_along_y_and_right_is_on_the_right():
    motion = at_once(np.array([[-1.0, 0, 0], [1, 0, 1]]))
    front = frame_motion(motion, width=100, height=100, around=0, above=0)
    assert front.rotation[2] == pytest.approx([0, 1, 0])
    right = frame_motion(motion, width=100, height=100, around=90, above=0)
    assert right.position[0] > 1


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.full((4, 3), 1e4), np.array([[0, 0, 0], [0, 0, 1e-9]])])
def test_a_motion_without_extent_is_seen(points):
    camera = frame_motion(at_once(points), width=64, height=64, around=35, above=18)
    places, depths = camera.project(points)
    assert (depths > camera.near).all()
    assert places == pytest.approx(np.full((len(points), 2), 32), abs=32)


def test_the_whole_fall_is_measured(recording):
    footage = RecordedFootage(recording)
    whole, first = motion_of(footage), motion_of(footage, [0])
    # The engine of the tests lets everything fall freely for 0.24 s, in steps of 1 ms of first order.
    assert first.lower[2] - whole.lower[2] == pytest.approx(9.81 * 0.24**2 / 2, rel=0.01)
    assert whole.upper[2] == pytest.approx(first.upper[2])


def test_positions_are_the_means_of_what_is_drawn(recording):
    footage = RecordedFootage(recording)
    assert np.sort(footage.positions(5), axis=0) == pytest.approx(np.sort(footage.splats(5).means, axis=0), abs=1e-6)


def test_no_frame_no_camera(recording):
    with pytest.raises(RenderingError, match="holds no frame yet"):
        motion_of(RecordedFootage(recording), [])


def test_one_far_floater_does_not_make_the_rest_small():
    class Footage:
        frame_count = 1

        def positions(self, frame):
            cloud = np.random.default_rng(0).uniform(-1, 1, size=(3000, 3))
            cloud[0] = 1000
            return cloud

    motion = motion_of(Footage())
    assert np.abs(motion.points).max() <= 1
    assert motion.reach > 3.2  # of 2 sqrt 3, less what is outermost


def test_a_splat_file_stands_upright(data):
    still = open_footage(data / "splats" / "plant.splat")
    extent = np.ptp(motion_of(still).points, axis=0)
    # MANIFEST.md: y down, and a plant in its pot is taller than wide.
    assert extent[2] > 1.5 * extent[0] and extent[2] > 1.5 * extent[1]
