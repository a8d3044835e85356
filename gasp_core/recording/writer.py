"""Writes a recording frame by frame; each is durable, and visible, once it is whole."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.gaussians import Gaussians
from gasp_core.processes.scratch import clear_left_over
from gasp_core.recording.arrays import array_node, chunk_key, encoded
from gasp_core.recording.checkpoints import checkpoint_files, load_checkpoint
from gasp_core.recording.creating import create_store
from gasp_core.recording.durable import discard, folder_in_the_making, remove_leftovers, replace_file, sync_folder
from gasp_core.recording.files import FileCheck, UnreadableError, checksum
from gasp_core.recording.layout import FILES, FORMAT, Commit, Header, commit_attributes, commit_key
from gasp_core.recording.lock import lock
from gasp_core.recording.nodes import group, read_node, sealed, write_attributes
from gasp_core.recording.reader import Recording
from gasp_core.recording.status import ENDED_WITHOUT_A_WORD, RecordedStatus, write_status
from gasp_core.recording.store import Store
from gasp_core.recording.verifying import leading_frames, refuse_damaged

__all__ = ["RecordingWriter", "ended_without_a_word", "refuse_existing", "split_displacements"]

Array = NDArray[Any]

_KEPT_CHECKPOINTS = 2


def split_displacements(displacements: Array, bodies: Sequence[slice]) -> tuple[Array, Array]:
    """Displacements (P, 3) float64 as the mean of each body, (bodies, 3), and the rest, (P, 3) float32."""
    means = np.array([displacements[points].mean(axis=0) for points in bodies])
    relative = np.empty(displacements.shape, dtype=np.float32)
    for points, mean in zip(bodies, means):
        relative[points] = displacements[points] - mean
    return means, relative


class RecordingWriter:
    """The writing end of a recording; holds its lock until closed."""

    def __init__(self, path: Path, header: Header, descriptor: int, frames_wanted: int, scene: str) -> None:
        self.path = path
        self.header = header
        self._descriptor: int | None = descriptor
        self._frames_wanted = frames_wanted
        # The header is what it is: whoever reads it while it is gone on with relies on that.
        self._scene = "" if scene == header.scene else scene
        self.note = ""
        """A sentence for the user, where damaged frames are computed again."""
        self._bodies = [slice(body.first, body.last) for body in header.bodies]
        store = Store(path, header)
        self._frames = {name: store.frame_node(name) for name in store.frame_names()}
        self._start = store.array("reference/points", (store.points, 3), "f")

    @classmethod
    def create(
        cls,
        path: Path,
        header: Header,
        *,
        reference: Gaussians,
        moving: Array,
        points: Array,
        carriers: Sequence[Mapping[str, Array]],
        frames_wanted: int,
        velocities: bool,
        overwrite: bool,
        drifting: int = 0,
    ) -> RecordingWriter:
        """Begin a recording; it appears under its name with all but the frames in it.

        `drifting` is the number of vertices that move by themselves, but for those that do by a formula.

        Raises
        ------
        RecordingError
            Where something is there already, or the folder cannot be written.
        """
        replaced = refuse_existing(path, overwrite)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            remove_leftovers(path)
            with folder_in_the_making(path) as folder:
                rows = {"displacements": len(points)}
                rows |= {"velocities": len(points)} if velocities else {}
                rows |= {"drifts": drifting} if drifting else {}
                arrays = _arrays(reference, moving, points, carriers)
                header = create_store(folder, header, arrays, rows, frames_wanted)
                if replaced:
                    discard(path)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from None
        return cls(path, header, _locked(path), frames_wanted, header.scene)

    @property
    def keeps_velocities(self) -> bool:
        """Whether frames need velocities too."""
        return "velocities" in self._frames

    @classmethod
    def resume(cls, found: Recording, frames_wanted: int, scene: str) -> tuple[RecordingWriter, int, dict[str, Array]]:
        """Go on with a recording: the writer, the last frame that is kept, and the engine's state there.

        Whether it may be gone on with, `gasp_core.recording.continuing.refuse_other` says. `scene` is what it is gone
        on with, as TOML: duration and camera may be others than before.

        Frames after the last usable checkpoint are taken back, and so are those from the first damaged one on. With no
        checkpoint the state is empty and frame 0 is kept; -1 where there is not even that. Where all frames are there
        and whole, all are kept.

        Raises
        ------
        RecordingError
            Where it is being written now, or the disk refuses; where what all frames need is damaged.
        """
        path = found.path
        remove_leftovers(path)
        descriptor = _locked(path)
        try:
            refuse_damaged(found)
            writer = cls(path, found.header, descriptor, frames_wanted, scene)
            clear_left_over(".", path / "checkpoints")
            writer._mend_groups()
            count = leading_frames(found)
            if count < found.frame_count or found.torn:
                writer.note = f"frame {count} of {path} is damaged: it and those after it are computed again"
            frame, state = writer._last_checkpoint(count)
            if count >= frames_wanted:
                frame, state = count - 1, {}
            writer._take_back(frame + 1)
            for name, node in writer._frames.items():
                if node.shape[0] < frames_wanted:
                    longer = dataclasses.replace(node, shape=(frames_wanted, *node.shape[1:]))
                    replace_file(path / "frames" / name / "zarr.json", sealed(array_node(longer)))
            writer._write_status("running", "")
            return writer, frame, state
        except OSError as error:
            os.close(descriptor)
            raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from None
        except BaseException:
            os.close(descriptor)
            raise

    def write_frame(
        self,
        frame: int,
        time: float,
        *,
        relative: Array,
        means: Array,
        velocities: Array | None,
        degenerate: Sequence[Array],
        diagnostics: Mapping[str, Any],
        drifts: Sequence[Array] = (),
    ) -> None:
        """Write a frame; it is on disk and visible when this returns, and neither before.

        Parameters
        ----------
        frame, time
            Number and simulated time [s].
        relative : (P, 3)
            Displacements less their body's mean [m].
        means : (bodies, 3)
            These means [m].
        velocities : (P, 3) or None
            [m/s], where the recording keeps them.
        degenerate
            For each body (K, 2): rows without a frame of their own, and the last frame in which they had one.
        diagnostics
            JSON values.
        drifts
            For each body that moves by itself and not by a formula (N, V, 3) [m], how far it has, as
            `gasp_core.dynamics.composition.drifted` takes it.

        Raises
        ------
        RecordingError
            Where the disk refuses; the frames before are kept.
        """
        try:
            chunks: dict[str, FileCheck] = {}
            drifted = [drift.reshape(-1, 3) for drift in drifts]
            given = {"displacements": relative, "velocities": velocities}
            given["drifts"] = np.concatenate(drifted) if drifted else None
            for name, node in self._frames.items():
                values = given[name]
                assert values is not None and values.shape == node.shape[1:]
                content = encoded(values.astype(np.float32, copy=False))
                chunks[_chunk(name, frame)] = self._write_chunk(_chunk(name, frame), content)
            commit = Commit(
                frame=frame,
                time=time,
                chunks=chunks,
                body_displacements=tuple((float(x), float(y), float(z)) for x, y, z in means),
                degenerate=tuple(tuple((int(row), int(last)) for row, last in rows) for rows in degenerate),
                diagnostics=diagnostics,
            )
            self._write_commit(commit)
        except OSError as error:
            raise RecordingError(
                f"{self.path}: frame {frame} cannot be written: {error.strerror or error};"
                " the frames before it are kept, free some space and resume"
            ) from None

    def split(self, positions: Array) -> tuple[Array, Array]:
        """Means (bodies, 3) and relative displacements (P, 3) float32 of positions (P, 3) [m]."""
        return split_displacements(positions - self._start, self._bodies)

    def write_checkpoint(self, frame: int, state: Mapping[str, Array]) -> None:
        """Keep the engine's state at a frame; older ones but one are dropped.

        Raises
        ------
        RecordingError
            Where the disk refuses.
        """
        folder = self.path / "checkpoints" / f"{frame:08d}"
        try:
            shutil.rmtree(folder, ignore_errors=True)
            with folder_in_the_making(folder) as beside:
                for name, content in checkpoint_files(state).items():
                    (beside / name).write_bytes(content)
            for older in sorted(self._checkpoints())[:-_KEPT_CHECKPOINTS]:
                shutil.rmtree(self._checkpoints()[older], ignore_errors=True)
        except OSError as error:
            raise RecordingError(
                f"{self.path}: the checkpoint of frame {frame} cannot be written: {error.strerror or error}"
            ) from None

    def finish(self, state: str, reason: str) -> None:
        """Say how the run ended: "complete", or "incomplete" and why."""
        self._write_status(state, reason)

    def close(self) -> None:
        """Let go of the lock; may be called twice."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _write_status(self, state: str, reason: str) -> None:
        status = RecordedStatus(state=state, reason=reason, frames_wanted=self._frames_wanted, scene=self._scene)
        write_status(self.path, status)

    def _write_chunk(self, key: str, content: bytes) -> FileCheck:
        """Write the chunk of a frame and flush it; no commit knows it yet."""
        file = self.path / key
        with file.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        sync_folder(file.parent)
        return FileCheck(size=len(content), checksum=checksum(content))

    def _write_commit(self, commit: Commit) -> None:
        """Make a frame exist."""
        node = group(commit_attributes(commit, self.header))
        file = self.path / commit_key(commit.frame)
        file.parent.mkdir(parents=True, exist_ok=True)
        # Programs before version 6 know no seal, and may go on with what was begun by them.
        replace_file(file, sealed(node) if self.header.files else json.dumps(node, allow_nan=False).encode())
        sync_folder(self.path / "commits")

    def _checkpoints(self) -> dict[int, Path]:
        folder = self.path / "checkpoints"
        return {int(entry.name): entry for entry in folder.iterdir() if entry.is_dir() and entry.name.isdigit()}

    def _mend_groups(self) -> None:
        """Write again what says nothing but that there is a folder."""
        for key in Store(self.path, self.header).groups:
            if not (self.path / key).is_file() or (self.path / key).read_bytes() != sealed(group({})):
                write_attributes((self.path / key).parent, {})

    def _last_checkpoint(self, count: int) -> tuple[int, dict[str, Array]]:
        """The last checkpoint whose frame is finished, and its number; else frame 0, or -1, and nothing.

        Those that are damaged are removed. What cannot be read now is no damage, and ends all before that.
        """
        sealed = bool(self.header.files)
        last = -1
        damaged: list[Path] = []
        for frame, folder in sorted(self._checkpoints().items()):
            try:
                # Read again below: two of them may be more than there is room for.
                if load_checkpoint(self.path, frame, sealed=sealed) and frame < count:
                    last = frame
            except UnreadableError:
                raise
            except RecordingError:
                damaged.append(folder)
        for folder in damaged:
            shutil.rmtree(folder, ignore_errors=True)
        return (last, load_checkpoint(self.path, last, sealed=sealed)) if last >= 0 else (min(count, 1) - 1, {})

    def _take_back(self, first: int) -> None:
        """Remove frames from `first` on: commits first, last to first, so that no half frame is ever seen."""
        commits = self.path / "commits"
        numbered = [entry for entry in commits.iterdir() if entry.name.isdigit()]
        for entry in sorted(numbered, reverse=True):
            if int(entry.name) >= first:
                (entry / "zarr.json").unlink(missing_ok=True)
                shutil.rmtree(entry, ignore_errors=True)
        sync_folder(commits)
        for frame, folder in self._checkpoints().items():
            if frame >= first:
                shutil.rmtree(folder, ignore_errors=True)
        for name in self._frames:
            for entry in (self.path / "frames" / name).glob("c.*"):
                # A file that was being written has a longer name; it goes with its frame.
                number = entry.name.split(".")[1]
                if number.isascii() and number.isdigit() and int(number) >= first:
                    entry.unlink()


