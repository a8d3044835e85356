"""What a process and those it started have used so far."""

from __future__ import annotations

import contextlib
import resource
import sys
import time
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import psutil

__all__ = ["Usage", "usage_so_far"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Of this process and all below it.

    Parameters
    ----------
    cpu_seconds
        Processor time [s], user and system.
    peak_bytes
        Largest resident size of this process plus the largest of any one below it.
    """

    cpu_seconds: float
    peak_bytes: int


def usage_so_far(less: Collection[int] = ()) -> Usage:
    """Look at this process and all below it but for the processes of these ids."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = time.process_time() + ended.ru_utime + ended.ru_stime
    peaks = [0]
    for process in psutil.Process().children(recursive=True):
        if process.pid in less:
            continue
        # It may end while we look.
        with contextlib.suppress(psutil.Error):
            times = process.cpu_times()
            cpu += times.user + times.system + times.children_user + times.children_system
            peaks.append(_peak_of(process.pid) or process.memory_info().rss)
    own = _peak_of(psutil.Process().pid) or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _MAXRSS_UNIT
    return Usage(cpu_seconds=cpu, peak_bytes=own + max(peaks))


_MAXRSS_UNIT = 1 if sys.platform == "darwin" else 1024


def _peak_of(pid: int) -> int:
    """The largest resident size [bytes] that a process ever had; 0 where the system does not say.

    Not ru_maxrss where that can be helped: Linux begins it with the size of the process that started this one.
    """
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    for line in status.splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    return 0
