"""What is guarded ends, with all it starts, once nobody holds its stdin, whatever it does; and nothing else ends it."""

import os
import signal
import subprocess
import sys
import time

import pytest

from gasp_core.processes import guard
from gasp_core.processes.group import end_group, kill_group, outlived_by_group

PATIENCE = 60.0
"""Seconds; a limit of hanging."""
HEAD = "import ctypes, os, signal, subprocess, sys, time\n"
SLEEPER = "sleeper = subprocess.Popen(['sleep', '600']); print(sleeper.pid, flush=True)\n"


@pytest.fixture
def start(tmp_path):
    """Start code, guarded as a module or as it says itself; the process, and the numbers in its first line."""
    started = []

    def go(code, *arguments, module=True):
        (tmp_path / "thing.py").write_text(HEAD + code)
        command = ["-m", guard.__name__, "thing"] if module else ["thing.py"]
        process = subprocess.Popen(
            [sys.executable, *command, *arguments],
            cwd=tmp_path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        started.append(process)
        return process, [int(word) for word in process.stdout.readline().split()]

    yield go
    for process in started:
        kill_group(process)
        process.wait(PATIENCE)
        process.stdin.close()
        process.stdout.close()


@pytest.mark.parametrize(
    "work",
    [
        "time.sleep(600)",
        pytest.param("ctypes.PyDLL(None).sleep(600)", id="native code that lets no thread run"),
        pytest.param("signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(600)", id="deaf"),
    ],
)
def test_it_ends_with_all_it_started_once_nobody_holds_its_stdin(start, alive, gone, work):
    process, (sleeper,) = start(SLEEPER + work)
    assert alive(process.pid, sleeper) == [process.pid, sleeper]
    process.stdin.close()
    assert process.wait(PATIENCE) == -signal.SIGKILL
    assert gone(sleeper)


HOLDER = f"""
inner = subprocess.Popen([sys.executable, "-m", "{guard.__name__}", "thing", "inner"], stdin=subprocess.PIPE,
                         start_new_session=True) if len(sys.argv) == 2 and sys.argv[1] == "outer" else None
if inner is None:
    sleeper = subprocess.Popen(["sleep", "600"])
    print(os.getppid(), os.getpid(), sleeper.pid, flush=True)
ctypes.PyDLL(None).sleep(600)
"""


def test_those_that_it_has_guarded_itself_follow(start, gone):
    process, others = start(HOLDER, "outer")
    assert others[0] == process.pid and len(others) == 3
    process.stdin.close()
    assert gone(*others)


def test_it_ends_when_who_started_it_is_killed_in_whatever_thread(start, tmp_path, gone):
    (tmp_path / "guarded.py").write_text(
        f"{HEAD}{SLEEPER}print(os.getpid(), flush=True); ctypes.PyDLL(None).sleep(600)"
    )
    parent, (pid,) = start(
        f"""
import threading
def work():
    child = subprocess.Popen([sys.executable, "-m", "{guard.__name__}", "guarded"], stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE, start_new_session=True)
    child.stdout.readline()
    print(int(child.stdout.readline()), flush=True)
thread = threading.Thread(target=work)
thread.start()
thread.join()
time.sleep(600)
""",
        module=False,
    )
    parent.kill()
    parent.wait(PATIENCE)
    assert gone(pid)


GUARD_ITSELF = f"from {guard.__name__} import guard_group\nprint(guard_group({{grace}}), flush=True)\n"


def test_in_its_grace_it_ends_as_it_likes(start, gone):
    process, (watcher,) = start(GUARD_ITSELF.format(grace=PATIENCE) + "sys.stdin.read(); sys.exit(7)", module=False)
    process.stdin.close()
    assert process.wait(PATIENCE) == 7
    assert gone(watcher)


def test_after_its_grace_it_is_killed(start, gone):
    process, (watcher,) = start(GUARD_ITSELF.format(grace=0.2) + "time.sleep(600)", module=False)
    process.stdin.close()
    assert process.wait(PATIENCE) == -signal.SIGKILL
    assert gone(watcher)


def test_what_is_said_on_stdin_is_for_the_guarded(start):
    process, _ = start(GUARD_ITSELF.format(grace=PATIENCE) + "print(sys.stdin.read() * 2)", module=False)
    process.stdin.write(b"word")
    process.stdin.close()
    assert process.stdout.read() == b"wordword\n"


def test_who_ends_in_order_leaves_not_even_a_zombie_of_its_guard(start):
    process, (watcher,) = start(GUARD_ITSELF.format(grace=0), module=False)
    assert process.wait(PATIENCE) == 0
    with pytest.raises(ProcessLookupError):
        os.kill(watcher, 0)


def test_a_fork_that_ends_does_not_dismiss_the_guard(start, gone):
    code = "if os.fork() == 0:\n    sys.exit(0)\nos.wait()\nprint(flush=True)\ntime.sleep(600)\n"
    process, (watcher,) = start(GUARD_ITSELF.format(grace=0) + code, module=False)
    process.stdout.readline()
    process.stdin.close()
    assert process.wait(PATIENCE) == -signal.SIGKILL
    assert gone(watcher)


def test_what_outlives_the_guarded_is_guarded_on_and_its_guard_is_none_of_it(start, alive, gone):
    process, (watcher,) = start(GUARD_ITSELF.format(grace=0) + SLEEPER + "os._exit(0)", module=False)
    sleeper = int(process.stdout.readline())
    process.wait(PATIENCE)
    assert outlived_by_group(process, 1.0)
    assert alive(watcher, sleeper) == [watcher, sleeper]
    process.stdin.close()
    assert gone(watcher, sleeper)


def test_a_guard_whose_charge_has_crashed_ends(start, gone):
    process, (watcher,) = start(GUARD_ITSELF.format(grace=0) + "os._exit(3)", module=False)
    process.wait(PATIENCE)
    assert not outlived_by_group(process, PATIENCE)
    assert gone(watcher)


def test_a_signal_to_the_group_does_not_end_its_guard(start, alive, gone):
    deaf = "for one in (signal.SIGTERM, signal.SIGINT):\n    signal.signal(one, signal.SIG_IGN)\n"
    code = GUARD_ITSELF.format(grace=0) + deaf + "print(flush=True)\ntime.sleep(600)"
    process, (watcher,) = start(code, module=False)
    process.stdout.readline()
    deadline = time.monotonic() + PATIENCE
    while os.getpgid(watcher) != watcher and time.monotonic() < deadline:
        time.sleep(0.01)
    for number in (signal.SIGINT, signal.SIGTERM):
        os.killpg(process.pid, number)
        os.kill(watcher, number)
    assert alive(watcher) == [watcher]
    process.stdin.close()
    assert process.wait(PATIENCE) == -signal.SIGKILL
    assert gone(watcher)


def test_a_module_runs_as_it_does_without_a_guard(start):
    code = """
print(flush=True)
print(__name__, sys.argv[1:], sys.argv[0].endswith("thing.py"), sys.stdin.read())
sys.exit(5)
"""
    process, _ = start(code, "one", "-m")
    assert process.stdout.read() == b"__main__ ['one', '-m'] True \n"
    assert process.wait(PATIENCE) == 5


def test_whoever_reads_its_output_finds_the_end_with_it(start):
    process, _ = start("print(flush=True)\ntime.sleep(0.2)\nos._exit(0)")
    # Its stdin is held open all the while.
    assert process.stdout.read() == b""
    assert end_group(process, PATIENCE) == 0


def test_what_leads_no_group_is_told_so():
    done = subprocess.run(
        [sys.executable, "-m", guard.__name__, "this"], stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert "cannot be guarded: start it with start_new_session" in done.stderr.splitlines()[-1]
