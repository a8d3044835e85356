"""The viewer while it runs: one loop that reads the controls, moves the playhead and shows what is packed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from gasp_core.contract import HalfSpace
from gasp_core.errors import RecordingError
from gasp_core.rendering.footage import Footage, RecordedFootage
from gasp_core.rendering.framing import Motion
from gasp_viewer.colouring import colourings_of
from gasp_viewer.current_frame import first_readable
from gasp_viewer.display import Display
from gasp_viewer.display_units import Stage, shown_motion, three_quarter
from gasp_viewer.layers import LAYERS
from gasp_viewer.packer import Failure, Packer, Picture, Want
from gasp_viewer.painter import Eye, Painter, Subject
from gasp_viewer.panel import Panel, body_legend, scale_legend
from gasp_viewer.playback import Film, Playhead, advanced, pressed, sought
from gasp_viewer.run_updates import FileNews, News, RunNews, Source, figure
from gasp_viewer.scenery import add_scenery, grid_cell
from gasp_viewer.shots import Shots

__all__ = ["POLL", "Exhibit", "Session", "wait_for_frame"]

Array = NDArray[Any]

POLL = 0.5
"""Seconds between two looks at a run that may go on."""
_FINEST = 1 / 120
"""Seconds the loop sleeps at least."""
_FACTS = 0.1
"""Seconds between two changes of the facts while the film plays: nobody reads faster."""
_GROWTH = 1.5
"""The view to go back to is chosen anew once a run has so many times as many frames."""
_SETTLED = 0.3
"""Seconds a camera has to stand still before colours follow it."""
_MOVED = 0.1
"""Share of its distance an eye has to move before colours follow it: about 6 degrees around."""


class Exhibit:
    """A footage made ready to be shown: everything that takes its time before there is a page.

    Parameters
    ----------
    footage
        With at least one frame.

    Raises
    ------
    RecordingError, SplatFormatError
        Where all of it is damaged.
    """

    def __init__(self, footage: Footage) -> None:
        self.footage = footage
        frame = first_readable(footage)
        self.motion = shown_motion(footage, frame)
        self.stage = Stage.of(self.motion)
        self.painter = Painter(footage, self.stage, frame)
        self.layers = {name: LAYERS[name] for name in self.painter.layers}
        self.colourings = colourings_of(footage)
        self.source: Source = RunNews(footage) if isinstance(footage, RecordedFootage) else FileNews(footage)


def wait_for_frame(footage: RecordedFootage, *, say: Callable[[str], None], pause: float = POLL) -> None:
    """Wait until a run has its first frame.

    Parameters
    ----------
    footage
        The run.
    say
        Called once with a sentence where there is something to wait for.
    pause
        Seconds between two looks.

    Raises
    ------
    RecordingError
        Where it has none and will have none.
    """
    said = False
    while footage.frame_count == 0:
        recording = footage.recording
        if recording.status != "running" and footage.frame_count == 0:
            why = f" ({recording.reason})" if recording.reason else ""
            raise RecordingError(
                f'{footage.path}: holds no frame, and nothing writes to it{why}: go on with "gasp run --resume"'
            )
        if not said:
            say(f"{footage.path}: is running and holds no frame yet, waiting for the first")
            said = True
        time.sleep(pause)


class Session:
    """Shows an exhibit on a server.

    Parameters
    ----------
    exhibit
        What is shown.
    server
        Where.
    layer, colouring
        What to begin with.
    """

    def __init__(self, exhibit: Exhibit, server: viser.ViserServer, *, layer: str, colouring: str) -> None:
        self._exhibit = exhibit
        self._server = server
        self._wake = threading.Event()
        self._shots = Shots()
        footage = exhibit.footage
        is_run = isinstance(footage, RecordedFootage)
        self._movers = add_scenery(server.scene, footage.colliders, exhibit.stage)
        self.panel = Panel(
            server,
            layers=exhibit.layers,
            colourings=exhibit.colourings,
            notes=footage.recording.notes if is_run else (),
            is_film=is_run or footage.frame_count > 1,
            wake=self._wake.set,
            keep=self.keep_view,
        )
        self.panel.choose(layer, colouring)
        self._display = Display(server)
        self._bodies = [body.name for body in footage.recording.bodies] if is_run else []
        self._has_static = is_run and not footage.recording.moving.all()
        self._news = exhibit.source.look()
        self._count = max(self._news.count, 1)
        self._looked = 0.0
        self._head = Playhead()
        self._picture: Picture | None = None
        self._told: object = None
        self._told_at = 0.0
        self.panel.set_film(self._count, self._news.growing)
        self.panel.set_follow(self._news.growing)
        self._aim(exhibit.motion)
        self._eye: Eye = _triple(three_quarter(exhibit.motion).eye)
        self._moving = threading.Event()
        self._sighting: Array | None = None
        self._sighted = 0.0
        if exhibit.painter.depends_on_eye:
            server.on_client_connect(self._watch_camera)
        self._packer = Packer(exhibit.painter, self._wake.set)

    @property
    def picture(self) -> Picture | None:
        """What is on the page; None: nothing yet."""
        return self._picture

    @property
    def head(self) -> Playhead:
        """Where the film stands."""
        return self._head

    @property
    def packed(self) -> int:
        """Frames that are ready to be shown."""
        return self._packer.kept_frames

    def run(self) -> None:
        """Show it until Ctrl-C (KeyboardInterrupt)."""
        before = time.monotonic()
        while True:
            now = time.monotonic()
            self.step(now, now - before)
            before = now
            self.wait(self._rest())

    def close(self) -> None:
        """End what works in the background."""
        self._packer.stop()

    def wait(self, seconds: float) -> None:
        """Wait until something happens, but no longer than this."""
        self._wake.wait(seconds)
        self._wake.clear()

    def step(self, now: float, elapsed: float) -> None:
        """One turn of the loop: at the time `now` [s], `elapsed` seconds after the last."""
        if now - self._looked >= POLL:
            self._looked = now
            self._take(self._exhibit.source.look())
        self._follow_eye(now)
        # A machine that slept does not make the film jump.
        self._move(min(elapsed, POLL))
        self._packer.ask(
            Want(
                subject=Subject(layer=self.panel.layer, colouring=self.panel.colouring),
                frame=self._head.frame,
                count=self._count,
                eye=self._eye,
            )
        )
        self._show(now)

    def _rest(self) -> float:
        """Seconds until there is something to do by itself."""
        if self._head.playing:
            to_next = (self._head.frame + 1 - self._head.position) / (self._film.frame_rate * self.panel.speed)
            return min(max(to_next, _FINEST), POLL)
        return POLL if self._sighting is None else _SETTLED

    @property
    def _film(self) -> Film:
        return Film(count=self._count, frame_rate=self._exhibit.footage.frame_rate, growing=self._news.growing)

    def _take(self, news: News) -> None:
        """Take in how the footage stands now."""
        self._news = news
        if news.count:
            self._count = news.count
        elif self._head.playing:
            # Gone: what is packed can still be looked at.
            self._head = Playhead(position=self._head.position)
        self.panel.set_film(self._count, news.growing)
        if self._count >= _GROWTH * self._framed:
            self._aim(self._exhibit.source.extended(self._exhibit.motion, self._count - 1))

    def _aim(self, motion: Motion) -> None:
        """Make the view of a motion the one that browsers begin with and go back to."""
        self._framed = self._count
        view, stage = three_quarter(motion), self._exhibit.stage
        camera = self._server.initial_camera
        camera.position, camera.look_at = stage.place(view.eye), stage.place(view.target)
        camera.up, camera.fov = np.array([0.0, 0.0, 1.0]), view.field_of_view
        self.panel.set_view(_triple(camera.position), _triple(camera.look_at))

    def keep_view(self, camera: viser.CameraHandle | None) -> str:
        """Keep where a camera stands at the frame that is shown, None: forget all; what is kept, as a scene has it."""
        if camera is None:
            self._shots = Shots()
        else:
            time = self._head.frame / self._exhibit.footage.frame_rate
            position, target = (_triple(self._exhibit.stage.world(at)) for at in (camera.position, camera.look_at))
            self._shots = self._shots.kept(time, position, target, float(np.degrees(camera.fov)))
        return self._shots.to_toml()

    def camera_moved(self, position: Array) -> None:
        """A browser's camera stands here now, (3,) on the stage; from any thread."""
        self._sighting = self._exhibit.stage.world(position)
        self._moving.set()
        self._wake.set()

    def _watch_camera(self, client: viser.ClientHandle) -> None:
        client.camera.on_update(lambda camera: self.camera_moved(camera.position))
        self.camera_moved(client.camera.position)

    def _follow_eye(self, now: float) -> None:
        """Let the colours follow the camera that moved last, once it stands still."""
        if self._moving.is_set():
            self._moving.clear()
            self._sighted = now
        eye = self._sighting
        if eye is None or now - self._sighted < _SETTLED:
            return
        self._sighting = None
        motion = self._exhibit.motion
        distance = max(float(np.linalg.norm(eye - motion.centre)), _MOVED * motion.reach)
        if np.linalg.norm(eye - self._eye) > _MOVED * distance:
            self._eye = _triple(eye)

    def _move(self, elapsed: float) -> None:
        """Move the playhead as the controls and the clock say."""
        film, panel = self._film, self.panel
        frame = panel.take_seek()
        if frame is not None:
            panel.set_follow(False)
            self._head = sought(self._head, film, float(frame))
        elif panel.take_press():
            panel.set_follow(False)
            self._head = pressed(self._head, film)
        elif panel.follow:
            self._head = Playhead(position=float(film.last))
        else:
            moved = advanced(self._head, film, elapsed, speed=panel.speed, loop=panel.loop)
            # The film holds until the frame is packed.
            if moved.frame == self._head.frame or self._packer.picture(moved.frame) is not None:
                self._head = moved
        panel.set_frame(self._head.frame)
        panel.set_playing(self._head.playing)

    def _show(self, now: float) -> None:
        """Bring the page up to date."""
        frame = self._head.frame
        found = self._packer.picture(frame)
        if isinstance(found, Picture) and found is not self._picture:
            self._picture = found
            self._display.show(found.packed)
            for mover in self._movers:
                mover.show(frame / self._exhibit.footage.frame_rate)
            self.panel.set_legend(self._legend(found))
        failure = found.message if isinstance(found, Failure) else ""
        self.panel.set_message(self._news.problem or failure)
        told = frame, self._news, self.panel.layer
        if told != self._told and (not self._head.playing or now - self._told_at >= _FACTS):
            self._told, self._told_at = told, now
            self.panel.set_facts(self._facts(frame))

    def _legend(self, picture: Picture) -> str:
        if picture.scale is not None:
            return scale_legend(picture.scale)
        if picture.subject.colouring == "body":
            return body_legend(self._bodies, self._has_static)
        return ""

    def _facts(self, frame: int) -> list[tuple[str, str]]:
        facts: list[tuple[str, str]] = []
        if self._news.status:
            facts += [("status", self._news.status), ("frame", f"{frame} of {self._count - 1}, counted from 0")]
        facts += self._exhibit.source.facts(frame)
        if any(isinstance(collider.shape, HalfSpace) for collider in self._exhibit.footage.colliders):
            facts.append(("grid cell", figure(grid_cell(self._exhibit.stage), "m")))
        note = self._exhibit.painter.layers[self.panel.layer].note
        return facts + ([("shown", note)] if note else [])


def _triple(point: Array) -> Eye:
    x, y, z = (float(value) for value in point)
    return x, y, z
