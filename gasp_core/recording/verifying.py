"""Whether every file of a recording is what was written: what is damaged, and which frames are not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from gasp_core.errors import GaspError, RecordingError
from gasp_core.recording.arrays import chunk_key, sound
from gasp_core.recording.checkpoints import load_checkpoint
from gasp_core.recording.commits import Commits
from gasp_core.recording.files import files_below, read_checked
from gasp_core.recording.layout import commit_key
from gasp_core.recording.reader import Recording
from gasp_core.recording.store import Store

__all__ = ["Verdict", "leading_frames", "refuse_damaged", "verify"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What `verify` found.

    Parameters
    ----------
    damaged
        A line for everything that is wrong: which file, and what.
    readable
        Frames that can be read.
    lost
        Frames that were finished and cannot.
    advice
        How to go on; empty where nothing is damaged.
    notes
        What there is to know, and is no damage.
    """

    damaged: tuple[str, ...]
    readable: tuple[int, ...]
    lost: tuple[int, ...]
    advice: str
    notes: tuple[str, ...]


def verify(recording: Recording) -> Verdict:
    """Look at every file of a recording, and read every frame's.

    Raises
    ------
    RecordingError
        Where the folder cannot be looked at.
    """
    common = [*_faults_of_all(recording)]
    damaged = list(common)
    try:
        _ = recording.frames_wanted
    except RecordingError as error:
        damaged.append(_told(recording, error))
    readable: list[int] = []
    lost = set(recording.lost)
    torn = set(recording.torn)
    for frame in (*range(recording.frame_count), *sorted((lost | torn) - set(range(recording.frame_count)))):
        faults = [*_faults_of_frame(recording, frame)]
        damaged += faults
        if faults:
            lost.add(frame)
        elif not common:
            readable.append(frame)
    if common:
        lost |= set(range(recording.frame_count))
    damaged += _faults_of_checkpoints(recording)
    strange = [*_strangers(recording)]
    damaged += [f"{key} is no file of a recording" for key, regular in strange if not regular]
    notes = [f"{key} is not of the recording" for key, regular in strange if regular]
    if not recording.header.files:
        notes.append("it was begun before version 6, which knew no checksums: only frames are checked in full")
    # A frame whose shapes come from one before it cannot be read without that.
    readable = [frame for frame in readable if not _leans_on(recording, frame) & lost]
    lost |= set(range(recording.frame_count)) - set(readable)
    return Verdict(
        damaged=tuple(damaged),
        readable=tuple(readable),
        lost=tuple(sorted(lost)),
        advice=_advice(recording, common, lost) if damaged else "",
        notes=tuple(notes),
    )


def refuse_damaged(recording: Recording) -> None:
    """Refuse to go on with a recording of which something is damaged that all frames need.

    Raises
    ------
    RecordingError
        Naming it.
    """
    for fault in _faults_of_all(recording):
        raise RecordingError(f"{recording.path}: {fault}: run it anew, or under another name")


def leading_frames(recording: Recording) -> int:
    """Frames from the first on of which nothing is damaged."""
    for frame in range(recording.frame_count):
        for _ in _faults_of_frame(recording, frame):
            return frame
    return recording.frame_count


def _faults_of_all(recording: Recording) -> Iterator[str]:
    """What is damaged of that which every frame needs."""
    root, header = recording.path, recording.header
    named = False
    for key, check in Store(root, header).files.items():
        try:
            read_checked(root, key, check)
        except RecordingError as error:
            named = True
            yield _told(recording, error)
    store = Store(root, header)
    for name in store.frame_names():
        try:
            store.frame_node(name)
        except RecordingError as error:
            named = True
            yield _told(recording, error)
    if "displacements" not in store.frame_names():
        yield "frames/displacements is missing"
    if not named:
        # Whole, and yet not what it must be; before version 6 that is all that can be known.
        try:
            _ = (recording.start_points, recording.bodies)
        except GaspError as error:
            yield _told(recording, error)


def _faults_of_frame(recording: Recording, frame: int) -> Iterator[str]:
    """What is damaged of a frame's own files."""
    try:
        commit = Commits(recording.path, recording.header).read(frame)
    except RecordingError as error:
        yield _told(recording, error)
        return
    for name in Store(recording.path, recording.header).frame_names():
        key = f"frames/{name}/{chunk_key((frame, 0, 0))}"
        check = commit.chunks.get(key)
        if check is None:
            yield f"{commit_key(frame)} does not know {key}"
        elif check.size or recording.header.files:
            try:
                content = read_checked(recording.path, key, check)
            except RecordingError as error:
                yield _told(recording, error)
            else:
                if not sound(content):
                    yield f"{key} is damaged: its checksum is another"


def _faults_of_checkpoints(recording: Recording) -> Iterator[str]:
    names = sorted({key.split("/")[1] for key, _ in files_below(recording.path, "checkpoints") if key.count("/") == 2})
    for name in names:
        if name.isdigit() and name.isascii() and len(name) == 8:
            try:
                load_checkpoint(recording.path, int(name), sealed=bool(recording.header.files))
            except RecordingError as error:
                yield _told(recording, error)


def _strangers(recording: Recording) -> Iterator[tuple[str, bool]]:
    """Files that no recording has."""
    known = {"zarr.json", "status/zarr.json", *recording.header.files}
    for key, regular in files_below(recording.path):
        parts = key.split("/")
        own = key in known or parts[0] in ("commits", "checkpoints", "frames")
        if not recording.header.files:
            own |= parts[0] in ("reference", "bodies")
        if not (own and regular):
            yield key, regular


def _leans_on(recording: Recording, frame: int) -> set[int]:
    """Frames before that a frame takes the shapes of simplices without a frame of their own from."""
    return {last for rows in recording.commit(frame).degenerate for _, last in rows}


def _advice(recording: Recording, common: list[str], lost: set[int]) -> str:
    if common:
        return "run it anew: what is damaged is needed by every frame"
    if lost:
        return (
            "gasp export and gasp render do the frames that can be read; gasp run --resume, with the scene it was made"
            f" from, computes again from the last checkpoint before frame {min(lost)}"
        )
    return "every frame can be read; gasp run --resume, with the scene it was made from, puts the rest right"


def _told(recording: Recording, error: Exception) -> str:
    return str(error).removeprefix(f"{recording.path}: ")
