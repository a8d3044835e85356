"""What a run shows on the terminal while it goes on."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

__all__ = ["Progress", "counting", "progress_for"]


class Progress:
    """Shows nothing; what a run says goes to whoever asked for more."""

    def say(self, sentence: str) -> None:
        """Tell the user something."""

    def warn(self, sentence: str) -> None:
        """Tell the user something once, however often it comes up."""

    def advance(self, frame: int, substep: float) -> None:
        """A frame is done; its smallest substep was `substep` [s]."""


class _Bar(Progress):
    """A bar with the time left and the substep, on stderr."""

    def __init__(self, bar: Any, task: Any) -> None:
        self._bar = bar
        self._task = task
        self._told: set[str] = set()

    def say(self, sentence: str) -> None:
        self._bar.console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def warn(self, sentence: str) -> None:
        _, _, warning = sentence.partition(": ")
        # The same warning with other numbers comes with every frame.
        kind = "".join(letter for letter in warning if not letter.isdigit())
        if kind not in self._told:
            self._told.add(kind)
            self.say(sentence)

    def advance(self, frame: int, substep: float) -> None:
        self._bar.update(self._task, completed=frame, substep=f"{substep:.2e} s" if 0 < substep < math.inf else "")


@contextmanager
def progress_for(shown: bool | None, frames: int) -> Generator[Progress]:
    """Something to tell progress to; it is shown where asked for, or (None) where stderr is a terminal."""
    if shown is False or (shown is None and not sys.stderr.isatty()):
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("frame"),
        MofNCompleteColumn(),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("substep {task.fields[substep]}"),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        yield _Bar(bar, bar.add_task("", total=max(frames - 1, 1), substep=""))


@contextmanager
def counting(shown: bool | None, what: str, total: int) -> Generator[Callable[[], None]]:
    """A bar for `total` like steps, and a function to call after each; shown as in `progress_for`."""
    if shown is False or (shown is None and not sys.stderr.isatty()):
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        MofNCompleteColumn(),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
