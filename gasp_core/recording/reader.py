"""`Recording`: reads what a run left behind, while it runs and afterwards."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RecordingError
from gasp_core.gaussians import Gaussians
from gasp_core.harmonics import turn_coefficients
from gasp_core.notebooks import ShownInNotebooks
from gasp_core.recording.addresses import local_copy
from gasp_core.recording.arrays import chunk_key
from gasp_core.recording.checks import check_carrier
from gasp_core.recording.commits import Commits, numbered, too_many_lost
from gasp_core.recording.drifting import driven_rows, formula_of, placement_of
from gasp_core.recording.files import UnreadableError, short
from gasp_core.recording.layout import Commit, EngineRecord, Header
from gasp_core.recording.lock import locked
from gasp_core.recording.map_record import recorded_maps
from gasp_core.recording.opening import read_header
from gasp_core.recording.status import ENDED_WITHOUT_A_WORD, RecordedStatus, read_status
from gasp_core.recording.store import Store
from gasp_core.reduction.all_vertices import block_of
from gasp_core.reduction.bodies import Body, carried_simplices, matter_turns, moved_gaussians, moved_simplices, shapes
from gasp_core.reduction.carriers import CARRIERS
from gasp_core.reduction.centres import Centres
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.render_input import RenderInput
from gasp_core.scene.loading import read_stored_scene
from gasp_core.scene.model import Scene
from gasp_core.scene.placement import Placement
from gasp_core.scene.settings import MapChoice

__all__ = ["Recording", "RecordingStatus"]

Array = NDArray[Any]
RecordingStatus = Literal["running", "complete", "incomplete"]


class Recording(ShownInNotebooks):
    """A run on disk. Opening reads its header only; frames are read when asked for.

    Use `Recording.open`.
    """

    def __init__(self, path: Path, header: Header) -> None:
        self.path = path
        self.header = header
        self._store = Store(path, header)
        self._commits = Commits(self._store)

    @classmethod
    def open(cls, path: str | Path) -> Recording:
        """Open a recording: a folder, or what is at an address, s3://bucket/run.gasp, as it is there now.

        Raises
        ------
        RecordingError
            Where there is none, it is damaged, or of a newer version.
        """
        path = local_copy(path)
        return cls(path, read_header(path))

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, {self.status}, {self.frame_count} frames)"

    @property
    def status(self) -> RecordingStatus:
        """ "running", "complete", or "incomplete": stopped, diverged, its process died, or frames of it are lost."""
        state = self._state().state
        if (state == "running" and not locked(self.path)) or self.lost:
            return "incomplete"
        return cast(RecordingStatus, state)

    @property
    def reason(self) -> str:
        """Why it is incomplete; empty otherwise."""
        state = self._state()
        if self.lost:
            return f"damaged: {numbered(self.lost)} lost; gasp verify says more"
        if state.state == "running" and not locked(self.path):
            return ENDED_WITHOUT_A_WORD
        return state.reason

    @property
    def frames_wanted(self) -> int:
        """Number of frames once it is complete."""
        return self._state().frames_wanted

    def _state(self) -> RecordedStatus:
        return read_status(self.path, seal=bool(self.header.files))

    @property
    def frame_count(self) -> int:
        """Number of finished frames, those that are lost included; grows while the run goes on."""
        return self._commits.look().count

    @property
    def lost(self) -> tuple[int, ...]:
        """Frames that were finished and whose commit is missing: holes, and the end of a run that was complete.

        Of those that are there, `gasp_core.recording.verifying.verify` looks at every file.
        """
        found = self._commits.look()
        try:
            state = self._state()
        except RecordingError:
            return found.lost
        end = state.frames_wanted if state.state == "complete" else found.count
        if too_many_lost(end - found.count + len(found.lost), found.count - len(found.lost)):
            raise RecordingError(f"{self.path}: is damaged: {end:,} frames were finished, {found.count:,} are there")
        return (*found.lost, *range(found.count, end))

    @property
    def torn(self) -> tuple[int, ...]:
        """Frames at the end whose commits are damaged: they were being written, and count as never written."""
        return self._commits.look().torn

    @property
    def times(self) -> Array:
        """Simulated times [s] of the finished frames, (frame_count,)."""
        return np.arange(self.frame_count) / self.header.frame_rate

    @property
    def scene(self) -> Scene:
        """The scene it was made from, and last gone on with; splats built in memory are ``memory:`` and a digest."""
        return self._stored_scene[0]

    @property
    def forgotten(self) -> tuple[str, ...]:
        """Keys of the scene it was made from that this GASP does not know any more, and so not in `scene`."""
        return self._stored_scene[1]

    @cached_property
    def _stored_scene(self) -> tuple[Scene, tuple[str, ...]]:
        # The folder that it lies in, and not one with a link to it.
        beside = self.path.resolve().parent
        try:
            text = self._state().scene or self.header.scene
        except RecordingError:
            # Its frames can be read all the same, and so can what it was begun with.
            text = self.header.scene
        return read_stored_scene(text, file=f"{self.path} (scene)", beside=beside)

    @cached_property
    def _maps(self) -> MapChoice:
        """What of the scene's maps it takes to read a frame."""
        return recorded_maps(self.header.maps)

    @property
    def engine(self) -> EngineRecord:
        """The engine that made it."""
        return self.header.engine

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user: what was set aside, and the like."""
        return self.header.notes

    @cached_property
    def reference(self) -> Gaussians:
        """The whole drawn scene at rest: metres, +z up, objects in the order of the scene."""
        return self._store.reference()

    def placement(self, name: str) -> Placement:
        """How an object's file was put into the world.

        Raises
        ------
        RecordingError
            Where there is no such object, or the recording is too old to know.
        """
        for item in self.header.objects:
            if item.name == name:
                return placement_of(self._store, item)
        names = ", ".join(item.name for item in self.header.objects)
        raise RecordingError(f'{self.path}: has no object "{name}", its objects are {names}')

    @cached_property
    def moving(self) -> Array:
        """Mask (N,) of the Gaussians that are simulated."""
        moving = self._store.array("reference/moving", (self._store.rows,), "b")
        for item in (self.header.objects[body.item] for body in self.header.bodies):
            if not moving[item.first : item.last].any():
                raise RecordingError(f'{self.path}: reference/moving is damaged: nothing of "{item.name}" moves')
        return moving

    @cached_property
    def start_points(self) -> Array:
        """The engine's points at the start, (P, 3) float64 [m]."""
        return self._store.array("reference/points", (self._store.points, 3), "f")

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """What is simulated, object by object."""
        found: list[Body] = []
        for index, entry in enumerate(self.header.bodies):
            item = self.header.objects[entry.item]
            rows = item.first + np.flatnonzero(self.moving[item.first : item.last])
            vertices: Literal[3, 4] = 4 if entry.vertices == 4 else 3
            block = block_of(self.reference.select(rows), vertices)
            driven = driven_rows(self._store, index, entry, len(rows))
            found.append(
                Body(
                    name=item.name,
                    rows=rows,
                    points=slice(entry.first, entry.last),
                    block=block,
                    carrier=self._carrier(index, len(rows), driven=driven is not None),
                    drift=formula_of(self._store, index, entry, item, block, driven) if entry.drifts else None,
                    driven=driven,
                    strained=entry.drifts and entry.carrier == Centres.kind,
                )
            )
        return tuple(found)

    def _carrier(self, index: int, count: int, *, driven: bool) -> TransferOperator:
        entry = self.header.bodies[index]
        if entry.carrier not in CARRIERS:
            raise RecordingError(
                f'{self.path}: carries body {index} by "{entry.carrier}", this GASP knows no such: update GASP'
            )
        arrays = self._store.carrier(index, max(count, entry.last - entry.first))
        for own in ("unmoved", "driven"):
            arrays.pop(own, None)
        try:
            check_carrier(arrays, entry, count, driven=driven)
            return CARRIERS[entry.carrier].of(arrays)
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"{self.path}: bodies/{index} is damaged ({short(error)})") from None

    def commit(self, frame: int) -> Commit:
        """The commit of a frame.

        Raises
        ------
        RecordingError
            Where there is no such frame, or its commit is missing or damaged.
        """
        if isinstance(frame, str) or int(frame) != frame:  # pyright: ignore[reportUnnecessaryIsInstance]
            raise RecordingError(f"{self.path}: a frame is a whole number, found {frame!r}")
        count, frame = self.frame_count, int(frame)
        if not 0 <= frame < count and frame not in (*self.lost, *self.torn):
            raise RecordingError(f"{self.path}: has no frame {frame}, its frames are 0 to {count - 1}")
        return self._commits.read(frame)

    def diagnostics(self, frame: int | None = None) -> Any:
        """What is known of the step that led to a frame, a dict; a list of them for all frames where none is named.

        `substeps`, `smallest_substep`, `largest_substep` [s]; `kinetic_energy`, `potential_energy` (of gravity,
        against the start) [J]; counts of `degenerate` and `clipped` simplices, `inverted` and `stretched` points
        (None where the engine shows none); `warnings`.
        """
        if frame is None:
            return [self.diagnostics(index) for index in range(self.frame_count)]
        return {"time": self.commit(frame).time, **self.commit(frame).diagnostics}

    def displacements(self, frame: int) -> tuple[Array, Array]:
        """Of the points from the start, less their body's mean, (P, 3) float32; and these means, (bodies, 3) [m]."""
        commit = self.commit(frame)
        return self._frame_array("displacements", commit), np.array(commit.body_displacements, dtype=np.float64)

    def points(self, frame: int) -> Array:
        """The engine's points, edges magnified, (P, 3) float64 [m]."""
        relative, means = self.displacements(frame)
        points = self.start_points + relative
        for body, mean in zip(self.header.bodies, means):
            points[body.first : body.last] += mean
        return points

    @property
    def has_velocities(self) -> bool:
        """Whether the points' velocities were recorded."""
        return "velocities" in self._store.frame_names()

    def velocities(self, frame: int) -> Array:
        """Velocities of the points, (P, 3) float32 [m/s].

        Raises
        ------
        RecordingError
            Where they were not recorded.
        """
        if not self.has_velocities:
            raise RecordingError(
                f"{self.path}: velocities were not recorded: say velocities = true under [recording], and run it anew"
            )
        return self._frame_array("velocities", self.commit(frame))

    def simplices(self, frame: int) -> dict[str, Array]:
        """Simplices of the moving Gaussians by object, (N, V, 3) float64 [m], edges not magnified."""
        relative, means = self.displacements(frame)
        drifts = self._drifts(self.commit(frame))
        return {
            body.name: moved_simplices(body, relative[body.points], drift, mean) + (body.block.centre + mean)
            for body, mean, drift in zip(self.bodies, means, drifts)
        }

    def bounded_simplices(self, frame: int) -> dict[str, Array]:
        """The same as they are drawn: the control rule has bounded what physics stretches, and not what psi does."""
        relative, means = self.displacements(frame)
        found: dict[str, Array] = {}
        for body, mean, drift in zip(self.bodies, means, self._drifts(self.commit(frame))):
            moved = moved_gaussians(body, relative[body.points], self._maps, drift=drift, shift=mean)
            found[body.name] = moved.simplices + (body.block.centre + mean)
        return found

    def gaussians(self, frame: int) -> Gaussians:
        """The whole scene at a frame: every drawn Gaussian, static ones too, in the order of the files.

        Means, quaternions and scales are float64; harmonics are turned with the matter.
        """
        moved, turns = self._moved(frame)
        return moved if turns is None else moved.with_(harmonics=turn_coefficients(moved.harmonics, turns))

    def splats(self, frame: int) -> RenderInput:
        """The same for drawing: harmonics as at rest, and the turns of the matter beside them."""
        moved, turns = self._moved(frame)
        return dataclasses.replace(RenderInput.of(moved), turns=turns)

    def _moved(self, frame: int) -> tuple[Gaussians, Array | None]:
        """The whole scene at a frame, harmonics not turned, and the turns; None where colour is the same all round."""
        commit = self.commit(frame)
        relative = self._frame_array("displacements", commit)
        reference, maps = self.reference, self._maps
        means = reference.means.astype(np.float64)
        quaternions = reference.quaternions.astype(np.float64)
        scales = reference.scales.astype(np.float64)
        turns = np.tile(np.eye(3), (len(reference), 1, 1)) if reference.sh_degree > 0 else None
        drifts = self._drifts(commit)
        for index, (body, shift, drift) in enumerate(zip(self.bodies, commit.body_displacements, drifts)):
            previous = self._previous(index, commit)
            moved = moved_gaussians(
                body, relative[body.points], maps, previous=previous, drift=drift, shift=np.asarray(shift)
            )
            means[body.rows] = moved.gaussians.means + (body.block.centre + np.asarray(shift))
            quaternions[body.rows] = moved.gaussians.quaternions
            scales[body.rows] = moved.gaussians.scales
            if turns is not None:
                turns[body.rows] = matter_turns(body, moved)
        return reference.with_(means=means, quaternions=quaternions, scales=scales), turns

    def _previous(self, index: int, commit: Commit) -> Gaussians | None:
        """The body's Gaussians with the last valid frames of those that have none in this one; None if all have."""
        lost = np.array(commit.degenerate[index], dtype=np.int64).reshape(-1, 2)
        if len(lost) == 0:
            return None
        body = self.bodies[index]
        local = body.block.local
        quaternions, scales = local.quaternions.astype(np.float64), local.scales.astype(np.float64)
        for last in np.unique(lost[:, 1]):
            rows = lost[lost[:, 1] == last, 0]
            relative, _ = self.displacements(int(last))
            drift = self._drifts(self.commit(int(last)))[index]
            moved, before = carried_simplices(body, relative[body.points], drift)
            before = None if before is None else before[rows]
            valid = shapes(moved[rows], local.select(rows), self._maps, before=before).gaussians
            quaternions[rows] = valid.quaternions
            scales[rows] = valid.scales
        return local.with_(quaternions=quaternions, scales=scales)

    def _drifts(self, commit: Commit) -> list[Array | None]:
        """For each body how far it has moved by itself, `Body.drifting` [m], see `drifted`; None: it does not."""
        kept: Array | None = None
        first = 0
        drifts: list[Array | None] = []
        for body, entry in zip(self.bodies, self.header.bodies):
            if not entry.drifts:
                drifts.append(None)
            elif body.drift is not None:
                drifts.append(body.drift.at(commit.time))
            else:
                kept = self._frame_array("drifts", commit) if kept is None else kept
                last = first + body.drifting[0] * body.drifting[1]
                if last > len(kept):
                    raise RecordingError(f"{self.path}: frames/drifts is damaged: it has too few rows")
                drifts.append(kept[first:last].reshape(body.drifting))
                first = last
        return drifts

    def _frame_array(self, name: str, commit: Commit) -> Array:
        key = f"frames/{name}/{chunk_key((commit.frame, 0, 0))}"
        if key not in commit.chunks:
            raise RecordingError(f"{self.path}: {name} of frame {commit.frame} is damaged: its commit does not know it")
        rows = None if name == "drifts" else self._store.points
        try:
            return self._store.frame(name, commit.frame, commit.chunks[key], rows)
        except UnreadableError:
            raise
        except RecordingError as error:
            told = str(error).removeprefix(f"{self.path}: ").replace(" is damaged", "", 1)
            raise RecordingError(f"{self.path}: {name} of frame {commit.frame} is damaged: {told}") from None
