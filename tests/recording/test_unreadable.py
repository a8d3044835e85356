"""What cannot be read now is no damage: nothing is removed for it, and it is told as what it is."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest

from gasp_core import Recording
from gasp_core.cli.main import main
from gasp_core.errors import GaspError
from gasp_core.recording import checkpoints
from gasp_core.recording.files import UnreadableError


@pytest.fixture
def path(scene_of, run, tmp_path):
    """A run that was stopped after eight of its eleven frames."""
    run(scene_of(), tmp_path / "a.gasp", frames=8)
    return tmp_path / "a.gasp"


def files(path):
    return {file.relative_to(path).as_posix(): file.read_bytes() for file in path.rglob("*") if file.is_file()}


def failing(monkeypatch, part):
    """A disk that does not give the files whose path has that part in it."""
    opened = os.open

    def refuse(file, *others, **more):
        if part in os.fspath(file):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return opened(file, *others, **more)

    monkeypatch.setattr(os, "open", refuse)


@pytest.mark.parametrize("part", ["checkpoints/00000007/c.0", "commits/00000007/zarr.json", "displacements/c.3.0.0"])
def test_a_disk_that_fails_costs_no_frame(path, scene_of, run, monkeypatch, part):
    before = files(path)
    with monkeypatch.context() as patched:
        failing(patched, part)
        with pytest.raises(UnreadableError, match="cannot be read: Input/output error"):
            run(scene_of(), path, resume=True)
    after = files(path)
    assert before.keys() <= after.keys()
    assert all(after[key] == before[key] for key in before if not key.startswith("status"))
    assert run(scene_of(), path, resume=True).status == "complete"


def test_a_lack_of_memory_costs_no_checkpoint(path, scene_of, run, monkeypatch):
    before = files(path)

    def lacking(content, node):
        raise MemoryError

    with monkeypatch.context() as patched:
        patched.setattr(checkpoints, "decoded", lacking)
        with pytest.raises(MemoryError):
            run(scene_of(), path, resume=True)
    assert before.keys() <= files(path).keys()
    assert run(scene_of(), path, resume=True).status == "complete"


@pytest.mark.parametrize(
    "command",
    [["export", "--frame", "1", "--out", "x.ply"], ["export", "--all", "--out", "x"], ["render", "--out", "x/"]],
)
def test_a_refusal_for_memory_is_no_damage(path, command, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([command[0], str(path), *command[1:], "--most-memory", "1K"]) == 2
    told = capsys.readouterr().err
    assert "allow more with --most-memory" in told and "damaged" not in told


def test_steps_of_no_size_are_a_fault_of_the_engine(scene_of, run, tmp_path):
    with pytest.raises(GaspError, match="ballistic failed at frame 3: it reports that all went well, with substeps of"):
        run(scene_of(options={"fault": "boundless", "fault_time": 0.12}), tmp_path / "a.gasp")
    kept = Recording.open(tmp_path / "a.gasp")
    assert kept.frame_count == 3 and "fault of the engine" in kept.reason


def test_where_there_were_no_steps_their_size_is_none(scene_of, run, tmp_path):
    kept = run(scene_of(options={"fault": "idle", "fault_time": 0.12}), tmp_path / "a.gasp")
    assert kept.status == "complete"
    assert [kept.diagnostics(frame)["largest_substep"] for frame in (2, 3)] == [1e-3, 0.0]
    assert np.isfinite(kept.points(10)).all()
