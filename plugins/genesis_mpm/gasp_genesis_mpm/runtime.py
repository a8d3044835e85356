"""Genesis is started once a process. Its scenes are lent to sessions, and kept for the next.

Building one costs seconds, even with all kernels in Genesis' cache, and some of its memory is only ever given back by
starting Genesis anew.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Generator
from typing import Any

__all__ = ["Lender", "lender"]

_KEPT = 8
"""Scenes that nobody uses."""
_BUILT = 48
"""Scenes after which Genesis is started anew, once nobody uses any."""


class Lender:
    """The scenes of this process."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._idle: list[tuple[Any, Any]] = []
        self._sessions = 0
        self._built = 0
        self._started = False

    def enter(self) -> None:
        """A session begins."""
        with self._lock:
            if not self._started or (not self._sessions and self._built > _BUILT):
                self._start()
            self._sessions += 1

    def leave(self) -> None:
        """A session has ended."""
        with self._lock:
            self._sessions -= 1

    def lend(self, blueprint: Any) -> Any:
        """A `gasp_genesis_mpm.genesis_scene.Stage` of the blueprint, for nobody else."""
        from gasp_genesis_mpm.genesis_scene import Stage

        with self._lock:
            for number, (own, stage) in enumerate(self._idle):
                if own == blueprint:
                    del self._idle[number]
                    return stage
            with _quiet():
                stage = Stage(blueprint)
            self._built += 1
            return stage

    def take_back(self, blueprint: Any, stage: Any) -> None:
        """A scene that is not used any more."""
        with self._lock:
            self._idle.append((blueprint, stage))
            while len(self._idle) > _KEPT:
                _, oldest = self._idle.pop(0)
                self.discard(oldest)

    def discard(self, stage: Any) -> None:
        """A scene that nobody is to use again."""
        with self._lock, _quiet():
            stage.destroy()

    def _start(self) -> None:
        with _quiet():
            import genesis  # pyright: ignore[reportMissingImports]

            self._idle.clear()
            genesis.destroy()
            genesis.init(
                backend=genesis.cpu,
                precision="32",
                # What it has to say comes as an exception too.
                logging_level="critical",
            )
        self._started, self._built = True, 0


@contextlib.contextmanager
def _quiet() -> Generator[None, None, None]:
    """What Genesis prints goes to standard error: standard output belongs to whoever opened the session."""
    # Otherwise Quadrants takes a redirected output for a notebook's, and prints through it for good.
    os.environ.setdefault("QD_ENABLE_PYBUF", "0")
    with contextlib.redirect_stdout(sys.stderr):
        yield


lender = Lender()
"""The one of this process."""
