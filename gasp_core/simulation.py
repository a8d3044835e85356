"""The one driver loop: a scene in, a recording out, whatever the engine."""

from __future__ import annotations

import atexit
import dataclasses
import hashlib
import importlib.metadata
import math
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.dynamics.callables import function_digest
from gasp_core.dynamics.composition import Played, play
from gasp_core.dynamics.sequence import frame_files
from gasp_core.engine.capabilities import check_supported
from gasp_core.engine.contract import (
    EngineDescriptor,
    EngineSession,
    Field,
    PointEngine,
    PointState,
    Precision,
    Status,
    StepReport,
)
from gasp_core.engine.detector import FASTER_THAN_SOUND, Watch, inspect, outrun_sound, watch_over
from gasp_core.engine.opening import open_engine, open_worker
from gasp_core.engine.options import build_options, chosen_options
from gasp_core.engine.registry import discover
from gasp_core.engine.starts import starts_inside
from gasp_core.engine.worker.session import Limits
from gasp_core.errors import EngineCrashedError, EngineDivergedError, GaspError, SceneError
from gasp_core.games import FLATNESS, flatten
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat
from gasp_core.progress import Progress, progress_for
from gasp_core.recording import Recording
from gasp_core.recording.continuing import refuse_other
from gasp_core.recording.layout import BodyEntry, EngineRecord, Header, ObjectEntry
from gasp_core.recording.writer import RecordingWriter, refuse_existing
from gasp_core.reduction.assembly import Assembly, Body, assemble
from gasp_core.reduction.shape_flags import shape_flags
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.model import EngineChoice, MapChoice, RecordingChoice, Scene, SplatObject, engine_notes
from gasp_core.scene.motions import FrameSequence, PythonMotion
from gasp_core.scene.selection import PlacedObject, place_object
from gasp_core.scene.writing import gaussians_digest, motion_table, scene_to_toml

