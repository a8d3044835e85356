"""The side of whoever started a process that leads a group, with `start_new_session`: its end, and that of the group.

Where the system has no groups, the process stands for its own.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time

import psutil

__all__ = ["end_group", "interrupt_group", "kill_group", "outlived_by_group"]

_GLANCE = 0.05
"""Seconds between looks at what is left."""


def interrupt_group(process: subprocess.Popen[bytes]) -> None:
    """Ask a process and its group to end, as Ctrl-C on a terminal does; where there are no groups the terminal has."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGINT)


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and what is left of its group; whoever started it reaps it.

    The group keeps its id for as long as any of it lives, so this holds when the process itself has ended, too.
    """
    if not hasattr(os, "killpg"):
        process.kill()
        return
    with contextlib.suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)


def end_group(process: subprocess.Popen[bytes], patience: float = 0.0) -> int:
    """Wait for a process that has been asked to end for at most `patience` [s], then kill what is left of its group.

    Returns
    -------
    int
        Its exit status, negative for a signal.
    """
    try:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
    finally:
        # Whoever interrupts the wait has no more patience.
        kill_group(process)
    return process.wait()


def outlived_by_group(process: subprocess.Popen[bytes], patience: float) -> bool:
    """Whether some of the group of a process that has ended still live `patience` [s] later."""
    deadline = time.monotonic() + patience
    while _lives(process.pid):
        if time.monotonic() > deadline:
            return True
        time.sleep(_GLANCE)
    return False


def _lives(group: int) -> bool:
    """Whether there is anyone in a group but zombies, which nobody reaps in many containers."""
    if not hasattr(os, "killpg"):
        return False
    try:
        os.killpg(group, 0)
    except OSError:
        return False
    return any(_lives_in(group, process) for process in psutil.process_iter())


def _lives_in(group: int, process: psutil.Process) -> bool:
    with contextlib.suppress(OSError, psutil.Error):  # it may end while we look, or be none of ours
        return os.getpgid(process.pid) == group and process.status() != psutil.STATUS_ZOMBIE
    return False
