"""What is to be run, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gasp_core.errors import SceneError

if TYPE_CHECKING:
    from gasp_core.recording import Recording
    from gasp_core.scene.model import Scene

__all__ = ["Limits", "Outcome", "Run", "RunStatus"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a run may take before it is given up; None: whatever it wants.

    Parameters
    ----------
    seconds
        Of wall time, start included.
    memory [bytes]
        Resident, of its process and all that this started, together.
    threads
        Of its engine and its libraries; None: as many as there are processors.

    Raises
    ------
    SceneError
        Where a number is impossible.
    """

    seconds: float | None = None
    memory: int | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.seconds is not None and not 0 < self.seconds < float("inf"):
            raise SceneError(f"time_limit must be a number of seconds > 0, found {self.seconds!r}")
        if self.memory is not None and self.memory < 1:
            raise SceneError(f"memory_limit must be a number of bytes > 0, found {self.memory!r}")
        if self.threads is not None and self.threads < 1:
            raise SceneError(f"threads must be at least 1, found {self.threads!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One simulation, to be made in a process of its own.

    Parameters
    ----------
    key
        Its name, unique among those carried out together.
    scene
        What happens; the engine, by name, its options, device, precision and accuracy are in it.
    out
        Folder of the recording; nothing may be there yet.
    frames
        Stop once there are so many, the one at time 0 included; None: all of the scene's.
    trust_code
        As for `simulate`.
    measure
        Called with the recording, where that was made, if it has a frame; what it gives is `Outcome.found`.
    keep
        Whether the recording stays at `out`; if not, it is made where there is room, and gone once it is measured.
    address
        Where it is kept instead, s3://bucket/run.gasp, see `gasp_core.recording.addresses`; what is there is replaced.
    """

    key: str
    scene: Scene
    out: Path
    frames: int | None = None
    trust_code: bool = False
    measure: Callable[[Recording], Mapping[str, Any]] | None = None
    keep: bool = True
    address: str = ""


class RunStatus(Enum):
    """How a run ended."""

    COMPLETE = "complete"
    """All frames that were asked for are there."""
    DIVERGED = "diverged"
    """The state was no longer credible; the frames before are there."""
    CRASHED = "crashed"
    """A process died, hung beyond the time limit, or its engine failed with an error no engine should raise."""
    UNABLE = "unable"
    """The engine does not declare what the scene needs, or is not there, broken, or not ready here."""
    FAILED = "failed"
    """Another error: of the scene, the splats, the disk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a run.

    Parameters
    ----------
    key
        Of the `Run`.
    ending
        How it ended.
    reason
        Why, in one line; empty where it is complete.
    recording
        Where its frames are; None where there is none.
    frame_count
        Of the recording, the frame at time 0 included.
    substeps
        Of the engine, over these frames.
    wall_seconds
        Of the whole process [s]: start of the interpreter, imports, reading, opening, frames, ending.
    start_seconds
        Of that, until it was in its stride [s]: everything before frame 0 was recorded, and what the first frame took
        above the median of the later ones, for a backend that compiles when first called hides that there. Where it
        recorded nothing, all of `wall_seconds`.
    run_seconds
        Of that, the frames [s], less what `start_seconds` has of the first. With two frames or fewer nothing can be
        told apart, and all of the first is here.
    cpu_seconds
        Processor time [s], user and system, of the process and of those it started and saw end.
    run_cpu_seconds
        Processor time [s] of the frames after the first: of the process and of those it started, such as the worker of
        an isolated engine. 0 where there is no frame after the first.
    peak_bytes
        Memory: the largest resident size that the process itself ever had, plus the largest of any one process
        that it started. The two may have been at different times, and pages they share count twice, so it is an upper
        bound; the memory of a GPU is not in it. Measured at frames, so that of a run that died what came after the last
        look (at most 2 s, or one frame) is missing. 0 where it died before its first frame.
    found
        What `Run.measure` gave.
    """

    key: str
    ending: RunStatus
    reason: str = ""
    recording: Path | None = None
    frame_count: int = 0
    substeps: int = 0
    wall_seconds: float = 0.0
    start_seconds: float = 0.0
    run_seconds: float = 0.0
    cpu_seconds: float = 0.0
    run_cpu_seconds: float = 0.0
    peak_bytes: int = 0
    found: Mapping[str, Any] = field(default_factory=dict[str, Any])
