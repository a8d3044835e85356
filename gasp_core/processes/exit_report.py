"""What is said of a process that is no more."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path

__all__ = ["ending", "tail"]

_TAIL_BYTES = 8192
_TAIL_LINES = 8


def ending(status: int) -> str:
    """How a process ended, from its exit status, negative for a signal: "was killed by SIGSEGV"."""
    if status >= 0:
        return f"ended by itself with status {status}"
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    hint = ", perhaps for lack of memory" if name == "SIGKILL" else ""
    return f"was killed by {name}{hint}"


def tail(log: Path, without: Sequence[str] = ()) -> str:
    """The last lines of a log, in one; lines in which one of these stands, and empty ones, are passed over."""
    try:
        with log.open("rb") as stream:
            stream.seek(max(0, log.stat().st_size - _TAIL_BYTES))
            text = stream.read().decode(errors="replace")
    except OSError:
        return ""
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    lines = [line for line in lines if not any(word in line for word in (*without, "Extension modules:"))]
    return " | ".join(lines[-_TAIL_LINES:])
