"""A word about a check that does not come back: an engine may hang, and nothing else would say where.

One that hangs with the interpreter's lock in its hands is named by nobody; the report on disk names it all the same.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

__all__ = ["waiting"]

_FIRST = 300.0
"""[s]; every wait after it is twice as long."""


@contextmanager
def waiting(name: str, tell: Callable[[str], None], first: float = _FIRST) -> Generator[None]:
    """Tell now and then how long the check `name` has been going on, until the block ends.

    Parameters
    ----------
    name
        Of the check.
    tell
        Takes a line; called in another thread.
    first
        How long it may take before anything is said [s].
    """
    ended = threading.Event()
    began = time.monotonic()

    def watch() -> None:
        pause = first
        while not ended.wait(pause):
            minutes = (time.monotonic() - began) / 60
            tell(f"{name} has been going on for {minutes:.0f} min: an engine that hangs is waited for, Ctrl-C ends it")
            pause *= 2

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()
