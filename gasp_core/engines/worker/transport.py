"""Messages between a process and its worker: one line of JSON each, in either direction."""

from __future__ import annotations

import json
import queue
import threading
from typing import Any, BinaryIO, cast

__all__ = ["PROTOCOL", "Inbox", "Message", "send"]

Message = dict[str, Any]

PROTOCOL = 1
"""Of the messages; a worker that greets with another one is not talked to."""
_LONGEST = 1 << 26
"""Bytes of a message; arrays are not in it."""


def send(stream: BinaryIO, message: Message) -> None:
    """Write one message.

    Raises
    ------
    OSError
        Where nobody reads at the other end any more.
    """
    stream.write(json.dumps(message, separators=(",", ":")).encode() + b"\n")
    stream.flush()


class Inbox:
    """What arrives on a stream, read by a thread: waiting for it can have a limit, and its end is noticed at once.

    Parameters
    ----------
    stream
        Read until its end.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._read, args=(stream,), daemon=True, name="gasp worker inbox")
        self._thread.start()

    def take(self, timeout: float | None = None) -> Message:
        """The next message.

        Raises
        ------
        TimeoutError
            Where none has come within `timeout` [s].
        EOFError
            Where none will come any more.
        ValueError
            Where what came is no message.
        """
        try:
            line = self._lines.get(timeout=timeout)
        except queue.Empty:
            raise TimeoutError from None
        if not line:
            self._lines.put(b"")  # for whoever asks again
            raise EOFError
        try:
            message: object = json.loads(line)
        except RecursionError:
            raise ValueError("it is too deep") from None
        if not isinstance(message, dict):
            raise ValueError("a message is a JSON object")
        return cast(Message, message)

    def join(self, timeout: float) -> bool:
        """Wait for the end of the stream for at most `timeout` [s]; whether it has come."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _read(self, stream: BinaryIO) -> None:
        try:
            while line := stream.readline(_LONGEST):
                self._lines.put(line)
        except (OSError, ValueError):
            pass  # closed under our hands: as good as its end
        self._lines.put(b"")
