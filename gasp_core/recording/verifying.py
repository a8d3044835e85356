"""Whether every file of a recording is what was written: what is damaged, and which frames are not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gasp_core.errors import GaspError, RecordingError
from gasp_core.recording.arrays import chunk_key, sound
from gasp_core.recording.checkpoints import load_checkpoint
from gasp_core.recording.commits import Commits
from gasp_core.recording.files import TooLargeError, UnreadableError, files_below, is_folder, read_file
from gasp_core.recording.layout import FILES, commit_key
from gasp_core.recording.nodes import MOST_BYTES, whole
from gasp_core.recording.reader import Recording
from gasp_core.recording.store import Store

__all__ = ["Verdict", "leading_frames", "readable_frames", "refuse_damaged", "verify"]

_ANEW = "fetch it again, or run it anew: what is damaged is needed by every frame"


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


def verify(path: str | Path) -> Verdict:
    """Look at every file of a recording, and read every frame's.

    Raises
    ------
    RecordingError
        Where it is no recording, one of a newer version, or cannot be looked at.
    """
    path = Path(path)
    try:
        recording = Recording.open(path)
    except RecordingError as error:
        if not _lost_its_header(path):
            raise
        told = str(error).removeprefix(f"{path}: ")
        return Verdict(damaged=(told,), readable=(), lost=(), advice=_ANEW, notes=())
    whole_run = [*_faults_of_all(recording)]
    # Where the points began, and how fast they are, is nothing that is drawn.
    common = [fault for fault in whole_run if not fault.startswith(("reference/points/", "frames/velocities/"))]
    good, faults = readable_frames(recording)
    damaged = [*whole_run, *_faults_of_groups(recording), *(fault for found in faults.values() for fault in found)]
    if recording.has_velocities:
        # Nothing that is drawn needs them.
        store = Store(recording.path, recording.header)
        damaged += [fault for frame in good for fault in _told_of_frame(store, frame, ["velocities"])]
    try:
        _ = recording.frames_wanted
    except RecordingError as error:
        damaged.append(_told(recording.path, error))
    damaged += _faults_of_checkpoints(recording)
    strange = [*_strangers(recording)]
    damaged += [f"{key} is no file of a recording" for key, regular in strange if not regular]
    notes = [f"{key} is not of the recording" for key, regular in strange if regular]
    if not recording.header.files:
        notes.append("it was begun before version 6, which knew no checksums: only frames are checked in full")
    lost = tuple(range(recording.frame_count)) if common else tuple(faults)
    return Verdict(
        damaged=tuple(dict.fromkeys(damaged)),
        readable=() if common else good,
        lost=lost,
        advice=_advice(bool(common), bool(whole_run), lost) if damaged else "",
        notes=tuple(notes),
    )


def readable_frames(recording: Recording) -> tuple[tuple[int, ...], dict[int, list[str]]]:
    """Frames whose Gaussians can be read, and what is wrong with the files of the others, by their number."""
    store = Store(recording.path, recording.header)
    drawn = [name for name in store.frame_names() if name != "velocities"]
    faults = {frame: found for frame in _numbers(recording) if (found := _told_of_frame(store, frame, drawn))}
    good = [frame for frame in _numbers(recording) if frame not in faults]
    for frame in good if faults else ():
        # The shapes of simplices without a frame of their own are those of an earlier one.
        for lost in sorted(_leans_on(recording, frame) & faults.keys()):
            faults.setdefault(frame, []).append(f"frame {frame} has shapes of frame {lost}, which is damaged")
    return tuple(frame for frame in good if frame not in faults), dict(sorted(faults.items()))


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
    """Frames from the first on of which nothing is damaged.

    Raises
    ------
    UnreadableError
        Where the next one cannot be read now, and so nobody knows.
    """
    store = Store(recording.path, recording.header)
    names = store.frame_names()
    for frame in [*range(recording.frame_count), *recording.torn]:
        for error in _faults_of_frame(store, frame, names):
            if isinstance(error, UnreadableError):
                raise error
            if frame < recording.frame_count:
                return frame
    return recording.frame_count


def _numbers(recording: Recording) -> list[int]:
    """All frames that there are, or were."""
    return sorted({*range(recording.frame_count), *recording.lost, *recording.torn})


def _faults_of_all(recording: Recording) -> Iterator[str]:
    """What is damaged of that which every frame needs."""
    store = Store(recording.path, recording.header)
    named = False
    for key in sorted(store.files.keys() - set(store.groups)):
        try:
            store.checked(key, store.files[key])
        except TooLargeError:
            raise
        except RecordingError as error:
            named = True
            yield _told(recording.path, error)
    for name in store.frame_names():
        try:
            store.frame_node(name)
        except RecordingError as error:
            named = True
            yield _told(recording.path, error)
    if "displacements" not in store.frame_names():
        yield "frames/displacements is missing"
    if not named:
        # Whole, and yet not what it must be; before version 6 that is all that can be known.
        try:
            _ = (recording.start_points, recording.bodies)
        except TooLargeError:
            raise
        except GaspError as error:
            yield _told(recording.path, error)


def _faults_of_groups(recording: Recording) -> Iterator[str]:
    """What is damaged that no frame needs: what makes a folder a group to other readers of Zarr."""
    store = Store(recording.path, recording.header)
    for key in store.groups:
        try:
            store.checked(key, store.files[key])
        except RecordingError as error:
            yield _told(recording.path, error)


def _faults_of_frame(store: Store, frame: int, names: Sequence[str]) -> Iterator[RecordingError]:
    """What is damaged of a frame's commit, and of its chunks of the arrays of these names."""
    try:
        commit = Commits(store).read(frame)
    except RecordingError as error:
        yield error
        return
    for name in names:
        key = f"frames/{name}/{chunk_key((frame, 0, 0))}"
        check = commit.chunks.get(key)
        if check is None:
            yield RecordingError(f"{store.root}: {commit_key(frame)} does not know {key}")
        elif check.size or store.files:
            try:
                content = store.checked(key, check)
            except RecordingError as error:
                yield error
            else:
                if not sound(content):
                    yield RecordingError(f"{store.root}: {key} is damaged: its checksum is another")


