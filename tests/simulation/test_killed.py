from __future__ import annotations

import dataclasses
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gasp_core import Recording

HERE = Path(__file__).parent


def _scenery():
    spec = importlib.util.spec_from_file_location("scenery", HERE / "scenery.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")
@pytest.mark.parametrize(
    "trials", [2, pytest.param(5, marks=pytest.mark.thorough), pytest.param(20, marks=pytest.mark.slow)]
)
def test_a_run_killed_at_any_moment_loses_no_finished_frame_and_resumes_to_the_same(run, tmp_path, trials):
    scenery = _scenery()
    scene = scenery.scene()
    whole = run(scene, tmp_path / "whole.gasp")
    expected = [whole.points(frame) for frame in range(whole.frame_count)]
    killed = tmp_path / "killed"
    killed.mkdir()
    path = os.pathsep.join([str(HERE.parent / "support"), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path}
    subprocess.run(
        [sys.executable, str(HERE / "killed_runs.py"), str(killed), str(trials), "20"],
        check=True,
        env=environment,
        timeout=300,
        stdout=subprocess.DEVNULL,
    )
    stopped_within = 0
    for trial in range(trials):
        path = killed / f"{trial}.gasp"
        if path.exists():
            recording = Recording.open(path)
            # The text of the splat in memory is a digest either way, so the scenes are comparable.
            assert recording.status in ("incomplete", "complete")
            if recording.status == "incomplete":
                stopped_within += 1
                assert "killed" in recording.reason
            for frame in range(recording.frame_count):
                assert np.array_equal(recording.points(frame), expected[frame])
        again = run(scene, path, resume=True)
        assert (again.status, again.frame_count) == ("complete", scenery.FRAMES)
        for frame in range(scenery.FRAMES):
            assert np.array_equal(again.points(frame), expected[frame])
            assert np.array_equal(again.velocities(frame), whole.velocities(frame))
            ours, theirs = again.commit(frame), whole.commit(frame)
            assert dataclasses.asdict(ours) == dataclasses.asdict(theirs)
        for leftover in path.rglob("*"):
            assert "part" not in leftover.name, leftover
    # The moments are drawn so that most fall into the run; a loaded machine shifts them, hence not all.
    assert stopped_within >= trials // 2
    assert sorted(entry.name for entry in killed.iterdir()) == sorted(f"{trial}.gasp" for trial in range(trials))
