"""`simulate`: a scene in, a recording out, whatever the engine."""

from __future__ import annotations

import atexit
import dataclasses
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    EngineDescriptor,
    EngineSession,
    Field,
    PointEngine,
    Precision,
)
from gasp_core.contract.capabilities import check_supported
from gasp_core.contract.options import build_options
from gasp_core.discovery.registry import discover
from gasp_core.engines.held_session import held
from gasp_core.errors import RecordingError, SceneError
from gasp_core.processes.scratch import Scratch
from gasp_core.progress import Progress, Shown, progress_for
from gasp_core.recording import Recording
from gasp_core.recording.address_names import address_of, path_here
from gasp_core.recording.addresses import mirrored, pushing
from gasp_core.recording.continuing import refuse_other
from gasp_core.recording.layout import Header
from gasp_core.recording.status import ENDED_WITHOUT_A_WORD
from gasp_core.recording.writer import RecordingWriter, ended_without_a_word, refuse_existing
from gasp_core.reduction.assembly import Assembly
from gasp_core.reduction.bodies import Body
from gasp_core.reduction.centres import Centres
from gasp_core.reduction.leading import refuse_too_large, trajectories_of
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.scene.model import Scene, engine_notes
from gasp_core.scene.named_code import code_of, refuse_untrusted, without_code
from gasp_core.simulation.engine_choice import ChosenEngine, choose_engine
from gasp_core.simulation.loop import FrameLoop, drift_is_recorded, ending
from gasp_core.simulation.recording_header import header_of
from gasp_core.simulation.splat_sources import Prepared, prepare
from gasp_core.simulation.stiff_matter import refuse_too_stiff

__all__ = ["simulate", "simulate_part"]

Array = NDArray[Any]


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
    trust_code: bool = False,
    progress: Shown = None,
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
        Folder of the recording, or an address, s3://bucket/run.gasp, see `gasp_core.recording.addresses`. None: a
        temporary one, gone when the process ends.
    device, precision
        Instead of the scene's; without them another engine keeps what the scene says where it can, see
        `Scene.with_engine`.
    resume
        Go on with the recording at `out` from its last checkpoint; begin where there is none. The result is that of
        a run that never stopped, bit for bit with an engine that is deterministic. The scene may last longer than
        before, but not less long than the frames that there are, and have another camera.
    frames
        Stop once there are so many frames, the one at time 0 included; `resume` goes on from there.
    overwrite
        Replace a recording that is at `out`.
    isolate
        Run the engine in a process of its own; None: as the scene says.
    trust_code
        Import the functions that motions of the scene name by text, which is refused otherwise: such code comes with
        the scene, and runs with your rights. A function that is handed over as an object is your own, and asks nothing.
    progress
        Show a progress bar and notes; None: on terminals and in notebooks; "log": there, and elsewhere a line every
        ten seconds.
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
    if not isinstance(out, str | Path | None):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SceneError(f"out must be a path or an address, found {out!r}")
    address = None if out is None else address_of(out)
    if out is not None and address is None:
        out = path_here(out)
    with mirrored(address, resume=resume, overwrite=overwrite) if address else nullcontext() as mirror:
        return simulate_part(
            scene,
            scene,
            engine,
            out if mirror is None else mirror.path,
            device=device,
            precision=precision,
            resume=resume,
            frames=frames,
            overwrite=overwrite,
            isolate=isolate,
            trust_code=trust_code,
            progress=progress,
            recorded=recorded if mirror is None else pushing(mirror, recorded),
        )


