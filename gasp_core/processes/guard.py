"""The side of a process that is not to outlive whoever started it, with all it starts: it hangs by its stdin.

`python -m gasp_core.processes.guard MODULE ARGUMENTS` runs any module so. Of the standard library alone: a worker
imports this where next to nothing else can be.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import runpy
import select
import signal
import sys
import time

__all__ = ["guard_group", "main", "read_nothing"]

_GLANCE = 0.25
"""Seconds between looks at whether there is anything to guard; that nobody holds stdin any more shows at once."""
_CLOSE_GLANCE = 0.02
"""The same within the grace."""


def guard_group(grace: float = 0.0) -> int:
    """Fork a process that kills our group once nobody holds the other end of our stdin, a pipe; its id.

    A thread would not do: a backend in native code may keep it from running. Nor would the signal that Linux sends at
    the death of a parent: it comes when the thread ends that started us, and to none of those that we start. So call
    this first of all, while there are no threads and next to no memory to fork.

    Nothing is read: what is said on stdin is for us. Where it is no pipe, nobody is taken to be gone.

    Parameters
    ----------
    grace
        Seconds in which the group may still end by itself.

    Raises
    ------
    RuntimeError
        Where we lead no group of our own: others would be killed along.
    """
    own, starter = os.getpid(), os.getppid()
    if os.getpgrp() != own:
        raise RuntimeError("what does not lead its process group cannot be guarded: start it with start_new_session")
    guard = os.fork()
    if guard == 0:
        try:
            _stand_by(own, grace)
        finally:
            os._exit(0)
    # The first that is registered is the last that is called: there is a guard for as long as can be.
    atexit.register(_dismiss, guard, own, starter)
    return guard


def read_nothing() -> None:
    """Have whoever reads our stdin find its end there, and not wait for what is never said."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _stand_by(leader: int, grace: float) -> None:
    """Wait until the group is gone, or nobody holds our stdin, and the group is gone or killed."""
    # Whoever asks all processes gently to end must not leave the others without a guard.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    # Out of the group: it does not end with it, and what is left once the leader has ended is not the guard.
    os.setpgid(0, 0)
    # Who reads what the leader writes is to find its end with the leader's.
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    ends = select.poll()
    ends.register(0, 0)  # nothing but its end
    while not ends.poll(_GLANCE * 1e3):
        if _is_over(leader):
            return
    deadline = time.monotonic() + grace
    while time.monotonic() < deadline:
        if _is_over(leader):
            return
        time.sleep(_CLOSE_GLANCE)
    if not _is_over(leader):
        with contextlib.suppress(OSError):
            os.killpg(leader, signal.SIGKILL)


def _is_over(leader: int) -> bool:
    """Whether the leader, our parent, has ended, and all of its group with it."""
    if os.getppid() == leader:
        return False
    try:
        os.killpg(leader, 0)
    except OSError:
        return True
    return False


def _dismiss(guard: int, own: int, starter: int) -> None:
    """End the guard and reap it: an orphan is a zombie for ever where nobody does, as in many containers.

    A fork of ours has no say in it. And where whoever started us is gone, nobody but the guard ends us if we hang in
    what is still to come.
    """
    if os.getpid() == own and os.getppid() == starter:
        with contextlib.suppress(OSError):
            os.kill(guard, signal.SIGKILL)
            os.waitpid(guard, 0)


def main() -> None:
    """Run the module that the arguments name, with the rest of them, as `python -m` does."""
    # Where there are no groups, those who start us can but end us alone.
    if hasattr(os, "fork"):
        guard_group()
    read_nothing()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
