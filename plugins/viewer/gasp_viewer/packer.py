"""Keeps the frames around the playhead packed, in a thread of its own.

Reading, inverting and packing a frame takes tens of milliseconds, handing a packed one over a fraction of one; so a
film plays from what is packed, and holds where nothing is yet.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import GaspError
from gasp_viewer.colouring import Scale
from gasp_viewer.layers import Packed
from gasp_viewer.painter import Eye, Subject

__all__ = ["MEMORY", "Failure", "Packer", "Paints", "Picture", "Want", "nearest_first"]

Array = NDArray[Any]

MEMORY = 2 * 2**30
"""Bytes of packed frames that are kept."""


class Paints(Protocol):
    """What makes pictures: a `Painter`."""

    def scale(self, colouring: str, count: int) -> Scale | None:
        """The range of a colouring."""
        ...

    def paint(self, subject: Subject, frame: int, scale: Scale | None, eye: Eye) -> Packed:
        """A frame, packed."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Want:
    """What is to be had packed.

    Parameters
    ----------
    subject
        What is to be seen of every frame.
    frame
        At which the playhead stands.
    count
        Frames there are.
    eye
        From where the trained colours are seen [m]; frames packed for another are still good to be shown, but are
        packed anew once none is missing.
    """

    subject: Subject
    frame: int
    count: int
    eye: Eye


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A packed frame, and the range and eye it was coloured for."""

    subject: Subject
    packed: Packed
    scale: Scale | None
    eye: Eye


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """Why there is no picture of a frame."""

    message: str


def nearest_first(frame: int, count: int) -> Array:
    """All frames, those nearest to the playhead first, on a film that begins anew at its end.

    What is ahead is needed before what is behind: a frame behind counts as twice as far.
    """
    frames = np.arange(count)
    ahead = (frames - frame) % count
    behind = (frame - frames) % count
    return np.argsort(np.minimum(ahead, 2 * behind), kind="stable")


class Packer:
    """Packs frames in the background.

    Parameters
    ----------
    painter
        Used by the packer's thread alone from now on.
    notify
        Called from that thread whenever there is something new.
    memory
        Bytes of packed frames to keep; at least one frame is.
    """

    def __init__(self, painter: Paints, notify: Callable[[], None], memory: int = MEMORY) -> None:
        self._painter = painter
        self._notify = notify
        self._memory = memory
        self._condition = threading.Condition()
        self._want: Want | None = None
        self._scale: Scale | None = None
        self._kept: dict[int, Picture | Failure] = {}
        self._error: BaseException | None = None
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="packer", daemon=True)
        self._thread.start()

    def ask(self, want: Want) -> None:
        """Say what is wanted; it replaces what was wanted before.

        Raises
        ------
        Exception
            Whatever ended the thread, where something other than a damaged frame did.
        """
        if self._error is not None:
            raise self._error
        with self._condition:
            if want == self._want:
                return
            previous, self._want = self._want, want
            if previous is None or previous.subject != want.subject:
                self._kept.clear()
            elif previous.count != want.count:
                # What could not be read may have been written since; what was taken back is no more.
                self._kept = {
                    frame: kept
                    for frame, kept in self._kept.items()
                    if frame < want.count and isinstance(kept, Picture)
                }
            self._condition.notify()

    def picture(self, frame: int) -> Picture | Failure | None:
        """What there is of a frame of the subject that is wanted; None: nothing yet."""
        with self._condition:
            return self._kept.get(frame)

    @property
    def kept_frames(self) -> int:
        """Frames that are packed."""
        with self._condition:
            return sum(isinstance(kept, Picture) for kept in self._kept.values())

    @property
    def kept_bytes(self) -> int:
        """Memory the packed frames take."""
        with self._condition:
            return self._total()

    def stop(self) -> None:
        """End the thread; waits a moment for the frame it is at."""
        with self._condition:
            self._stopped = True
            self._condition.notify()
        self._thread.join(timeout=2.0)

    def _work(self) -> None:
        try:
            while True:
                with self._condition:
                    job = self._next()
                    while job is None and not self._stopped:
                        self._condition.wait()
                        job = self._next()
                    if self._stopped or job is None:
                        return
                self._pack(*job)
                self._notify()
        except BaseException as error:
            # Raised where it can be seen: in the thread that asks.
            self._error = error
            self._notify()

    def _pack(self, want: Want, frame: int) -> None:
        scale: Scale | None = None
        result: Picture | Failure
        try:
            scale = self._painter.scale(want.subject.colouring, want.count)
            packed = self._painter.paint(want.subject, frame, scale, want.eye)
            result = Picture(subject=want.subject, packed=packed, scale=scale, eye=want.eye)
        except (GaspError, OSError) as error:
            result = Failure(message=str(error))
        except Exception as error:
            # A run that is replaced while it is read breaks in any way; the page says so and goes on.
            result = Failure(message=f"frame {frame} cannot be shown ({type(error).__name__}: {error})")
        with self._condition:
            now = self._want
            if now is None or now.subject != want.subject or frame >= now.count:
                return
            if isinstance(result, Picture) and scale != self._scale:
                # Frames of different ranges must not be shown side by side.
                self._kept.clear()
                self._scale = scale
            self._kept[frame] = result
            self._forget(nearest_first(now.frame, now.count))

    def _next(self) -> tuple[Want, int] | None:
        """The frame to pack next: the one that is looked at, then those that are missing, then those seen from
        elsewhere."""
        want = self._want
        if want is None:
            return None
        order = nearest_first(want.frame, want.count)[: self._room()]
        for frame in order.tolist():
            kept = self._kept.get(frame)
            if kept is None or (frame == want.frame and self._stale(kept, want)):
                return want, frame
        return next(((want, frame) for frame in order.tolist() if self._stale(self._kept[frame], want)), None)

    def _stale(self, kept: Picture | Failure, want: Want) -> bool:
        return isinstance(kept, Picture) and kept.eye != want.eye

    def _room(self) -> int:
        """Frames that fit into the memory."""
        largest = max((kept.packed.nbytes for kept in self._kept.values() if isinstance(kept, Picture)), default=1)
        return max(1, self._memory // max(largest, 1))

    def _total(self) -> int:
        return sum(kept.packed.nbytes for kept in self._kept.values() if isinstance(kept, Picture))

    def _forget(self, order: Array) -> None:
        """Drop the frames farthest from the playhead until the rest fits."""
        farthest = [frame for frame in order[::-1].tolist() if frame in self._kept]
        while self._total() > self._memory and len(self._kept) > 1:
            del self._kept[farthest.pop(0)]