def _chunk(name: str, frame: int) -> str:
    """File of a frame's chunk, within the recording."""
    return f"frames/{name}/{chunk_key((frame, 0, 0))}"


def _arrays(
    reference: Gaussians, moving: Array, points: Array, carriers: Sequence[Mapping[str, Array]]
) -> dict[str, Array]:
    """All that is written once, by its path."""
    found = {f"reference/{field.name}": getattr(reference, field.name) for field in dataclasses.fields(reference)}
    found |= {"reference/moving": moving, "reference/points": points}
    for index, arrays in enumerate(carriers):
        found |= {f"bodies/{index}/{name}": values for name, values in arrays.items()}
    return found


def refuse_existing(path: Path, overwrite: bool) -> bool:
    """Whether a recording is to be replaced; refuses all else that is in the way."""
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        _refuse_unwritable(path)
        return False
    try:
        recording = path.is_dir() and read_node(path, "zarr.json")[0]["attributes"].get("format") == FORMAT
    except (OSError, RecordingError):
        recording = False
    if not recording:
        raise RecordingError(f"{path}: exists and is no recording: choose another name")
    if not overwrite:
        raise RecordingError(
            f"{path}: a recording is there already{_abandoned(path)}: resume it, choose another name, or overwrite it"
        )
    foreign = _foreign_entry(path)
    if foreign is not None:
        raise RecordingError(f"{foreign}: is not of the recording around it, which is not replaced: move it away")
    os.close(_locked(path))
    return True