def simulate_part(
    scene: Scene,
    whole: Scene,
    engine: str | tuple[EngineDescriptor, PointEngine] | None = None,
    out: str | Path | None = None,
    *,
    device: str | None = None,
    precision: Precision | None = None,
    resume: bool = False,
    frames: int | None = None,
    overwrite: bool = False,
    isolate: bool | None = None,
    trust_code: bool = False,
    progress: Shown = None,
    recorded: Callable[[int], None] | None = None,
    led: Callable[[int], None] | None = None,
) -> Recording:
    """`simulate` a scene that is a part of another one, its first moments, and is refused what that one is refused.

    Parameters
    ----------
    scene
        What is run.
    whole
        What it is a part of: the same but for duration and frame rate.
    engine, out, device, precision, resume, frames, overwrite, isolate, trust_code, progress, recorded
        As of `simulate`.
    led
        Called with the number of each frame of which it is known where motions drive the points.
    """
    if not isinstance(scene, Scene):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SceneError(f"a Scene is simulated, found {scene!r}: gasp_core.load_scene reads the file of one")
    if precision is not None:
        try:
            precision = Precision(precision)
        except ValueError:
            known = ", ".join(one.value for one in Precision)
            raise SceneError(f"precision must be one of {known}, found {precision!r}") from None
    if frames is not None and frames < 1:
        raise SceneError(f"frames must be at least 1, found {frames!r}")
    refuse_untrusted(scene, trust_code)
    asked = scene
    scene, chosen = choose_engine(scene, engine, isolate, device, precision)
    options = build_options(chosen.descriptor, scene.engine.options)
    path = _temporary() if out is None else Path(out)
    found = Recording.open(path) if resume and (path / "zarr.json").exists() else None
    if found is None:
        refuse_existing(path, overwrite)
    known = {} if found is None else _carriers_of(found)
    spacing = None if found is None else found.header.spacing
    wanted = scene.frame_count
    end = wanted if frames is None else min(frames, wanted)
    # Where an engine begins with matter at rest: what a checkpoint has of it, the engine knows better.
    judged = whole if found is None and end > 1 else None
    if code_of(scene):
        # Whoever's code it is, it is not imported for a scene that is refused for something else.
        _check_supported(without_code(scene), judged, chosen, known, spacing)
    with progress_for(progress, wanted) as shown:
        prepared = _check_supported(scene, judged, chosen, known, spacing)
        on_engine = engine_notes(asked, scene, chosen.descriptor)
        header = header_of(scene, whole, path, prepared, chosen, options, on_engine)
        for note in header.notes:
            shown.say(note)
        if resume and found is None:
            shown.say(f"{path}: no recording is there to go on with, it begins")
        if found is not None and frames is not None and found.frame_count > frames:
            shown.say(
                f"{path}: has {found.frame_count} frames already, more than frames = {frames}: nothing is to be done"
            )
        if found is not None and ended_without_a_word(found):
            shown.say(f"{path}: {ENDED_WITHOUT_A_WORD}{_how_to_learn_why(scene, chosen)}")
        writer, last, restart = None, -1, {}
        try:
            if found is not None:
                velocities = scene.recording.velocities
                refuse_other(found, header, chosen.descriptor, options, velocities=velocities, frames=wanted)
                writer, last, restart = RecordingWriter.resume(found, wanted, header.scene)
                if writer.note:
                    shown.say(writer.note)
            # psi is asked for every frame: not where none is left to do. How many are left is known by now: those that
            # are damaged, and those after the last checkpoint, have been taken back.
            if prepared.assembly.leads and last + 1 < end:
                with nullcontext() if writer is None else ending(writer):
                    prepared = _with_trajectories(scene, prepared, shown, led or (lambda frame: None))
            opening = partial(_opened, scene, prepared.assembly, chosen, options, restart)
            begun: AbstractContextManager[EngineSession | None] = nullcontext()
            if writer is None:
                # Opened before anything is written: what the engine refuses leaves nothing behind.
                # Whether it does is known to the engine alone, and it may be a minute.
                shown.enter(f"starting {chosen.descriptor.name} (may compile, the first time)")
                begun = opening() if end > 1 else nullcontext()
            with begun as session:
                writer = writer or _created(path, scene, prepared, header, overwrite)
                run = FrameLoop(scene, prepared.assembly, chosen, writer, shown, recorded or (lambda frame: None))
                run.go(last, (lambda: session) if session is not None else opening, end)
        finally:
            if writer is not None:
                writer.close()
    return Recording.open(path)


def _strained(prepared: Prepared, chosen: ChosenEngine) -> Prepared:
    """With bodies of centres strained by the deformation gradients of an engine that shows them."""
    if Field.DEFORMATION_GRADIENTS not in chosen.descriptor.capabilities.output_fields:
        return prepared
    bodies = tuple(
        dataclasses.replace(body, strained=isinstance(body.carrier, Centres)) for body in prepared.assembly.bodies
    )
    return dataclasses.replace(prepared, assembly=dataclasses.replace(prepared.assembly, bodies=bodies))


