"""Which frames a recording has: its commits, a tail that was torn, and holes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from gasp_core.errors import RecordingError
from gasp_core.recording.checks import commit_of
from gasp_core.recording.files import short
from gasp_core.recording.layout import Commit, commit_key
from gasp_core.recording.nodes import read_attributes
from gasp_core.recording.store import Store

__all__ = ["Commits", "Found", "numbered", "too_many_lost"]

_SPANS = 8
"""Stretches of frames that a message names."""
_MOST_LOST, _LOST_FOR_EACH = 10_000, 100
"""Frames that may be missing, and for each that is there: with more of them it is no recording that was damaged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a look into the folder of commits gave.

    Parameters
    ----------
    count
        Frames up to the last one whose commit is good.
    lost
        Those before it that have no commit: holes.
    torn
        Those after it whose commits are damaged: they were being written, and count as never written.
    """

    count: int = 0
    lost: tuple[int, ...] = ()
    torn: tuple[int, ...] = ()


class Commits:
    """The commits of a recording, which may grow, or be taken back, while it is looked at."""

    def __init__(self, store: Store) -> None:
        self._root = store.root
        self._store = store
        self._found: Found | None = None

    def look(self) -> Found:
        """Which frames there are now.

        Raises
        ------
        RecordingError
            Where the folder of commits cannot be read.
        """
        before = self._found
        if before is None or (before.count and not self._there(before.count - 1)):
            before = self._searched()
        count = before.count
        if count not in before.torn:
            while self._there(count):
                count += 1
        if count != before.count:
            before = Found(count=count, lost=before.lost)
        self._found = before
        return before

    def read(self, frame: int) -> Commit:
        """The commit of a frame.

        Raises
        ------
        RecordingError
            Where it is missing or damaged; the message names its file.
        """
        key, store = commit_key(frame), self._store
        try:
            attributes = read_attributes(self._root, key, store.plausible_rows, seal=bool(store.files))
            return commit_of(attributes, frame, store.header)
        except FileNotFoundError:
            raise RecordingError(f"{self._root}: frame {frame} is lost: {key} is missing") from None
        except (ValueError, KeyError, TypeError, AttributeError, ArithmeticError) as error:
            raise RecordingError(f"{self._root}: frame {frame} is lost: {key} is damaged ({short(error)})") from None

    def _searched(self) -> Found:
        """From the names in the folder."""
        try:
            names = [entry.name for entry in os.scandir(self._root / "commits")]
        except FileNotFoundError:
            return Found()
        except OSError as error:
            raise RecordingError(f"{self._root}: commits cannot be read: {error.strerror or error}") from None
        there = {int(name) for name in names if len(name) == 8 and name.isascii() and name.isdigit()}
        kept = sorted(frame for frame in there if self._there(frame))
        torn: list[int] = []
        while kept and not self._good(kept[-1]):
            torn.append(kept.pop())
        count = kept[-1] + 1 if kept else 0
        if too_many_lost(count - len(kept), len(kept)):
            raise RecordingError(f"{self._root}: commits are damaged: {count - len(kept):,} of them are missing")
        known = set(kept)
        return Found(
            count=count,
            lost=tuple(frame for frame in range(count) if frame not in known),
            torn=tuple(sorted(torn)),
        )

    def _good(self, frame: int) -> bool:
        try:
            self.read(frame)
        except RecordingError:
            return False
        return True

    def _there(self, frame: int) -> bool:
        return os.path.lexists(f"{os.fspath(self._root)}/{commit_key(frame)}")


def too_many_lost(lost: int, there: int) -> bool:
    """Whether more frames are missing than damage explains, beside those that are there: they are only claimed."""
    return lost > max(_MOST_LOST, _LOST_FOR_EACH * there)


def numbered(frames: Sequence[int]) -> str:
    """Frames in words, the first of them by their numbers: frames 3, 7 and 12 to 40."""
    spans: list[list[int]] = []
    for frame in frames:
        if spans and frame == spans[-1][1] + 1:
            spans[-1][1] = frame
        else:
            spans.append([frame, frame])
    told = [str(first) if first == last else f"{first} to {last}" for first, last in spans[:_SPANS]]
    more = f" and {len(spans) - _SPANS} more stretches" if len(spans) > _SPANS else ""
    return f"frame{'s' * (len(frames) != 1)} {', '.join(told)}{more}"
