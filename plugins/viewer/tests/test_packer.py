import queue
import threading

import numpy as np
import pytest
from gasp_viewer.colouring import Scale
from gasp_viewer.layers import PackedPoints
from gasp_viewer.packer import Failure, Packer, Picture, Want, nearest_first
from gasp_viewer.painter import Subject

from gasp_core.errors import RecordingError

TRAINED = Subject(layer="points", colouring="trained")
SPEED = Subject(layer="points", colouring="speed")
HERE, THERE = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
PACKED = PackedPoints(points=np.zeros((100, 3), np.float32), colours=np.zeros((100, 3), np.uint8), size=1.0)


class Painted:
    """Paints at once, one frame each time it is let; remembers what."""

    def __init__(self):
        self.turns = threading.Semaphore(0)
        self.done = []
        self.top = 1.0
        self.fault = None

    def scale(self, colouring, count):
        return None if colouring == "trained" else Scale(name=colouring, unit="", top=self.top)

    def paint(self, subject, frame, scale, eye):
        self.turns.acquire()
        self.done.append((subject.colouring, frame, eye))
        if self.fault is not None and frame == 2:
            raise self.fault
        return PACKED


@pytest.fixture
def bench():
    """A packer, its painter, and `pack(n)` that lets it pack n more frames and waits until it has."""
    painter, news, packers = Painted(), queue.Queue(), []

    def make(**options):
        packers.append(Packer(painter, lambda: news.put(None), **options))

        def pack(count):
            for _ in range(count):
                painter.turns.release()
                news.get(timeout=30)

        return packers[0], painter, pack

    yield make
    for packer in packers:
        painter.turns.release()
        packer.stop()


def want(subject=TRAINED, frame=0, count=6, eye=HERE):
    return Want(subject=subject, frame=frame, count=count, eye=eye)


def test_what_is_ahead_comes_before_what_is_behind_and_the_film_is_a_ring():
    assert nearest_first(3, 8).tolist() == [3, 4, 2, 5, 6, 1, 7, 0]
    assert nearest_first(7, 8).tolist() == [7, 0, 1, 6, 2, 3, 5, 4]
    assert nearest_first(0, 1).tolist() == [0]


def test_frames_are_packed_from_the_playhead_on(bench):
    packer, painter, pack = bench()
    packer.ask(want(frame=2))
    pack(6)
    assert [frame for _, frame, _ in painter.done] == nearest_first(2, 6).tolist()
    assert all(isinstance(packer.picture(frame), Picture) for frame in range(6))
    assert packer.kept_bytes == 6 * PACKED.nbytes


def test_a_playhead_that_moves_is_followed(bench):
    packer, painter, pack = bench()
    packer.ask(want(frame=0, count=100))
    pack(2)
    packer.ask(want(frame=50, count=100))
    pack(3)
    # The third was begun before the playhead moved.
    assert [frame for _, frame, _ in painter.done] == [0, 1, 2, 50, 51]


def test_memory_is_bounded_and_what_is_far_goes_first(bench):
    packer, _, pack = bench(memory=3 * PACKED.nbytes)
    packer.ask(want(count=20))
    pack(3)
    assert packer.kept_bytes == 3 * PACKED.nbytes
    packer.ask(want(frame=10, count=20))
    pack(3)
    assert packer.kept_bytes == 3 * PACKED.nbytes
    assert [frame for frame in range(20) if packer.picture(frame) is not None] == sorted(nearest_first(10, 20)[:3])


def test_one_frame_is_kept_whatever_the_memory(bench):
    packer, _, pack = bench(memory=1)
    packer.ask(want(count=20))
    pack(1)
    assert isinstance(packer.picture(0), Picture)


def test_another_subject_begins_from_nothing(bench):
    packer, _, pack = bench()
    packer.ask(want())
    pack(6)
    packer.ask(want(subject=SPEED))
    assert packer.picture(0) is None
    pack(1)
    assert packer.picture(0).scale == Scale(name="speed", unit="", top=1.0)


def test_another_eye_keeps_what_there_is_until_it_is_packed_anew(bench):
    packer, painter, pack = bench()
    packer.ask(want(count=3))
    pack(2)
    packer.ask(want(count=3, eye=THERE))
    # Frame 2 was under way for the old eye; then the frame looked at, then the others.
    assert packer.picture(1).eye == HERE
    pack(4)
    assert painter.done[2:] == [
        ("trained", 2, HERE),
        ("trained", 0, THERE),
        ("trained", 1, THERE),
        ("trained", 2, THERE),
    ]


def test_a_range_that_grows_leaves_no_frame_of_the_old_one(bench):
    packer, painter, pack = bench()
    packer.ask(want(subject=SPEED, count=3))
    pack(3)
    painter.top = 2.0
    packer.ask(want(subject=SPEED, count=4))
    pack(1)
    kept = [packer.picture(frame) for frame in range(4)]
    assert {picture.scale.top for picture in kept if picture is not None} == {2.0}
    pack(3)
    assert all(packer.picture(frame).scale.top == 2.0 for frame in range(4))


@pytest.mark.parametrize("fault", [RecordingError("frame 2 is damaged"), OSError("frame 2 is damaged")])
def test_a_damaged_frame_is_reported_and_the_others_go_on(bench, fault):
    packer, painter, pack = bench()
    painter.fault = fault
    packer.ask(want())
    pack(6)
    assert packer.picture(2) == Failure(message="frame 2 is damaged")
    assert all(isinstance(packer.picture(frame), Picture) for frame in (0, 1, 3, 4, 5))


def test_a_fault_of_the_program_is_shown_too(bench):
    packer, painter, pack = bench()
    painter.fault = ValueError("shapes differ")
    packer.ask(want())
    pack(6)
    assert "ValueError: shapes differ" in packer.picture(2).message


def test_a_damaged_frame_is_tried_again_when_the_run_has_changed(bench):
    packer, painter, pack = bench()
    painter.fault = RecordingError("not yet")
    packer.ask(want(count=3))
    pack(3)
    painter.fault = None
    packer.ask(want(count=4))
    pack(2)
    assert isinstance(packer.picture(2), Picture)


def test_frames_that_are_taken_back_are_forgotten(bench):
    packer, _, pack = bench()
    packer.ask(want(count=6))
    pack(6)
    packer.ask(want(count=3))
    assert [packer.picture(frame) is not None for frame in range(6)] == [True] * 3 + [False] * 3
