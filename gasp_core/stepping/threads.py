"""The option that engines share which step in threads."""

from __future__ import annotations

import os
from dataclasses import dataclass

from gasp_core.errors import SceneError

__all__ = ["ThreadOptions", "processors"]

_POINTS_A_THREAD = 2_500
"""With fewer, threads wait for each other: two of them take 0.7 of the time of one for 7,000 and for 18,000 points in
warp-mpm, 0.6 in taichi-mpm, and about as long for 1,000."""


def processors() -> int:
    """Number of processors this process may use; no more than `GASP_THREADS` says in the environment."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    told = os.environ.get("GASP_THREADS", "")
    return max(1, min(there or 1, int(told) if told.isdecimal() and int(told) else there or 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreadOptions:
    """Options of an engine that steps in threads.

    Parameters
    ----------
    threads
        Processors to use on the CPU, with the same results bit for bit for any number; 0 for as many as the cloud is
        large enough to gain from.
    """

    threads: int = 0

    def __post_init__(self) -> None:
        if type(self.threads) is not int or self.threads < 0:
            raise SceneError(f"ThreadOptions.threads must be a whole number >= 0, found {self.threads!r}")

    def threads_for(self, points: int) -> int:
        """Threads for a cloud of so many points on this machine."""
        available = processors()
        return min(self.threads or max(1, points // _POINTS_A_THREAD), available)
