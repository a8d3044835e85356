"""What does not fit in memory is refused before it is asked for: Linux grants it, and then ends the process."""

from __future__ import annotations

import os
from pathlib import Path

from gasp_core.errors import RenderingError

__all__ = ["available_bytes", "refuse_beyond_memory"]

_ALWAYS = 1 << 28
"""A quarter of a gigabyte is taken without asking how much there is."""
_UNKNOWN = 1 << 32
"""Taken to be there where the system does not say."""
_SHARE = 0.8
"""Of what is available; the rest is for what happens meanwhile."""

_CGROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Limit and usage of a container, version 2 and version 1."""


def available_bytes() -> int:
    """Memory that this process may still take: what the machine has free, and what its container leaves of that."""
    free = [_machine_bytes()]
    for limit, usage in _CGROUPS:
        try:
            free.append(int(Path(limit).read_text()) - int(Path(usage).read_text()))
        except (OSError, ValueError):
            # No container, or one without a limit ("max").
            continue
    return max(0, min(free))


def _machine_bytes() -> int:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return _UNKNOWN


def refuse_beyond_memory(needed: int, what: str, remedy: str) -> None:
    """Refuse what needs more memory than there is.

    Parameters
    ----------
    needed [bytes]
    what, remedy
        What needs it and what to do instead, for the message.

    Raises
    ------
    RenderingError
    """
    if needed <= _ALWAYS:
        return
    available = available_bytes()
    if needed > _SHARE * available:
        raise RenderingError(
            f"{what} need {needed / 2**30:.1f} GiB of memory, {available / 2**30:.1f} GiB are available: {remedy}"
        )