def _refuse_unwritable(path: Path) -> None:
    """Refuse a place where no folder can be made, before anything is made for it."""
    above = next(place for place in (path, *path.absolute().parents) if place.exists())
    if above.is_file() or not os.access(above, os.W_OK | os.X_OK):
        why = "is a file, and no folder" if above.is_file() else "lets you write nothing into it: choose another place"
        raise RecordingError(f"{path}: cannot be written: {above} {why}")


def ended_without_a_word(recording: Recording) -> bool:
    """Whether whoever wrote it has ended before it was told how; not where its status is lost, which tells nothing."""
    try:
        return recording.reason == ENDED_WITHOUT_A_WORD
    except RecordingError:
        return False


def _abandoned(path: Path) -> str:
    """What to say of one of those where another is to be."""
    try:
        return f", and {ENDED_WITHOUT_A_WORD}" if ended_without_a_word(Recording.open(path)) else ""
    except RecordingError:
        return ""


def _foreign_entry(path: Path) -> Path | None:
    """Something in a recording that is none of its files, which whoever replaces it must not remove along."""
    for folder, _, files in os.walk(path):
        for name in files:
            if FILES.fullmatch(name) is None:
                return Path(folder) / name
    return None


def _locked(path: Path) -> int:
    descriptor = lock(path)
    if descriptor is None:
        raise RecordingError(f"{path}: another process is writing it: wait for it, or choose another name")
    return descriptor
