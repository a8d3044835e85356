"""Scratch folders: gone with whoever made them, or at the next of their kind; nothing else is ever removed."""

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from gasp_core.processes.scratch import MARK, Scratch, clear_left_over, scratch_folder

HOLDER = textwrap.dedent("""
    import sys
    from pathlib import Path
    from gasp_core.processes.scratch import Scratch
    folder = Scratch("made-", Path(sys.argv[1])).path
    (folder / "deep").mkdir()
    (folder / "deep" / "content").write_text("x")
    print(folder, flush=True)
    sys.stdin.read()
""")


@contextlib.contextmanager
def holding(parent):
    """A process that holds a folder; its path."""
    command = [sys.executable, "-c", HOLDER, str(parent)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process, Path(process.stdout.readline().strip())
        finally:
            process.kill()


def killed(parent):
    with holding(parent) as (process, folder):
        process.send_signal(signal.SIGKILL)
        process.wait()
    return folder


def test_it_is_gone_in_the_end_also_by_an_error(tmp_path):
    with contextlib.suppress(KeyError), scratch_folder("made-", tmp_path) as folder:
        (folder / "content").write_text("x")
        raise KeyError
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path):
    left = killed(tmp_path)
    assert (left / "deep" / "content").exists()
    with scratch_folder("made-", tmp_path):
        assert not left.exists()


def test_what_somebody_holds_stays(tmp_path):
    with holding(tmp_path) as (_, folder):
        clear_left_over("made-", tmp_path)
        assert (folder / "deep" / "content").exists()
    with scratch_folder("made-", tmp_path) as own:
        clear_left_over("made-", tmp_path)
        assert own.exists()


def test_a_process_that_inherits_nothing_does_not_hold_it(tmp_path):
    """What a killed command started and did not see end must not keep its folder."""
    scratch = Scratch("made-", tmp_path)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        os.close(scratch._descriptor)  # as if this process were no more
        clear_left_over("made-", tmp_path)
        assert child.poll() is None
        assert not scratch.path.exists()
        child.kill()


def test_what_is_kept_is_no_scratch_any_more(tmp_path):
    scratch = Scratch("made-", tmp_path)
    (scratch.path / "log").write_text("why")
    scratch.keep()
    clear_left_over("made-", tmp_path)
    assert (scratch.path / "log").read_text() == "why"


@pytest.mark.parametrize("mark", [None, "folder", "fifo", "link", b"", b"somebody else's\n"])
def test_what_bears_no_mark_is_never_removed(tmp_path, mark):
    (tmp_path / "made-by-hand").mkdir()
    (tmp_path / "made-by-hand" / "thesis.txt").write_text("years of work")
    place = tmp_path / "made-by-hand" / MARK
    if mark == "folder":
        place.mkdir()
    elif mark == "fifo":
        os.mkfifo(place)
    elif mark == "link":
        place.symlink_to(killed(tmp_path / "made-by-hand") / MARK)
    elif mark is not None:
        place.write_bytes(mark)
    clear_left_over("made-", tmp_path)
    assert (tmp_path / "made-by-hand" / "thesis.txt").read_text() == "years of work"


def test_links_are_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "thesis.txt").write_text("years of work")
    (tmp_path / "made-link").symlink_to(tmp_path / "elsewhere")
    left = killed(tmp_path)
    (left / "out").symlink_to(tmp_path / "elsewhere")
    clear_left_over("made-", tmp_path)
    assert not left.exists()
    assert (tmp_path / "made-link").is_symlink()
    assert (tmp_path / "elsewhere" / "thesis.txt").exists()


def test_other_kinds_are_left_alone(tmp_path):
    left = killed(tmp_path)
    clear_left_over("others-", tmp_path)
    assert left.exists()
