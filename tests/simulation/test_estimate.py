"""What is said of a run before it is made."""

from __future__ import annotations

from time import sleep

import flying_points
import pytest

from gasp_core import EngineAccuracy, HalfSpace, Part, PythonMotion, Reduction
from gasp_core.errors import EngineDivergedError
from gasp_core.simulation.estimate import estimate_run, first_moments

FLYING = (flying_points.descriptor(), flying_points.Ballistic())


def test_it_counts_what_the_run_has(scene_of, run, tmp_path):
    scene = scene_of(duration=2.0, accuracy=EngineAccuracy(resolution=20))
    found = estimate_run(scene, tmp_path / "trial.gasp", FLYING)
    recording = run(scene, tmp_path / "whole.gasp")
    assert found.points == len(recording.start_points)
    assert found.gaussians == 40
    assert (found.engine, found.device, found.precision) == ("ballistic", "cpu", "float64")
    assert (found.spacing, found.cells) == (recording.header.spacing, 20)
    assert found.frames == recording.frame_count == 51
    assert found.notes == recording.notes
    substeps = sum(recording.diagnostics(frame)["substeps"] for frame in range(51))
    # Twice as many as it begins with, for what begins slowly; this engine steps as it began.
    assert found.substeps == pytest.approx(2 * substeps, rel=0.1)
    disk = sum(file.stat().st_size for file in recording.path.rglob("*") if file.is_file())
    # Checkpoints apart: of them there are two at most.
    assert 0.5 * disk < found.disk < 2 * disk
    assert found.memory > 10_000_000


def test_time_in_the_engine_and_between_frames_is_told_apart(scene_of, tmp_path):
    scene = scene_of(duration=2.0, options={"pause": 0.02})
    found = estimate_run(scene, tmp_path / "trial.gasp", FLYING, recorded=lambda frame: None)
    # 50 frames of eight short ones, a pause in each, twice for what comes later. A pause is never shorter than asked.
    assert found.engine_seconds >= 50 * 8 * 2 * 0.02
    assert found.start_seconds > 0
    assert found.frame_seconds > 0
    assert found.seconds == found.start_seconds + found.engine_seconds + found.frame_seconds


def test_only_the_first_moments_are_run(scene_of, tmp_path):
    scene = scene_of(duration=100.0, reduction=Reduction(mode="cores", count=5))
    frames = []
    estimate_run(scene, tmp_path / "trial.gasp", FLYING, recorded=frames.append)
    assert frames == [0, 1, 2, 3, 4, 5, 6]
    assert first_moments(scene).duration < 1 / scene.frame_rate


def test_what_fails_at_once_says_so(scene_of, tmp_path):
    scene = scene_of(options={"fault": "nan", "fault_time": 0.0})
    with pytest.raises(EngineDivergedError):
        estimate_run(scene, tmp_path / "trial.gasp", FLYING)


def test_what_a_motion_takes_before_the_first_frame_is_counted_for_all_frames(scene_of, cloud, tmp_path):
    def slow(points, s):
        sleep(0.01)
        return points

    half = Part(name="left", region=HalfSpace(point=(0, 0, 0), normal=(1, 0, 0)), driven=True)
    scene = scene_of(
        cloud(60),
        duration=4.0,
        motion=PythonMotion(function=slow, composition="driven"),
        parts=(half,),
        accuracy=EngineAccuracy(resolution=8),
    )
    found = estimate_run(scene, tmp_path / "trial.gasp", "reference-mpm")
    # A motion that sleeps is never faster than that.
    assert found.start_seconds > 0.01 * scene.frame_count
