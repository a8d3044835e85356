"""A worker as its parent sees it: started, spoken to with a limit, watched for its death, ended."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, cast

from gasp_core.engines.worker.shared_memory import Block
from gasp_core.engines.worker.transport import PROTOCOL, Inbox, Message, send
from gasp_core.errors import EngineCrashedError, EngineEnvironmentError
from gasp_core.io.format_errors import shown
from gasp_core.processes.exit_report import ending, tail
from gasp_core.processes.group import end_group
from gasp_core.processes.scratch import Scratch

__all__ = ["WorkerProcess"]

_PATIENCE = 5.0
"""Seconds a worker may take to end once it is asked to."""
_GLANCE = 0.25
"""Seconds between looks at whether it lives. Its channel tells at once, unless a process it forked holds that open."""
_OWN_FOLDER = str(Path(__file__).parent)


class WorkerProcess:
    """A running worker.

    Parameters
    ----------
    name
        Of the engine, for messages.
    command
        What to run; `block.descriptor` is inherited under its own number.
    surroundings
        Environment variables for it.
    block
        Shared with it; closed with it.

    Raises
    ------
    EngineEnvironmentError
        Where it cannot be started.
    """

    def __init__(self, name: str, command: Sequence[str], surroundings: Mapping[str, str], block: Block) -> None:
        self.name = name
        self.block = block
        self._busy = False
        self._over = False
        self._obituary = ""
        self._owner = os.getpid()
        self._scratch = Scratch("gasp-worker-")
        self.log = self._scratch.path / f"{name}.log"
        descriptor = os.open(self.log, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_APPEND, 0o600)
        try:
            # A session of its own: Ctrl-C on the terminal is for us, who then end it in order.
            self._process = subprocess.Popen(
                command,
                env=surroundings,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=descriptor,
                pass_fds=(block.descriptor,),
                start_new_session=True,
            )
        except OSError as error:
            self._scratch.remove()
            reason = error.strerror or error
            raise EngineEnvironmentError(f'engine "{name}": {command[0]} cannot be run: {reason}') from error
        finally:
            os.close(descriptor)
        self._to = cast(BinaryIO, self._process.stdin)
        self._from = cast(BinaryIO, self._process.stdout)
        self._inbox = Inbox(self._from)

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    @property
    def is_idle(self) -> bool:
        """Whether it waits for the next message, as far as one knows."""
        return not (self._busy or self._over)

    def greet(self, limit: float) -> None:
        """Wait for its greeting for at most `limit` [s].

        Raises
        ------
        EngineCrashedError
            Where it dies or hangs before.
        EngineEnvironmentError
            Where it speaks another protocol than we do.
        """
        self._busy = True
        spoken = self._answer("starting", limit).get("protocol")
        if spoken != PROTOCOL:
            raise EngineEnvironmentError(
                f'the worker of engine "{self.name}" speaks protocol {ascii(spoken)[:60]}, this GASP {PROTOCOL}:'
                " bring both to one version of gasp-core"
            )
        self._busy = False

    def ask(self, message: Message, doing: str, limit: float, remedy: str = "") -> Message:
        """Send a message and wait for the answer, for at most `limit` [s].

        Parameters
        ----------
        message
            What to do.
        doing
            The same for the error: "opening the scene".
        limit
            Seconds after which it is given up.
        remedy
            What the user can do about that.

        Raises
        ------
        EngineCrashedError
            Where it is or becomes dead, takes longer, or says what is no answer. It is ended then.
        """
        if self._over:
            raise EngineCrashedError(self._obituary)
        # What interrupts the wait leaves it busy: its answer would be taken for that to the next question.
        self._busy = True
        try:
            send(self._to, message)
        except OSError:
            raise self._died(doing) from None
        answer = self._answer(doing, limit, remedy)
        self._busy = False
        return answer

    def crash(self, what: str) -> EngineCrashedError:
        """The error for a worker that is of no more use, which is ended; its log is kept where it says something."""
        self._end_group()
        # Of a traceback, the frames that are the same every time say nothing.
        last = shown(tail(self.log, without=[_OWN_FOLDER]))
        if last:
            self._scratch.keep()
            said = f"log of its worker: {self.log}, which ends: {last}"
        else:
            self._scratch.remove()
            said = "its worker printed nothing"
        self._obituary = f'engine "{self.name}" {what}; {said}'
        return EngineCrashedError(self._obituary)

    def discard_log(self) -> None:
        """Remove the log that a crash has left."""
        self._scratch.remove()

    def end(self) -> None:
        """End it, in order where it is not busy, and remove its log; may be called twice, and after a crash."""
        # A fork of this process has no say in it.
        if self._over or os.getpid() != self._owner:
            return
        patience = 0.0
        if self.is_idle:
            with contextlib.suppress(OSError):
                self._to.close()
            patience = _PATIENCE
        self._end_group(patience)
        self._scratch.remove()

    def _answer(self, doing: str, limit: float, remedy: str = "") -> Message:
        deadline = time.monotonic() + limit
        while True:
            left = deadline - time.monotonic()
            dead = self._process.poll() is not None
            try:
                return self._inbox.take(max(0.0, min(_GLANCE, left)))
            except TimeoutError:
                if dead:
                    raise self._died(doing) from None
                if left <= 0:
                    hint = f" ({remedy})" if remedy else ""
                    raise self.crash(f"was given up after {limit:g} s while {doing}{hint}") from None
            except EOFError:
                raise self._died(doing) from None
            except ValueError as error:
                raise self.crash(f"sent what is no message while {doing} ({error})") from None

    def _died(self, doing: str) -> EngineCrashedError:
        # Its channel is closed: it has died or is about to.
        try:
            status = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return self.crash(f"closed its channel while {doing}")
        return self.crash(f"{ending(status)} while {doing}")

    def _end_group(self, patience: float = 0.0) -> None:
        """End it and what it started, which is all in one group; it may take `patience` [s] to end by itself."""
        end_group(self._process, patience)
        self._over = True
        with contextlib.suppress(OSError):
            self._to.close()
        # A process that left the group may hold the channel open; to close what the inbox still reads would hang.
        if self._inbox.join(_PATIENCE):
            self._from.close()
        self.block.close()