__all__ = ["Prepared", "prepare", "simulate"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Engine:
    """The engine of a run and how it is set."""

    descriptor: EngineDescriptor
    engine: PointEngine | None
    version: str

    def opened(self, choice: EngineChoice) -> PointEngine:
        """The engine itself; its own code is imported, or its process started, here and not before."""
        if self.engine is not None:
            return self.engine
        if not self.isolated(choice):
            return open_engine(discover().offer(self.descriptor.name))
        limits = Limits() if choice.frame_limit is None else Limits(frame=choice.frame_limit)
        return open_worker(discover().offer(self.descriptor.name), limits)

    def isolated(self, choice: EngineChoice) -> bool:
        """Whether it runs in a process of its own."""
        return choice.isolate or self.descriptor.environment is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A scene whose splats are read and placed.

    Parameters
    ----------
    objects
        In the order of the scene.
    digests
        SHA-256 of each object's source.
    assembly
        What the engine is given.
    """

    objects: tuple[PlacedObject, ...]
    digests: tuple[str, ...]
    assembly: Assembly


def prepare(scene: Scene) -> Prepared:
    """Read, select and place the splats of a scene and make the engine's points of them.

    Raises
    ------
    SceneError, SplatFormatError
        Where a splat cannot be read, or nothing of it is left.
    """
    objects: list[PlacedObject] = []
    digests: list[str] = []
    motions: dict[str, Played] = {}
    for item in scene.objects:
        gaussians, digest = _source(item)
        if item.motion is None:
            objects.append(place_object(item, gaussians))
        else:
            placed, motions[item.name] = play(item, gaussians, scene.maps)
            objects.append(placed)
        digests.append(digest)
    degrees = {placed.gaussians.sh_degree for placed in objects}
    if len(degrees) > 1:
        objects = [_raised(placed, max(degrees)) for placed in objects]
    return Prepared(objects=tuple(objects), digests=tuple(digests), assembly=assemble(scene, objects, motions))


def simulate(
    scene: Scene,
    engine: str | tuple[EngineDescriptor, PointEngine] | None = None,
    out: str | Path | None = None,
    *,
    device: str | None = None,
    precision: Precision | None = None,
    resume: bool = False,
    frames: int | None = None,
    overwrite: bool = False,
    isolate: bool | None = None,
    progress: bool | None = None,
    recorded: Callable[[int], None] | None = None,
) -> Recording:
    """Run a scene and record it.

    Parameters
    ----------
    scene
        What happens.
    engine
        Name of an engine instead of the scene's, or one that is not installed, with its descriptor.
    out
        Folder of the recording. None: a temporary one, gone when the process ends.
    device, precision
        Instead of the scene's; without them another engine keeps what the scene says where it can, see
        `Scene.with_engine`.
    resume
        Go on with the recording at `out` from its last checkpoint; begin where there is none. The result is that of
        a run that never stopped, bit for bit with an engine that is deterministic. The scene may last longer than
        before.
    frames
        Stop once there are so many frames, the one at time 0 included; `resume` goes on from there.
    overwrite
        Replace a recording that is at `out`.
    isolate
        Run the engine in a process of its own; None: as the scene says.
    progress
        Show a progress bar and notes on stderr; None: where that is a terminal.
    recorded
        Called with the number of each new frame once it is on disk.

    Returns
    -------
    Recording
        "complete", or "incomplete" where Ctrl-C or `frames` stopped it.

    Raises
    ------
    GaspError
        Before anything is opened: SceneError, SplatFormatError, UnknownEngineError, UnsupportedSceneError,
        RecordingError where something is at `out` already. While it runs: EngineDivergedError where the state is no
        longer credible, EngineCrashedError where the process of an isolated engine dies; the frames up to the last good
        one are kept.
    """
    if frames is not None and frames < 1:
        raise SceneError(f"frames must be at least 1, found {frames!r}")
    asked = scene
    scene, chosen = _chosen(scene, engine, isolate, device, precision)
    options = build_options(chosen.descriptor, scene.engine.options)
    prepared = prepare(scene)
    wanted = scene.frame_count
    names = [body.name for body in prepared.assembly.bodies]
    check_supported(
        prepared.assembly.problem,
        chosen.descriptor,
        device=scene.engine.device,
        precision=scene.engine.precision,
        fields=frozenset({Field.VELOCITIES}) if scene.recording.velocities else frozenset(),
        body_names=names,
        others=discover().engines.values(),
    )
    header = _header(scene, prepared, chosen, options, engine_notes(asked, scene, chosen.descriptor))
    path = _temporary() if out is None else Path(out)
    with progress_for(progress, wanted) as shown:
        for note in header.notes:
            shown.say(note)
        end = wanted if frames is None else min(frames, wanted)
        if resume and (path / "zarr.json").exists():
            found = Recording.open(path)
            refuse_other(found, header, chosen.descriptor, options)
            writer, last, restart = RecordingWriter.resume(found, wanted)
            opening = partial(_opened, scene, prepared.assembly, chosen, options, restart)
            begun: AbstractContextManager[EngineSession | None] = nullcontext()
        else:
            refuse_existing(path, overwrite)
            # Opened before anything is written: what the engine refuses leaves nothing behind.
            opening = partial(_opened, scene, prepared.assembly, chosen, options, {})
            begun = opening() if end > 1 else nullcontext()
            writer, last = None, -1
        with begun as session:
            writer = writer or _created(path, scene, prepared, header, overwrite)
            try:
                run = _Run(scene, prepared.assembly, chosen, writer, shown, recorded or (lambda frame: None))
                run.go(last, (lambda: session) if session is not None else opening, end)
            finally:
                writer.close()
    return Recording.open(path)


class _Run:
    """One run: the loop over frames, and all the ways in which it may end."""

    def __init__(
        self,
        scene: Scene,
        assembly: Assembly,
        chosen: _Engine,
        writer: RecordingWriter,
        shown: Progress,
        recorded: Callable[[int], None],
    ) -> None:
        self._scene = scene
        self._assembly = assembly
        self._chosen = chosen
        self._writer = writer
        self._shown = shown
        self._recorded = recorded
        self._fields = frozenset(
            {Field.POSITIONS}
            | (chosen.descriptor.capabilities.output_fields & {Field.VELOCITIES, Field.DEFORMATION_GRADIENTS})
        )
        self._watch: Watch = watch_over(assembly.problem, 1 / scene.frame_rate)
        self._last_valid = [np.zeros(len(body.rows), dtype=np.int64) for body in assembly.bodies]
        self._told_of_sound = False
        self._checkpoint_time = time.monotonic()
        self._checkpoint_frame = -1

    def go(self, last: int, opening: Callable[[], EngineSession], end: int) -> None:
        """Frames last + 1 .. end - 1; the ending is in the recording's status, or raised as well.

        Parameters
        ----------
        last
            The last frame that is there already; -1 where there is none.
        opening
            Gives the engine's session at that frame; not called where nothing is left to do.
        end
            One beyond the last frame asked for.
        """
        try:
            if last < 0:
                self._write_start()
                self._recorded(0)
                last = 0
            else:
                self._recall(last)
            self._checkpoint_frame = last or -1
            stopped = self._advance(last, opening, end) if last + 1 < end else ""
        except EngineCrashedError as error:
            kept = EngineCrashedError(f"{error}; the frames so far are kept in {self._writer.path}", self._writer.path)
            self._end("incomplete", str(kept))
            raise kept from error
        except GaspError as error:
            self._end("incomplete", str(error))
            raise
        except BaseException as error:
            reason = " ".join(str(error).split())
            self._end("incomplete", f"stopped by {type(error).__name__}{': ' if reason else ''}{reason}")
            raise
        if stopped:
            self._end("incomplete", stopped)
            self._shown.say(stopped)
        elif end < self._scene.frame_count:
            self._end("incomplete", f"stopped after {max(end, last + 1)} of {self._scene.frame_count} frames, as asked")
        else:
            self._end("complete", "")

    def _advance(self, last: int, opening: Callable[[], EngineSession], end: int) -> str:
        """Run the engine; why it stopped early, or nothing."""
        scene = self._scene
        with opening() as session, _interrupt() as interrupted:
            before = session.read(self._fields)
            for frame in range(last + 1, end):
                report = session.advance_to(scene.time_of(frame))
                before = self._record(frame, session, report, before)
                self._shown.advance(frame, report.smallest_substep)
                self._recorded(frame)
                if interrupted.is_set() and frame + 1 < end:
                    self._keep(frame, session, always=True)
                    return (
                        f"stopped by Ctrl-C after frame {frame} of {scene.frame_count - 1};"
                        " gasp run --resume goes on from there, with the same scene and settings"
                    )
                self._keep(frame, session, always=frame + 1 == end)
        return ""

    def _record(self, frame: int, session: EngineSession, report: StepReport, before: PointState) -> PointState:
        """Judge and write the frame the session has come to."""
        if report.status is not Status.OK:
            raise self._diverged(frame, report, "; ".join(report.warnings) or "the engine gave no reason")
        state = session.read(self._fields)
        verdict = inspect(self._watch, before, state)
        if verdict.status is not Status.OK:
            raise self._diverged(frame, dataclasses.replace(report, status=verdict.status), verdict.reason)
        warnings = [*report.warnings, *self._outran(before, state)]
        means, relative = self._writer.split(state.positions)
        drifts = self._drifts(frame)
        degenerate, clipped = self._shapes(frame, relative, drifts)
        self._writer.write_frame(
            frame,
            self._scene.time_of(frame),
            relative=relative,
            means=means,
            drifts=self._untold(drifts),
            velocities=state.velocities if self._writer.keeps_velocities else None,
            degenerate=degenerate,
            diagnostics={
                "substeps": int(report.substep_count),
                "smallest_substep": float(report.smallest_substep),
                "largest_substep": float(report.largest_substep),
                "kinetic_energy": verdict.kinetic_energy,
                "potential_energy": None if verdict.released_potential is None else -verdict.released_potential,
                "degenerate": sum(len(rows) for rows in degenerate),
                "clipped": clipped,
                "inverted": verdict.inverted,
                "stretched": verdict.stretched,
                "warnings": warnings,
            },
        )
        for warning in warnings:
            self._shown.warn(f"frame {frame}: {warning}")
        return state

    def _outran(self, before: PointState, state: PointState) -> list[str]:
        """What there is to say of matter that outruns its own sound, once a run."""
        if self._told_of_sound:
            return []
        sentence = outrun_sound(self._watch, before, state, [body.name for body in self._assembly.bodies])
        self._told_of_sound = bool(sentence)
        return [sentence] if sentence else []

    def _write_start(self) -> None:
        """Frame 0: displacement zero, without asking the engine, so that it is the file's own."""
        points = self._assembly.problem.points
        relative = np.zeros((len(points), 3), dtype=np.float32)
        drifts = self._drifts(0)
        degenerate, clipped = self._shapes(0, relative, drifts)
        self._writer.write_frame(
            0,
            0.0,
            relative=relative,
            means=np.zeros((len(self._assembly.bodies), 3)),
            drifts=self._untold(drifts),
            velocities=points.initial_velocities if self._writer.keeps_velocities else None,
            degenerate=degenerate,
            diagnostics={
                "substeps": 0,
                "smallest_substep": 0.0,
                "largest_substep": 0.0,
                "kinetic_energy": self._watch.kinetic_energy,
                "potential_energy": 0.0,
                "degenerate": sum(len(rows) for rows in degenerate),
                "clipped": clipped,
                "inverted": 0,
                "stretched": 0,
                "warnings": [],
            },
        )

    def _drifts(self, frame: int) -> list[Array | None]:
        """How far each body has moved by itself; None for those that do not."""
        time = self._scene.time_of(frame)
        return [None if body.drift is None else body.drift.at(time) for body in self._assembly.bodies]

    def _untold(self, drifts: Sequence[Array | None]) -> list[Array]:
        return [
            drift for body, drift in zip(self._assembly.bodies, drifts) if drift is not None and _drifts_untold(body)
        ]

    def _shapes(self, frame: int, relative: Array, drifts: Sequence[Array | None]) -> tuple[list[Array], int]:
        """For each body, simplices without a frame and the last in which they had one; the number of clipped ones."""
        maps: MapChoice = self._scene.maps
        degenerate: list[Array] = []
        clipped = 0
        for body, valid, drift in zip(self._assembly.bodies, self._last_valid, drifts):
            frameless, bounded = shape_flags(body, relative[body.points], maps, drift)
            lost = np.flatnonzero(frameless)
            valid[~frameless] = frame
            degenerate.append(np.stack([lost, valid[lost]], axis=1))
            clipped += int(bounded.sum())
        return degenerate, clipped

    def _recall(self, frame: int) -> None:
        """The memory of `_shapes` and `_outran` as it was after a frame."""
        recording = Recording.open(self._writer.path)
        for valid, rows in zip(self._last_valid, recording.commit(frame).degenerate):
            valid[:] = frame
            for row, last in rows:
                valid[row] = last
        earlier = (recording.diagnostics(number)["warnings"] for number in range(frame + 1))
        self._told_of_sound = any(FASTER_THAN_SOUND in warning for warnings in earlier for warning in warnings)

    def _keep(self, frame: int, session: EngineSession, *, always: bool) -> None:
        """Write a checkpoint where one is due."""
        if not self._chosen.descriptor.capabilities.checkpoints:
            return
        choice: RecordingChoice = self._scene.recording
        due = time.monotonic() - self._checkpoint_time >= choice.checkpoint_seconds
        if choice.checkpoint_frames is not None:
            due |= frame - max(self._checkpoint_frame, 0) >= choice.checkpoint_frames
        if due or always:
            self._writer.write_checkpoint(frame, session.checkpoint())
            self._checkpoint_time = time.monotonic()
            self._checkpoint_frame = frame

    def _diverged(self, frame: int, report: StepReport, reason: str) -> EngineDivergedError:
        accuracy = self._scene.accuracy
        if report.status is Status.SUBSTEP_LIMIT or report.status is Status.OUT_OF_DOMAIN:
            advice = ""  # the engine's own reason says what to do
        elif accuracy.substep is not None:
            advice = f"; try substep = {accuracy.substep / 2:.3g} under [accuracy]"
        else:
            step = f" (a substep of {report.smallest_substep / 2:.3g} s)" if report.smallest_substep > 0 else ""
            advice = f"; try substep_fraction = {accuracy.substep_fraction / 2:.3g} under [accuracy]{step}"
        name = self._chosen.descriptor.name
        return EngineDivergedError(
            f"{name} stopped at frame {frame} ({report.status.value}): {reason}{advice};"
            f" frames 0 to {frame - 1} are kept in {self._writer.path}",
            report,
            self._writer.path,
        )

    def _end(self, state: str, reason: str) -> None:
        # The disk may be what failed: the first error is the one to tell.
        try:
            self._writer.finish(state, reason)
        except OSError:
            if state == "complete":
                raise


@contextmanager
def _interrupt() -> Generator[threading.Event]:
    """An event that Ctrl-C sets; a second Ctrl-C interrupts at once."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    before = signal.getsignal(signal.SIGINT)

    def stop(number: int, frame: FrameType | None) -> None:
        event.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    signal.signal(signal.SIGINT, stop)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


def _chosen(
    scene: Scene,
    engine: str | tuple[EngineDescriptor, PointEngine] | None,
    isolate: bool | None,
    device: str | None,
    precision: Precision | None,
) -> tuple[Scene, _Engine]:
    """The engine asked for, and the scene as it runs it."""
    if isolate is not None:
        scene = dataclasses.replace(scene, engine=dataclasses.replace(scene.engine, isolate=isolate))
    if isinstance(engine, tuple):
        descriptor, opened = engine
        chosen = _Engine(descriptor=descriptor, engine=opened, version="")
    else:
        offer = discover().offer(engine or scene.engine.name)
        chosen = _Engine(descriptor=offer.descriptor, engine=None, version=_version(offer.distribution))
    scene = scene.with_engine(chosen.descriptor, device=device, precision=precision)
    name = chosen.descriptor.name
    if chosen.engine is not None and scene.engine.isolate:
        raise SceneError(f'engine "{name}" was handed over as it is and cannot be isolated: install it and name it')
    if scene.engine.frame_limit is not None and not chosen.isolated(scene.engine):
        raise SceneError("frame_limit under [engine] needs isolate = true: only a process of its own can be given up")
    return scene, chosen


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _source(item: SplatObject) -> tuple[Gaussians, str]:
    """The Gaussians of an object, of frames those of the first, and the digest of where they and psi come from."""
    if isinstance(item.motion, PythonMotion):
        gaussians, own = _source(dataclasses.replace(item, motion=None))
        return gaussians, hashlib.sha256(f"{own} {function_digest(item.motion.function)}".encode()).hexdigest()
    if isinstance(item.splat, Gaussians):
        return item.splat, gaussians_digest(item.splat)
    first = frame_files(item.splat)[0] if isinstance(item.motion, FrameSequence) else item.splat
    gaussians = read_splat(first)
    digest = hashlib.sha256()
    files = sorted(item.splat.rglob("*")) if item.splat.is_dir() else [item.splat]
    for file in files:
        if file.is_file():
            digest.update(file.name.encode())
            with file.open("rb") as stream:
                while block := stream.read(2**20):
                    digest.update(block)
    return gaussians, digest.hexdigest()


def _raised(placed: PlacedObject, degree: int) -> PlacedObject:
    """An object whose harmonics are filled up with zeros to a degree, so that all objects share one array."""
    harmonics = placed.gaussians.harmonics
    missing = (degree + 1) ** 2 - harmonics.shape[1]
    zeros = np.zeros((len(harmonics), missing, 3), dtype=harmonics.dtype)
    raised = placed.gaussians.with_(harmonics=np.concatenate([harmonics, zeros], axis=1))
    return dataclasses.replace(placed, gaussians=raised)


def _drawn(objects: Sequence[PlacedObject]) -> Gaussians:
    parts = [placed.gaussians for placed in objects]
    names = [field.name for field in dataclasses.fields(Gaussians)]
    return Gaussians(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _flattening(body: Body) -> str:
    """What triangles leave out of Gaussians that are not flat; nothing where they leave out nothing one could see."""
    if body.block.vertices == 4:
        return ""
    lost = flatten(body.block.local).lost_share
    thick = lost > FLATNESS**2
    if not thick.any():
        return ""
    return (
        f'object "{body.name}": {int(thick.sum())} of {len(thick)} Gaussians are not flat; a triangle does not carry'
        f" their thinnest axis ({100 * float(np.median(lost[thick])):.1f} % of the variance in the median):"
        " it keeps its length and stands on the triangle (vertices = 4: it moves too)"
    )


def _header(scene: Scene, prepared: Prepared, chosen: _Engine, options: Any, notes_on_engine: Sequence[str]) -> Header:
    assembly = prepared.assembly
    ends = np.cumsum([0, *(len(placed.gaussians) for placed in prepared.objects)])
    rows = {placed.item.name: index for index, placed in enumerate(prepared.objects)}
    capabilities = chosen.descriptor.capabilities
    notes = [*notes_on_engine]
    for placed in prepared.objects:
        notes += placed.set_aside.sentences(placed.item.name)
    notes += [note for body in assembly.bodies if (note := _flattening(body))]
    notes += [f'object "{body.name}": {note}' for body in assembly.bodies for note in body.notes]
    inside = starts_inside(assembly.problem, assembly.spacing)
    notes += [f'object "{assembly.bodies[number].name}": {note}' for number, note in inside]
    return Header(
        gasp_version=_version("gasp-core"),
        scene=scene_to_toml(scene),
        scene_digest=scene_digest(scene, prepared.digests),
        points_digest=hashlib.sha256(assembly.problem.points.reference_positions.tobytes()).hexdigest(),
        frame_rate=scene.frame_rate,
        spacing=assembly.spacing,
        maps={
            "covariance": scene.maps.covariance,
            "alpha": scene.maps.alpha if math.isfinite(scene.maps.alpha) else None,
        },
        objects=tuple(
            ObjectEntry(
                name=placed.item.name,
                first=int(ends[index]),
                last=int(ends[index + 1]),
                splat_digest=digest,
                set_aside=dataclasses.asdict(placed.set_aside),
                placement={
                    "rotation": placed.placement.rotation.tolist(),
                    "scale": placed.placement.scale,
                    "translation": placed.placement.translation.tolist(),
                },
            )
            for index, (placed, digest) in enumerate(zip(prepared.objects, prepared.digests))
        ),
        bodies=tuple(
            BodyEntry(
                item=rows[body.name],
                vertices=body.block.vertices,
                first=body.points.start,
                last=body.points.stop,
                carrier=body.carrier.kind,
                drifts=body.drift is not None,
                motion=_formula(body),
            )
            for body in assembly.bodies
        ),
        notes=tuple(notes),
        engine=EngineRecord(
            name=chosen.descriptor.name,
            version=chosen.version,
            device=scene.engine.device or capabilities.devices[0],
            precision=(scene.engine.precision or capabilities.precisions[0]).value,
            seed=scene.engine.seed,
            options=chosen_options(options),
            checkpoints=capabilities.checkpoints,
        ),
    )


def _opened(
    scene: Scene, assembly: Assembly, chosen: _Engine, options: Any, restart: dict[str, Array]
) -> EngineSession:
    """The engine at the start, or where a checkpoint left it."""
    capabilities = chosen.descriptor.capabilities
    return chosen.opened(scene.engine).open(
        assembly.problem,
        device=scene.engine.device or capabilities.devices[0],
        precision=scene.engine.precision or capabilities.precisions[0],
        seed=scene.engine.seed,
        accuracy=dataclasses.replace(scene.accuracy, spacing=assembly.spacing),
        options=options,
        restart=restart or None,
    )


def _created(path: Path, scene: Scene, prepared: Prepared, header: Header, overwrite: bool) -> RecordingWriter:
    return RecordingWriter.create(
        path,
        header,
        reference=_drawn(prepared.objects),
        moving=np.concatenate([placed.moving for placed in prepared.objects]),
        points=prepared.assembly.problem.points.reference_positions,
        carriers=[_kept(body) for body in prepared.assembly.bodies],
        drifting=sum(body.block.rest.size // 3 for body in prepared.assembly.bodies if _drifts_untold(body)),
        frames_wanted=scene.frame_count,
        velocities=scene.recording.velocities,
        overwrite=overwrite,
    )


def _kept(body: Body) -> dict[str, Array]:
    """What a recording keeps of a body: how its points carry it, and what its motion is a formula of."""
    kept = dict(body.carrier.arrays())
    if body.drift is not None and body.drift.has_formula:
        kept["unmoved"] = body.drift.unmoved
    return kept


def _formula(body: Body) -> dict[str, Any] | None:
    """The motion of a body that moves by itself and whose motion a formula tells."""
    if body.drift is None or not body.drift.has_formula:
        return None
    return motion_table(body.drift.played.choice)


def _drifts_untold(body: Body) -> bool:
    """Whether a body moves by itself in a way that no formula tells, so that each frame has to."""
    return body.drift is not None and not body.drift.has_formula


def _temporary() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="gasp-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder / "run.gasp"
