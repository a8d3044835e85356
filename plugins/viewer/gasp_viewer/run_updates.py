"""What is new about a run that may still go on, be taken back, or vanish while it is looked at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from gasp_core.errors import GaspError
from gasp_core.recording import Recording
from gasp_core.rendering.footage import Footage, RecordedFootage
from gasp_core.rendering.framing import Motion, motion_of

__all__ = ["FileNews", "News", "RunNews", "Source", "figure"]


@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """How a footage stands.

    Parameters
    ----------
    count
        Frames there are; 0 where all are gone.
    status
        For the user, a word or a sentence.
    growing
        More frames may come.
    problem
        What is wrong with it; may be empty.
    """

    count: int
    status: str
    growing: bool = False
    problem: str = ""


class Source(Protocol):
    """Where news come from; never raises."""

    def look(self) -> News:
        """How it stands now."""
        ...

    def facts(self, frame: int) -> list[tuple[str, str]]:
        """Names and values for the panel."""
        ...

    def extended(self, motion: Motion, frame: int) -> Motion:
        """A motion, and where matter is in a frame."""
        ...


class FileNews:
    """Of a splat file, still or moving: nothing ever happens to it.

    Parameters
    ----------
    footage
        The file.
    """

    def __init__(self, footage: Footage) -> None:
        splats = footage.splats(0)
        self._count = footage.frame_count
        self._frame_rate = footage.frame_rate
        self._facts = [
            ("file", footage.path.name),
            ("Gaussians", f"{len(splats):,}"),
            ("SH degree", str(splats.sh_degree)),
        ]

    def look(self) -> News:
        """Its frames, for ever."""
        return News(count=self._count, status="complete" if self._count > 1 else "")

    def facts(self, frame: int) -> list[tuple[str, str]]:
        """What is in it."""
        time = [("time", figure(frame / self._frame_rate, "s"))] if self._count > 1 else []
        return time + self._facts

    def extended(self, motion: Motion, frame: int) -> Motion:
        """The motion: all of it was there from the beginning."""
        return motion


class RunNews:
    """Of a recording. It has a reader of its own: one is not to be used from two threads.

    Parameters
    ----------
    footage
        The recording that is shown.
    """

    def __init__(self, footage: RecordedFootage) -> None:
        self._path: Path = footage.path
        self._header = footage.recording.header
        self._recording = Recording.open(self._path)
        self._gaussians = len(footage.recording.moving)
        self._simulated = int(footage.recording.moving.sum())
        self._points = sum(body.last - body.first for body in self._header.bodies)

    def look(self) -> News:
        """Frames, status and what is wrong."""
        count = 0
        try:
            # Opened anew: the run may have been replaced by another one.
            header = Recording.open(self._path).header
            if (header.scene_digest, header.points_digest) != (self._header.scene_digest, self._header.points_digest):
                return News(count=0, status="replaced", problem="Another run is here now: start gasp view again.")
            count = self._recording.frame_count
            status, wanted = self._recording.status, self._recording.frames_wanted
            if status == "incomplete":
                reason = self._recording.reason
                return News(count=count, status=f"incomplete: {reason}" if reason else "incomplete")
            if status == "running":
                return News(count=count, status=f"running, {wanted} frames in the end", growing=True)
            return News(count=count, status=status)
        except (GaspError, OSError) as error:
            return News(count=count, status="unknown", problem=str(error))

    def facts(self, frame: int) -> list[tuple[str, str]]:
        """Of the step that led to a frame."""
        try:
            step: dict[str, Any] = self._recording.diagnostics(frame)
        except (GaspError, OSError):
            # The frame was taken back, or is damaged; the picture's own message says so.
            step = {}
        simulated = "all" if self._simulated == self._gaussians else f"{self._simulated:,} of them"
        facts = [
            ("time", figure(step.get("time"), "s")),
            ("engine", f"{self._header.engine.name} ({self._header.engine.device}, {self._header.engine.precision})"),
            ("Gaussians", f"{self._gaussians:,}, {simulated} simulated"),
            ("points", f"{self._points:,}"),
            ("substeps", figure(step.get("substeps"))),
            ("smallest substep", figure(step.get("smallest_substep"), "s")),
            ("kinetic energy", figure(step.get("kinetic_energy"), "J")),
            ("potential energy", figure(step.get("potential_energy"), "J")),
            ("degenerate", figure(step.get("degenerate"))),
            ("stretched", figure(step.get("stretched"))),
        ]
        return facts + [("warning", warning) for warning in step.get("warnings", [])]

    def extended(self, motion: Motion, frame: int) -> Motion:
        """The motion, and where the matter of the frame is."""
        try:
            now = motion_of(RecordedFootage(self._recording), [frame])
        except (GaspError, OSError):
            return motion
        return Motion.joined([motion, now])


def figure(value: float | None, unit: str = "") -> str:
    """A number with four digits, whole ones whole; a dash where there is none."""
    if value is None:
        return "–"
    text = f"{value:,}" if isinstance(value, int) else f"{value:.4g}"
    return f"{text} {unit}".strip()
