"""A polite end from outside: what a time limit, a queue or a cluster that wants its machine back sends."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

__all__ = ["ignore_termination", "terminable"]


@contextmanager
def terminable() -> Generator[threading.Event]:
    """Have SIGTERM do what Ctrl-C does; the event says whether it has come. Nothing beyond the main thread."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        event.set()
        # Whoever ends in order at Ctrl-C has a handler of their own. In the background of a script it is ignored.
        if not callable(signal.getsignal(signal.SIGINT)):
            raise KeyboardInterrupt
        signal.raise_signal(signal.SIGINT)

    was = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield event
    finally:
        signal.signal(signal.SIGTERM, was)


def ignore_termination() -> None:
    """Leave SIGTERM to whoever started this process: Slurm sends it to all there are, and they end us in order."""
    # Not SIG_IGN, which all that we start would inherit.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
