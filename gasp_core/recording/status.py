"""The status of a recording: what changes while it is made, and where it is gone on with."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from gasp_core.errors import RecordingError
from gasp_core.recording.checks import check_status
from gasp_core.recording.nodes import read_attributes, write_attributes

__all__ = ["ENDED_WITHOUT_A_WORD", "RecordedStatus", "read_status", "write_status"]

ENDED_WITHOUT_A_WORD = "the process that wrote it ended without a word (killed, crashed, or the machine stopped)"
"""Said of a recording that is "running", where nobody holds its lock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedStatus:
    """How far a run is.

    Parameters
    ----------
    state, reason
        "running", "complete", or "incomplete" and why.
    frames_wanted
        Once it is complete.
    scene
        As TOML, where the run was gone on with and it is not the header's any more: duration, camera and where files
        lie may change, which decide no frame that is there. Empty otherwise. Programs that do not know of it take the
        header's.
    """

    state: str
    reason: str
    frames_wanted: int
    scene: str = ""


def read_status(root: Path, *, seal: bool) -> RecordedStatus:
    """The status of a recording; `seal` as of `read_attributes`.

    Raises
    ------
    RecordingError
        Where it is missing or damaged.
    """
    try:
        state = read_attributes(root, "status/zarr.json", seal=seal)
        check_status(state)
    except FileNotFoundError:
        raise RecordingError(
            f"{root}: has lost its status (status/zarr.json); its frames can be read all the same"
        ) from None
    except ValueError as error:
        raise RecordingError(f"{root}: status/zarr.json is damaged: {error}") from None
    return RecordedStatus(
        state=state["state"], reason=state["reason"], frames_wanted=state["frames_wanted"], scene=state.get("scene", "")
    )


def write_status(root: Path, status: RecordedStatus) -> None:
    """Make that the status of a recording, in one step."""
    told = dataclasses.asdict(status)
    if not status.scene:
        told.pop("scene")
    write_attributes(root / "status", told)
