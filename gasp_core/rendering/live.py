"""Filming a run while it goes on, from where it will probably be seen well."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from gasp_core.errors import GaspError
from gasp_core.progress import counting
from gasp_core.recording import Recording
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.fitting import well_framed
from gasp_core.rendering.footage import Moving, RecordedFootage
from gasp_core.rendering.forecast import Forecast
from gasp_core.rendering.framing import Motion, motion_of
from gasp_core.rendering.outputs import Output, open_output
from gasp_core.rendering.painting import FramePainter, parse_background
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.sides import LEFT, RIGHT, side_told, with_side
from gasp_core.rendering.viewpoints import cameras_for
from gasp_core.scene.model import Scene
from gasp_core.scene.settings import CameraChoice

__all__ = ["LiveFilm"]


class LiveFilm:
    """Paints the frames of a run as they are recorded, or all of them in the end; what goes wrong with it never stops
    the run.

    A context manager: what was painted is a film in the end, however the run ended. Where matter went elsewhere than
    was to be expected of it, all is painted anew then, from where it is seen well.

    Parameters
    ----------
    folder
        Of the recording.
    scene
        That is run.
    paths
        Films, sheets, folders of pictures.
    width, height [px]
        Of a picture.
    frames
        How many there will be; None: as many as the scene has.
    progress
        Show a bar while it is painted anew; None: on terminals and in notebooks.

    Raises
    ------
    RenderingError, PluginLoadError
        Before the run begins: where an output cannot be what its name says, or no renderer is installed.
    """

    def __init__(
        self,
        folder: Path,
        scene: Scene,
        paths: Sequence[Path],
        *,
        width: int,
        height: int,
        frames: int | None = None,
        progress: bool | None = False,
    ) -> None:
        count = scene.frame_count if frames is None else min(frames, scene.frame_count)
        self._count = count
        self._folder = folder
        self._scene = scene
        self._size = width, height
        self._renderer = open_renderer()
        self._paths = tuple(paths)
        self._progress = progress
        self._outputs = self._opened(count)
        self._stack = ExitStack()
        self._painter: FramePainter | None = None
        self._choice = CameraChoice()
        self.cameras: list[Camera] = []
        """From where each frame is seen."""
        self._next = 0
        self._known = False
        self.side = ""
        """A line that says from which side it is seen, where that is not the usual one and nobody has asked for it."""
        self.problem = ""
        """Why filming ended before the run did."""
        self.anew = False
        """Whether it was filmed once more, because the first camera did not see it well."""

    def __enter__(self) -> LiveFilm:
        """Make the outputs ready."""
        self._begin()
        return self

    def __exit__(self, *error: object) -> None:
        """Finish the films, of what there is."""
        if self._next == 0:
            self._take_back()
        if self.problem:
            return
        try:
            if self._next:
                self._look_again()
            self._stack.close()
        except GaspError as fault:
            self.problem = str(fault)
            self._take_back()

    def recorded(self, frame: int) -> None:
        """A frame is on disk; it is painted, and those before it that were there already."""
        if self.problem:
            return
        try:
            while self._next <= min(frame, self._count - 1):
                self._paint(self._next)
                self._next += 1
        except GaspError as error:
            self.problem = str(error)
            self._take_back()

    def _opened(self, count: int) -> list[Output]:
        rate, title = self._scene.frame_rate, self._folder.name
        return [open_output(path, count=count, frame_rate=rate, title=title) for path in self._paths]

    def _begin(self) -> None:
        with ExitStack() as stack:
            for output in self._outputs:
                stack.enter_context(output)
            self._stack = stack.pop_all()

    def _footage(self) -> RecordedFootage:
        return RecordedFootage(Recording.open(self._folder))

    def _paint(self, frame: int) -> None:
        if self._painter is None:
            footage = self._footage()
            self._known = footage.recording.frame_count >= self._count
            if self._known:
                self._set_up(footage, footage, motion_of(footage, range(self._count)), self._count)
            else:
                forecast = Forecast(footage, self._scene, self._count)
                self._set_up(footage, forecast, motion_of(forecast), self._count)
        assert self._painter is not None
        wanting = [output for output in self._outputs if output.wants(frame)]
        if wanting:
            picture = self._painter.paint(frame, self.cameras[frame])
            for output in wanting:
                output.take(picture, self._scene.time_of(frame))

    def _set_up(self, footage: RecordedFootage, moving: Moving, motion: Motion, count: int) -> None:
        """Choose the cameras, for what moves as it did or is expected to."""
        width, height = self._size
        self._choice = self._sided(footage, motion)
        self.side = side_told(footage.camera, self._choice)
        self.cameras = cameras_for(
            footage,
            self._choice,
            motion=motion,
            subject=moving.subject,
            numbers=range(count),
            renderer=self._renderer,
            width=width,
            height=height,
        )
        background = parse_background("white")
        self._painter = FramePainter(footage, self._renderer, motion=motion, background=background)

    def _sided(self, footage: RecordedFootage, motion: Motion) -> CameraChoice:
        """The scene's camera, from the side from which less is hidden; it stays on a side that is about as good."""
        said = footage.camera or CameraChoice()
        width, height = self._size
        usual = LEFT if self._choice.view == LEFT else RIGHT
        return with_side(said, motion, footage.colliders, width=width, height=height, usual=usual)

    def _look_again(self) -> None:
        """Paint all there is once more where the subject was not wholly in the pictures, or small in them, or would
        be hidden less from the other side.
        """
        if self._known:
            return
        footage, count = self._footage(), self._next
        stands = footage.camera is not None and not footage.camera.sees_all
        # Who stopped the run waits for the command to end too.
        if stands or footage.recording.reason.startswith("stopped by"):
            return
        motion = motion_of(footage, range(count))
        seen = self._sided(footage, motion).view == self._choice.view
        if seen and well_framed(self.cameras[:count], motion, footage.subject, self._renderer):
            return
        self.anew = True
        self._take_back()
        self._outputs = self._opened(count)
        self._set_up(footage, footage, motion, count)
        self._begin()
        with counting(self._progress, "filmed anew", count) as painted:
            for frame in range(count):
                self._paint(frame)
                painted()

    def _take_back(self) -> None:
        """Leave nothing half done."""
        self._stack.__exit__(GaspError, GaspError("not filmed"), None)
        self._stack = ExitStack()