def _told_of_frame(store: Store, frame: int, names: Sequence[str]) -> list[str]:
    return [_told(store.root, error) for error in _faults_of_frame(store, frame, names)]


def _faults_of_checkpoints(recording: Recording) -> Iterator[str]:
    names = sorted({key.split("/")[1] for key, _ in files_below(recording.path, "checkpoints") if key.count("/") == 2})
    for name in names:
        if name.isdigit() and name.isascii() and len(name) == 8:
            try:
                load_checkpoint(recording.path, int(name), sealed=bool(recording.header.files))
            except RecordingError as error:
                yield _told(recording.path, error)


def _strangers(recording: Recording) -> Iterator[tuple[str, bool]]:
    """Files that no recording has."""
    known = {"zarr.json", "status/zarr.json", *recording.header.files}
    for key, regular in files_below(recording.path):
        parts = key.split("/")
        grown = parts[0] in ("commits", "checkpoints", "frames") and FILES.fullmatch(parts[-1]) is not None
        own = key in known or grown
        if not recording.header.files:
            own |= parts[0] in ("reference", "bodies")
        if not (own and regular):
            yield key, regular


def _leans_on(recording: Recording, frame: int) -> set[int]:
    """Frames before that a frame takes the shapes of simplices without a frame of their own from."""
    return {last for rows in recording.commit(frame).degenerate for _, last in rows}


def _lost_its_header(path: Path) -> bool:
    """Whether a folder has all of a recording but a whole header."""
    if not all(is_folder(path, name) for name in ("reference", "frames", "commits")):
        return False
    try:
        return not whole(read_file(path, "zarr.json", MOST_BYTES))
    except FileNotFoundError:
        return True


def _advice(anew: bool, ended: bool, lost: tuple[int, ...]) -> str:
    if anew:
        return _ANEW
    if ended:
        return "gasp export and gasp render do the frames that can be read; the run cannot be gone on with, run it anew"
    if lost:
        return (
            "gasp export and gasp render do the frames that can be read; gasp run --resume, with the scene it was made"
            f" from, computes again from the last checkpoint before frame {lost[0]}"
        )
    return "every frame can be read; gasp run --resume, with the scene it was made from, puts the rest right"


def _told(root: Path, error: Exception) -> str:
    return str(error).removeprefix(f"{root}: ")
