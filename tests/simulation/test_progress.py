"""What a run shows while it goes on: between frames too, and before the first."""

import time

import flying_points
import pytest

import gasp_core as gasp
from gasp_core import progress
from gasp_core.toy import make_toy


class Clock:
    """Time that passes when it is told to."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(progress.time, "monotonic", clock)
    return clock


def test_the_time_left_is_known_from_the_first_substeps_on(clock):
    run = progress._Lines(21)
    assert run.line() == "preparing: 0.1 s so far"
    clock.now += 12
    run.enter("starting warp-mpm")
    assert run.line() == "starting warp-mpm: 12 s so far"
    done = [0.0]
    run.watch(lambda: done[0])
    assert run.line() == "frame 0.0 of 20: 12 s so far"
    clock.now, done[0] = clock.now + 5, 0.25
    # A quarter of a frame in five seconds.
    assert run.line() == "frame 0.2 of 20: 17 s so far, about 6.6 min left"
    clock.now, done[0] = clock.now + 75, 4.0
    run.advance(4, 1e-4)
    assert run.line() == "frame 4.0 of 20: 92 s so far, about 5.3 min left"


def test_a_run_that_goes_on_counts_what_it_does_itself(clock):
    run, done = progress._Lines(21), [10.0]
    run.watch(lambda: done[0])
    assert run.left != run.left
    clock.now, done[0] = clock.now + 10, 11.0
    assert run.left == pytest.approx(90)


def test_an_engine_that_says_nothing_between_frames_is_where_its_last_frame_is(clock):
    run = progress._Lines(21)
    run.watch(lambda: 0.0)
    run.advance(3, 1e-4)
    assert run.done == 3


def test_a_log_gets_lines_and_a_library_none(monkeypatch, capfd):
    monkeypatch.setattr(progress._Lines, "pause", 0.05)
    with progress.progress_for(None, 5) as shown:
        time.sleep(0.2)
    assert type(shown) is progress.Progress and capfd.readouterr().err == ""
    with progress.progress_for("log", 5) as shown:
        shown.enter("starting warp-mpm")
        time.sleep(0.2)
    told = capfd.readouterr().err.splitlines()
    assert len(told) >= 2 and all("so far" in line for line in told)
    time.sleep(0.1)
    assert capfd.readouterr().err == ""


def test_a_bar_shows_parts_of_a_frame(capfd):
    done = [0.0]
    with progress.progress_for(True, 5) as shown:
        shown.say("a note with [brackets]")
        shown.watch(lambda: done[0])
        done[0] = 2.5
        assert shown.columns()["completed"] == 2.5
        shown.advance(4, 1e-3)
    err = capfd.readouterr().err
    assert "a note with [brackets]" in err and "4/4" in err and "substep 1.00e-03 s" in err


def test_a_run_tells_where_it_is(tmp_path, monkeypatch):
    seen = []

    class Spy(progress.Progress):
        def enter(self, phase):
            seen.append(phase)

        def watch(self, frame):
            seen.append(frame())
            self.frame = frame

        def advance(self, frame, substep):
            seen.append(self.frame())

    from contextlib import nullcontext

    monkeypatch.setattr("gasp_core.simulation.driver.progress_for", lambda shown, frames: nullcontext(Spy()))
    scene = gasp.Scene(
        duration=0.08,
        frame_rate=25,
        objects=(
            gasp.SplatObject(
                name="toy",
                splat=make_toy(64),
                material=gasp.Elastic(density=100, youngs_modulus=1e4, poissons_ratio=0.3),
            ),
        ),
        engine=gasp.EngineChoice(name="ballistic"),
    )
    gasp.simulate(scene, engine=(flying_points.descriptor(), flying_points.Ballistic()), out=tmp_path / "a.gasp")
    assert seen == ["starting ballistic (may compile, the first time)", 0.0, pytest.approx(1.0), pytest.approx(2.0)]
