"""What is removed beside and under a recording is GASP's own: what it made, of a process that is no more."""

import os

import pytest

from gasp_core.errors import RecordingError
from gasp_core.processes.scratch import Scratch
from gasp_core.recording.durable import discard, folder_in_the_making, remove_leftovers


def test_a_folder_of_somebody_elses_that_is_named_like_a_left_over_one_stays(tmp_path):
    # The number of no process: Linux has at most 2^22.
    mine = tmp_path / f".run.gasp.{2**22 + 1}.part"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years of work")
    remove_leftovers(tmp_path / "run.gasp")
    with folder_in_the_making(tmp_path / "run.gasp") as beside:
        (beside / "content").write_text("x")
    assert (mine / "thesis.txt").read_text() == "years of work"
    assert sorted(path.name for path in tmp_path.iterdir()) == [mine.name, "run.gasp"]
    assert [path.name for path in (tmp_path / "run.gasp").iterdir()] == ["content"]


def test_what_was_in_the_making_when_its_process_died_is_removed(tmp_path):
    dead = Scratch(".run.gasp.", tmp_path)
    (dead.path / "run.gasp").mkdir()
    os.close(dead._descriptor)  # as the death of its process does
    remove_leftovers(tmp_path / "run.gasp")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_fails_in_the_making_is_gone(tmp_path):
    with pytest.raises(KeyError), folder_in_the_making(tmp_path / "run.gasp") as beside:
        (beside / "content").write_text("x")
        raise KeyError
    assert list(tmp_path.iterdir()) == []


def test_what_is_discarded_is_gone(tmp_path):
    (tmp_path / "run.gasp" / "deep").mkdir(parents=True)
    discard(tmp_path / "run.gasp")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("where", [".", "frames", "reference/means"])
def test_a_recording_that_somebody_keeps_a_file_in_is_not_replaced(run, scene_of, tmp_path, where):
    path = tmp_path / "run.gasp"
    run(scene_of(), path)
    run(scene_of(), path, overwrite=True)
    (path / where / "thesis.txt").write_text("years of work")
    with pytest.raises(RecordingError, match=r"thesis\.txt: is not of the recording around it"):
        run(scene_of(), path, overwrite=True)
    assert (path / where / "thesis.txt").read_text() == "years of work"
    (path / where / "thesis.txt").unlink()
    run(scene_of(), path, overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.gasp"]


def test_what_killed_runs_of_earlier_versions_left_in_a_recording_is_replaced_along(run, scene_of, tmp_path):
    path = tmp_path / "run.gasp"
    run(scene_of(), path)
    for name in ("c.5.0.0.part", f"c.5.0.0.{'0a' * 16}.partial"):
        (path / "frames" / "displacements" / name).write_bytes(b"half")
    run(scene_of(), path, overwrite=True)
    assert not [*path.rglob("*.part*")]
