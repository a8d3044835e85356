"""A process that leads a group ends with all of it, gently where it will, and what outlives it is told."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from gasp_core.processes.group import end_group, interrupt_group, kill_group, outlived_by_group

PATIENCE = 60.0
"""Seconds; a limit of hanging."""


@pytest.fixture
def start():
    """Start code that leads a group; the process, and the numbers in its first line."""
    started = []

    def go(code):
        process = subprocess.Popen(
            [sys.executable, "-c", f"import os, signal, subprocess, sys, time\n{code}"],
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


SLEEPER = "sleeper = subprocess.Popen(['sleep', '600']); print(sleeper.pid, flush=True)\n"


def test_what_ends_when_it_is_asked_keeps_its_status(start):
    process, _ = start("print(flush=True); sys.stdin.read(); sys.exit(7)")
    process.stdin.close()
    assert end_group(process, PATIENCE) == 7


def test_what_does_not_end_in_time_is_killed_with_all_it_started(start, gone):
    process, (sleeper,) = start("signal.signal(signal.SIGINT, signal.SIG_IGN)\n" + SLEEPER + "time.sleep(600)")
    interrupt_group(process)
    assert end_group(process, 0.3) == -signal.SIGKILL
    assert gone(process.pid, sleeper)


def test_what_a_process_left_is_killed_though_it_has_ended_itself(start, alive, gone):
    process, (sleeper,) = start(SLEEPER + "os._exit(3)")
    process.wait(PATIENCE)
    assert alive(sleeper)
    assert end_group(process) == 3
    assert gone(sleeper)


def test_an_interrupt_reaches_all_of_the_group(start, gone):
    code = """
try:
    sleeper = subprocess.Popen(["sleep", "600"])
    print(sleeper.pid, flush=True)
    time.sleep(600)
except KeyboardInterrupt:
    sleeper.wait()
    sys.exit(9)
"""
    process, (sleeper,) = start(code)
    interrupt_group(process)
    assert end_group(process, PATIENCE) == 9
    assert gone(sleeper)


def test_who_interrupts_the_wait_ends_them_at_once(start, gone):
    process, (sleeper,) = start(SLEEPER + "time.sleep(600)")
    main = threading.main_thread().ident
    threading.Timer(0.3, lambda: signal.pthread_kill(main, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        end_group(process, PATIENCE)
    process.wait(PATIENCE)
    assert gone(sleeper)


def test_a_group_that_outlives_its_leader_is_told(start):
    process, _ = start(SLEEPER + "os._exit(0)")
    process.wait(PATIENCE)
    assert outlived_by_group(process, 0.2)
    kill_group(process)
    assert not outlived_by_group(process, PATIENCE)


def test_what_follows_its_leader_in_time_has_not_outlived_it(start):
    process, _ = start("subprocess.Popen(['sleep', '0.5']); print(flush=True); os._exit(0)")
    process.wait(PATIENCE)
    assert not outlived_by_group(process, PATIENCE)


def test_a_zombie_outlives_nobody(start):
    # The child of a child that leaves the group is in it, ends, and is reaped by nobody until that child ends.
    code = """
import signal
if os.fork() == 0:
    member = os.fork()
    if member == 0:
        os._exit(0)
    os.setsid()
    os.waitid(os.P_PID, member, os.WEXITED | os.WNOWAIT)
    print(os.getpid(), flush=True)
    time.sleep(600)
else:
    os.wait()
"""
    process, (keeper,) = start(code)
    process.kill()
    process.wait(PATIENCE)
    try:
        os.killpg(process.pid, 0)  # to the system there is somebody
        assert not outlived_by_group(process, 0.0)
    finally:
        os.kill(keeper, signal.SIGKILL)


def test_nothing_is_said_of_a_group_that_is_no_more(start):
    process, _ = start("print(flush=True)")
    assert end_group(process, PATIENCE) == 0
    kill_group(process)
    interrupt_group(process)
    assert end_group(process) == 0
