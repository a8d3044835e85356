"""The loop over frames: advance, judge, write; and all the ways in which a run may end."""

from __future__ import annotations

import dataclasses
import math
import signal
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    EngineSession,
    Field,
    PointState,
    Status,
    StepReport,
)
from gasp_core.errors import EngineCrashedError, EngineDivergedError, GaspError, RecordingError
from gasp_core.progress import Progress
from gasp_core.recording import Recording
from gasp_core.recording.writer import RecordingWriter
from gasp_core.reduction.assembly import Assembly
from gasp_core.reduction.bodies import Body
from gasp_core.reduction.centres import strained
from gasp_core.reduction.shape_flags import shape_flags
from gasp_core.scene.model import Scene
from gasp_core.scene.settings import MapChoice, RecordingChoice
from gasp_core.simulation.engine_choice import ChosenEngine
from gasp_core.simulation.monitor import FASTER_THAN_SOUND, Watch, inspect, outrun_sound, watch_over

__all__ = ["FrameLoop", "drift_is_recorded", "ending"]

Array = NDArray[Any]

_SAME_TIME = 1e-6
"""Of a frame: sums of steps may be off in their last digits, and no checkpoint of another frame is that near."""


class FrameLoop:
    """One run: the loop over frames, and all the ways in which it may end."""

    def __init__(
        self,
        scene: Scene,
        assembly: Assembly,
        chosen: ChosenEngine,
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
        with ending(self._writer):
            if last < 0:
                self._write_start()
                self._recorded(0)
                last = 0
            else:
                self._recall(last)
            self._checkpoint_frame = last or -1
            stopped = self._advance(last, opening, end) if last + 1 < end else ""
        if stopped:
            _end(self._writer, "incomplete", stopped)
            self._shown.say(stopped)
        elif end < self._scene.frame_count:
            kept = max(end, last + 1)
            _end(self._writer, "incomplete", f"stopped after {kept} of {self._scene.frame_count} frames, as asked")
        else:
            _end(self._writer, "complete", "")

    def _advance(self, last: int, opening: Callable[[], EngineSession], end: int) -> str:
        """Run the engine; why it stopped early, or nothing."""
        scene = self._scene
        with opening() as session, _interrupt(self._shown.say) as interrupted:
            self._expect_time(session, last)
            self._shown.watch(lambda: session.time * scene.frame_rate)
            before = session.read(self._fields)
            for frame in range(last + 1, end):
                report = session.advance_to(scene.time_of(frame))
                before = self._record(frame, session, report, before)
                self._shown.advance(frame, report.smallest_substep)
                self._recorded(frame)
                if interrupted.is_set() and frame + 1 < end:
                    self._keep(frame, session, always=True)
                    return f"interrupted after frame {frame} of {scene.frame_count - 1}"
                self._keep(frame, session, always=frame + 1 == end)
        return ""

    def _expect_time(self, session: EngineSession, last: int) -> None:
        """Refuse to go on from a checkpoint of another time: its frames would be of no run."""
        expected = self._scene.time_of(last)
        if not abs(session.time - expected) <= _SAME_TIME / self._scene.frame_rate:
            kept = self._writer.path / "checkpoints" / f"{last:08d}"
            raise RecordingError(
                f"{kept}: the engine's state is of {float(session.time)!r} s, frame {last} of {expected!r} s: it is"
                " damaged, of another run, or the engine does not keep its time; remove that folder and resume"
            )

    def _record(self, frame: int, session: EngineSession, report: StepReport, before: PointState) -> PointState:
        """Judge and write the frame the session has come to."""
        if report.status is not Status.OK:
            raise self._diverged(frame, report, "; ".join(report.warnings) or "the engine gave no reason")
        state = session.read(self._fields)
        verdict = inspect(self._watch, before, state)
        if verdict.status is not Status.OK:
            raise self._diverged(frame, dataclasses.replace(report, status=verdict.status), verdict.reason)
        smallest, largest = self._substeps(frame, report)
        warnings = [*report.warnings, *self._outran(before, state)]
        means, relative = self._writer.split(state.positions)
        drifts = self._drifts(frame, state)
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
                "smallest_substep": smallest,
                "largest_substep": largest,
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

    def _substeps(self, frame: int, report: StepReport) -> tuple[float, float]:
        """The smallest and the largest [s]; zero where there were none, whatever the engine's sums began with."""
        if report.substep_count == 0:
            return 0.0, 0.0
        sizes = float(report.smallest_substep), float(report.largest_substep)
        if not all(map(math.isfinite, sizes)):
            raise EngineCrashedError(
                f"{self._chosen.descriptor.name} failed at frame {frame}: it reports that all went well, with substeps"
                f" of {sizes[0]} to {sizes[1]} s: this is a fault of the engine"
            )
        return sizes

    def _outran(self, before: PointState, state: PointState) -> list[str]:
        """What there is to say of matter that outruns its own sound, once a run."""
        if self._told_of_sound:
            return []
        sentence = outrun_sound(self._watch, before, state, self._assembly.body_names)
        self._told_of_sound = bool(sentence)
        return [sentence] if sentence else []

    def _write_start(self) -> None:
        """Frame 0: displacement zero, without asking the engine, so that it is the file's own."""
        points = self._assembly.problem.points
        relative = np.zeros((len(points), 3), dtype=np.float32)
        drifts = self._drifts(0, None)
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

    def _drifts(self, frame: int, state: PointState | None) -> list[Array | None]:
        """How far each body has moved by itself, or been strained in a state (None: at the start); None for others."""
        time = self._scene.time_of(frame)
        gradients = None if state is None else state.deformation_gradients
        found: list[Array | None] = []
        for body in self._assembly.bodies:
            if body.strained:
                own = np.eye(3)[None] if gradients is None else gradients[body.points]
                found.append(strained(body.block.rest, own))
            else:
                found.append(None if body.drift is None else body.drift.at(time))
        return found

    def _untold(self, drifts: Sequence[Array | None]) -> list[Array]:
        return [
            drift for body, drift in zip(self._assembly.bodies, drifts) if drift is not None and drift_is_recorded(body)
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
        elif report.status is Status.NON_FINITE and self._chosen.descriptor.capabilities.unconditionally_stable:
            advice = f"; no step is too long for {self._chosen.descriptor.name}, so a shorter one is no remedy"
        elif accuracy.substep is not None:
            advice = f"; try substep = {accuracy.substep / 2:.3g} under [accuracy]"
        else:
            half = report.smallest_substep / 2
            step = f" (a substep of {half:.3g} s)" if 0 < half < math.inf else ""
            advice = f"; try substep_fraction = {accuracy.substep_fraction / 2:.3g} under [accuracy]{step}"
        name = self._chosen.descriptor.name
        return EngineDivergedError(
            f"{name} stopped at frame {frame} ({report.status.value}): {reason}{advice};"
            f" frames 0 to {frame - 1} are kept in {self._writer.path}",
            report,
            self._writer.path,
        )


@contextmanager
def ending(writer: RecordingWriter) -> Generator[None]:
    """What stops a run, whatever that is, stands in the status of its recording, and is raised on."""
    try:
        yield
    except EngineCrashedError as error:
        kept = EngineCrashedError(f"{error}; the frames so far are kept in {writer.path}", writer.path)
        _end(writer, "incomplete", str(kept))
        raise kept from error
    except GaspError as error:
        _end(writer, "incomplete", str(error))
        raise
    except BaseException as error:
        reason = " ".join(str(error).split())
        _end(writer, "incomplete", f"stopped by {type(error).__name__}{': ' if reason else ''}{reason}")
        raise


def _end(writer: RecordingWriter, state: str, reason: str) -> None:
    # The disk may be what failed: the first error is the one to tell.
    try:
        writer.finish(state, reason)
    except OSError:
        if state == "complete":
            raise


@contextmanager
def _interrupt(say: Callable[[str], None]) -> Generator[threading.Event]:
    """An event that Ctrl-C sets, and says so; a second Ctrl-C interrupts at once."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    before = signal.getsignal(signal.SIGINT)

    def stop(number: int, frame: FrameType | None) -> None:
        event.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        say("stops when this frame is done; Ctrl-C once more stops it at once")

    signal.signal(signal.SIGINT, stop)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


def drift_is_recorded(body: Body) -> bool:
    """Whether a body moves by itself in a way that no formula tells, so that each frame has to."""
    return body.strained or (body.drift is not None and not body.drift.has_formula)
