"""Where a film stands, and how it moves on: pure, the time that went by is handed in."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["Film", "Playhead", "advanced", "pressed", "sought"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is played.

    Parameters
    ----------
    count
        Frames there are, >= 1.
    frame_rate
        Frames a second at speed 1.
    growing
        More frames may come.
    """

    count: int
    frame_rate: float
    growing: bool = False

    @property
    def last(self) -> int:
        """The last frame."""
        return self.count - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Playhead:
    """Where the film stands.

    Parameters
    ----------
    position
        In frames; frame k is shown from k until k + 1.
    playing
        Whether it moves.
    """

    position: float = 0.0
    playing: bool = False

    @property
    def frame(self) -> int:
        """The frame that is shown."""
        return int(self.position)


def advanced(head: Playhead, film: Film, seconds: float, *, speed: float, loop: bool) -> Playhead:
    """The playhead after some seconds.

    At the end it begins anew (`loop`), waits for the frame to come (a film that grows), or stops at the last frame.
    """
    if not head.playing:
        return sought(head, film, head.position)
    position = head.position + seconds * speed * film.frame_rate
    if position < film.count:
        return replace(head, position=position)
    if loop and film.count > 1:
        return replace(head, position=position % film.count)
    return Playhead(position=float(film.last), playing=film.growing)


def sought(head: Playhead, film: Film, position: float) -> Playhead:
    """The playhead moved to a position, or to the nearest there is."""
    # Beyond the last frame's start but before its end is on the film.
    inside = position if 0 <= position < film.count else float(min(max(position, 0.0), film.last))
    return replace(head, position=inside)


def pressed(head: Playhead, film: Film) -> Playhead:
    """The playhead after its button was pressed: playing or not; from the start where it stood at the end."""
    if head.playing:
        return replace(head, playing=False)
    at_end = head.frame >= film.last and not film.growing
    return Playhead(position=0.0 if at_end else head.position, playing=film.count > 1 or film.growing)
