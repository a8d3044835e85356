"""What a run shows while it goes on: on the terminal, in a notebook, or in a log every now and then."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any, Literal

from gasp_core.notebooks import in_notebook

if TYPE_CHECKING:
    from rich.console import RenderableType

__all__ = ["Progress", "Shown", "counting", "duration", "progress_for", "tell"]

Shown = bool | Literal["log"] | None
"""Whether there is a bar; None: on terminals and in notebooks; "log": there, and elsewhere a line now and then."""


class Progress:
    """Shows nothing; what a run says goes to whoever asked for more."""

    def say(self, sentence: str) -> None:
        """Tell the user something."""

    def warn(self, sentence: str) -> None:
        """Tell the user something once, however often it comes up."""

    def enter(self, phase: str) -> None:
        """What goes on from now, before the first frame."""

    def watch(self, frame: Callable[[], float]) -> None:
        """Frames go on from now; `frame` says at any moment, from any thread, how many are done, and parts of one."""

    def advance(self, frame: int, substep: float) -> None:
        """A frame is done; its smallest substep was `substep` [s]."""


class _Watched(Progress):
    """Knows how far a run is, between frames too."""

    def __init__(self, frames: int) -> None:
        self.frames = max(frames - 1, 1)
        self.phase = "preparing"
        self.substep = math.nan
        self._frame: Callable[[], float] | None = None
        self._done = 0
        self._first = 0.0
        self._since = 0.0
        self._told: set[str] = set()

    def warn(self, sentence: str) -> None:
        _, _, warning = sentence.partition(": ")
        # The same warning with other numbers comes with every frame.
        kind = "".join(letter for letter in warning if not letter.isdigit())
        if kind not in self._told:
            self._told.add(kind)
            self.say(sentence)

    def enter(self, phase: str) -> None:
        self.phase = phase

    def watch(self, frame: Callable[[], float]) -> None:
        self._frame = frame
        self._first, self._since = frame(), time.monotonic()
        self.phase = "frame"

    def advance(self, frame: int, substep: float) -> None:
        self._done, self.substep = frame, substep

    @property
    def done(self) -> float:
        """Frames that are done, and parts of one."""
        # What an engine in a process of its own is at between frames nobody knows.
        return max(float(self._done), self._frame()) if self._frame is not None else 0.0

    @property
    def left(self) -> float:
        """Seconds that it will probably take, at the speed so far; NaN where nothing is known yet."""
        made = self.done - self._first
        return (self.frames - self.done) * (time.monotonic() - self._since) / made if made > 0 else math.nan


class _Bar(_Watched):
    """A bar with the time left and the substep, on stderr."""

    def __init__(self, bar: Any, frames: int) -> None:
        super().__init__(frames)
        self._bar = bar

    def say(self, sentence: str) -> None:
        self._bar.console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def columns(self) -> dict[str, Any]:
        """What the bar shows now."""
        substep = f"substep {self.substep:.2e} s" if 0 < self.substep < math.inf else ""
        left = f"left {duration(self.left)}" if self.left == self.left else ""
        return {"completed": self.done, "phase": self.phase, "left": left, "substep": substep}


class _Lines(_Watched):
    """A line on stderr every ten seconds: for logs, and where nobody looks at once."""

    pause = 10.0
    """Seconds between two of them."""
    digits = 1
    """Behind the point of what is done: parts of frames are, of other things not."""

    def __init__(self, frames: int) -> None:
        super().__init__(frames)
        self._start = time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._go_on, name="gasp-progress", daemon=True)

    def __enter__(self) -> _Lines:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self._thread.join()

    def say(self, sentence: str) -> None:
        # Part of the outcome, as what is printed in the end is.
        print(sentence, flush=True)

    def _go_on(self) -> None:
        while not self._ended.wait(self.pause):
            self.show()

    def show(self) -> None:
        """Tell how far it is."""
        print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """How far it is."""
        since = duration(time.monotonic() - self._start)
        if self._frame is None:
            return f"{self.phase}: {since} so far"
        if self.done >= self.frames:
            return f"{self.phase} {self.frames} of {self.frames}: {since}"
        left = f", about {duration(self.left)} left" if self.left == self.left else ""
        return f"{self.phase} {self.done:.{self.digits}f} of {self.frames}: {since} so far{left}"


class _Cell(_Lines):
    """A bar below the cell of a notebook, drawn anew in its place."""

    pause = 0.5

    def __enter__(self) -> _Cell:
        from IPython.display import HTML, display

        self._handle: Any = display(HTML(self.html()), display_id=True)
        super().__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        self.show()

    def show(self) -> None:
        from IPython.display import HTML

        self._handle.update(HTML(self.html()))

    def html(self) -> str:
        """The bar, and how far it is in words."""
        return f'<progress value="{self.done:.3f}" max="{self.frames}"></progress> {escape(self.line())}'


@contextmanager
def progress_for(shown: Shown, frames: int) -> Generator[Progress]:
    """Something to tell progress to, and shown as `Shown` says."""
    if shown is not False and in_notebook():
        with _Cell(frames) as cell:
            yield cell
        return
    if shown == "log" and not sys.stderr.isatty():
        with _Lines(frames) as lines:
            yield lines
        return
    if shown is False or (shown is None and not sys.stderr.isatty()):
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    class Live(Bar):
        """Looks how far the run is whenever it is drawn."""

        watched: tuple[Any, _Bar] | None = None

        def get_renderable(self) -> RenderableType:
            if self.watched is not None:
                task, run = self.watched
                self.update(task, **run.columns())
            return super().get_renderable()

    columns = (
        TextColumn("{task.fields[phase]}"),
        MofNCompleteColumn(),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.fields[substep]}"),
    )
    with Live(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=max(frames - 1, 1), phase="preparing", left="", substep="")
        run = _Bar(bar, frames)
        bar.watched = task, run
        yield run


def duration(seconds: float) -> str:
    """A time as people say it, to two digits."""
    if seconds < 99.5:
        return f"{max(seconds, 0.1):.2g} s"
    minutes = seconds / 60
    if minutes < 99.5:
        return f"{minutes:.2g} min"
    hours = minutes / 60
    return f"{hours:.2g} h" if hours < 99.5 else f"{float(f'{hours / 24:.2g}'):,g} days"


@contextmanager
def counting(shown: Shown, what: str, total: int) -> Generator[Callable[[], None]]:
    """A bar for `total` like steps, and a function to call after each; shown as `Shown` says."""
    lines = shown == "log" and not sys.stderr.isatty()
    if shown is not False and (lines or in_notebook()):
        done = 0

        def step() -> None:
            nonlocal done
            done += 1

        with _Cell(total + 1) if in_notebook() else _Lines(total + 1) as told:
            told.watch(lambda: done)
            told.phase, told.digits = what, 0
            yield step
        return
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


def tell(shown: Shown, sentence: str) -> None:
    """A line beside a bar, for whoever sees that one."""
    if shown == "log" or shown is True or (shown is None and (sys.stderr.isatty() or in_notebook())):
        print(sentence, file=sys.stderr, flush=True)
