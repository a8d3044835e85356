"""Kernels compiled ahead: by whom, when, and whether they are those that a run needs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gasp_core.cli import rehearsing
from gasp_core.io import write_splat
from gasp_core.toy import make_toy


@pytest.fixture
def started(monkeypatch, tmp_path):
    """Parts that were started, as processes that do not end by themselves; nothing has been rehearsed yet."""
    monkeypatch.setenv("GASP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    found = {}

    def start(part):
        command = [sys.executable, "-c", "import time; time.sleep(600)"]
        found[part] = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
        return found[part]

    monkeypatch.setattr(rehearsing, "_started", start)
    yield found
    for process in found.values():
        process.kill()


def test_what_nobody_has_compiled_is_compiled_meanwhile_and_ended_in_the_end(started):
    with rehearsing.rehearsed():
        assert set(started) == set(rehearsing.PARTS)
        assert all(process.poll() is None for process in started.values())
    assert all(process.poll() is not None for process in started.values())


def test_nothing_is_compiled_ahead_where_nothing_may_be_kept_or_nobody_is_free(started, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with rehearsing.rehearsed():
        assert not started
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setenv("GASP_CACHE", "")
    with rehearsing.rehearsed():
        assert not started


@pytest.mark.parametrize("part", rehearsing.PARTS)
def test_a_part_is_rehearsed_once(started, part):
    rehearsing.main(part)
    with rehearsing.rehearsed():
        assert set(started) == {*rehearsing.PARTS} - {part}


def test_what_went_wrong_is_not_tried_at_every_run(started, monkeypatch):
    def fail(scene, folder):
        raise ValueError("no")

    monkeypatch.setattr(rehearsing, "_paint", fail)
    with pytest.raises(ValueError, match="no"):
        rehearsing.main("pictures")
    with rehearsing.rehearsed():
        assert "pictures" not in started


@pytest.mark.slow
def test_a_first_look_compiles_nothing_that_has_been_rehearsed(tmp_path):
    """By what Numba says of itself, with a cache of kernels that was empty before."""
    write_splat(tmp_path / "bear.ply", make_toy(3000))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "numba"), "GASP_CACHE": str(tmp_path / "cache")}

    def run(*command):
        found = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert found.returncode == 0, found.stderr
        return found.stdout

    for part in rehearsing.PARTS:
        run("-m", "gasp_core.cli.rehearsing", part)
    run("-c", "from gasp_core.cli.main import main; main()", "new", "bear.ply", "-y")
    listening = """
import sys
from numba.core import event
recording = event.RecordingListener()
event.register("numba:compile", recording)
from gasp_core.cli.main import main
try:
    main(["run", "bear.toml", "--preview", "--quiet"])
finally:
    print({str(each[1].data["dispatcher"]) for each in recording.buffer})
"""
    assert run("-c", listening).splitlines()[-1] == "set()"
    assert Path(tmp_path / "bear.preview.mp4").exists()