def _with_trajectories(scene: Scene, prepared: Prepared, shown: Progress, led: Callable[[int], None]) -> Prepared:
    """With where the motions of its objects drive the points."""
    assembly = prepared.assembly

    def watch(frame: int, last: int) -> None:
        led(frame - 1)
        shown.enter(f"where matter is driven, frame {frame} of {last}")

    trajectories = trajectories_of(scene, assembly.leads, watch)
    problem = dataclasses.replace(assembly.problem, trajectories=trajectories)
    return dataclasses.replace(prepared, assembly=dataclasses.replace(assembly, problem=problem))


def _how_to_learn_why(scene: Scene, chosen: ChosenEngine) -> str:
    """What else to try where a process has died that an engine was in: nobody knows whether the engine ended it."""
    if chosen.engine is not None or chosen.isolated(scene.engine):
        return ""
    name = chosen.descriptor.name
    return f"; if {name} has crashed it, gasp run --isolate (isolate = true under [engine]) tells where"


def _carriers_of(found: Recording) -> dict[str, TransferOperator]:
    """What carries the bodies of a recording, by object."""
    try:
        bodies = found.bodies
    except RecordingError:
        # Refused with a word about how to go on, when all else has been looked at.
        return {}
    return {body.name: body.carrier for body in bodies}


def _check_supported(
    scene: Scene,
    judged: Scene | None,
    chosen: ChosenEngine,
    known: Mapping[str, TransferOperator],
    spacing: float | None,
) -> Prepared:
    """Read a scene and refuse what its engine does not declare, or what frames as of `judged` are too long for."""
    prepared = _strained(prepare(scene, known, spacing), chosen)
    names = prepared.assembly.body_names
    refuse_too_large(prepared.assembly.leads, (judged or scene).frame_count)
    check_supported(
        prepared.assembly.problem,
        chosen.descriptor,
        device=scene.engine.device,
        precision=scene.engine.precision,
        fields=frozenset({Field.VELOCITIES}) if scene.recording.velocities else frozenset(),
        body_names=names,
        drive_names=prepared.assembly.drive_names,
        others=discover().engines.values(),
    )
    if judged is not None:
        refuse_too_stiff(
            prepared.assembly.problem,
            chosen.descriptor,
            prepared.assembly.accuracy,
            frame_step=1 / judged.frame_rate,
            duration=judged.duration,
            body_names=names,
            others=discover().engines.values(),
        )
    return prepared


def _opened(
    scene: Scene, assembly: Assembly, chosen: ChosenEngine, options: Any, restart: dict[str, Array]
) -> EngineSession:
    """The engine at the start, or where a checkpoint left it."""
    capabilities, engine = chosen.descriptor.capabilities, chosen.opened(scene.engine)
    opening = partial(
        engine.open,
        assembly.problem,
        device=scene.engine.device or capabilities.devices[0],
        precision=scene.engine.precision or capabilities.precisions[0],
        seed=scene.engine.seed,
        accuracy=assembly.accuracy,
        options=options,
        restart=restart or None,
    )
    return held(opening, chosen.descriptor.name, assembly.problem)


def _created(path: Path, scene: Scene, prepared: Prepared, header: Header, overwrite: bool) -> RecordingWriter:
    return RecordingWriter.create(
        path,
        header,
        reference=prepared.gaussians,
        moving=np.concatenate([placed.moving for placed in prepared.objects]),
        points=prepared.assembly.problem.points.reference_positions,
        carriers=[_kept(body) for body in prepared.assembly.bodies],
        drifting=sum(
            body.drifting[0] * body.drifting[1] for body in prepared.assembly.bodies if drift_is_recorded(body)
        ),
        frames_wanted=scene.frame_count,
        velocities=scene.recording.velocities,
        overwrite=overwrite,
    )


def _kept(body: Body) -> dict[str, Array]:
    """What a recording keeps of a body: how its points carry it, and what its motion is a formula of."""
    kept = dict(body.carrier.arrays())
    if body.drift is not None and body.drift.has_formula:
        kept["unmoved"] = body.drift.unmoved
    if body.driven is not None:
        kept["driven"] = body.driven
    return kept


def _temporary() -> Path:
    folder = Scratch("gasp-run-")
    atexit.register(folder.remove)
    return folder.path / "run.gasp"
