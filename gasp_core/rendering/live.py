"""Filming a run while it goes on, from where it will probably be seen well."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import HalfSpace, Side
from gasp_core.errors import GaspError
from gasp_core.recording import Recording
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import Motion, motion_of
from gasp_core.rendering.outputs import Output, open_output
from gasp_core.rendering.painting import FramePainter, parse_background
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.viewpoints import cameras_for
from gasp_core.scene.file_shapes import FileShape
from gasp_core.scene.model import Scene

__all__ = ["LiveFilm", "expected_motion"]

Array = NDArray[Any]

_LONGEST_FALL = 3.0
"""In sizes of what falls: where no floor stops it, it is soon too small to be looked at anyway."""
_LEFT = 0.01
"""Share of the matter outside the picture that is worth a word."""


class LiveFilm:
    """Paints the frames of a run as they are recorded; what goes wrong with it never stops the run.

    A context manager: what was painted is a film in the end, however the run ended.

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
    ) -> None:
        count = scene.frame_count if frames is None else min(frames, scene.frame_count)
        self._count = count
        self._folder = folder
        self._scene = scene
        self._size = width, height
        self._renderer = open_renderer()
        self._outputs: list[Output] = [
            open_output(path, count=count, frame_rate=scene.frame_rate, title=folder.name) for path in paths
        ]
        self._stack = ExitStack()
        self._painter: FramePainter | None = None
        self._camera: Camera | None = None
        self._next = 0
        self.problem = ""
        """Why filming ended before the run did."""

    def __enter__(self) -> LiveFilm:
        """Make the outputs ready."""
        with ExitStack() as stack:
            for output in self._outputs:
                stack.enter_context(output)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Finish the films, of what there is."""
        if self._next == 0:
            self._take_back()
        if not self.problem:
            try:
                self._stack.close()
            except GaspError as fault:
                self.problem = str(fault)

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

    def left_the_picture(self) -> bool:
        """Whether more than a little of the matter went where the camera does not look."""
        if self._camera is None or self.problem:
            return False
        places, depths = self._camera.project(motion_of(self._footage()).points)
        inside = (places >= 0).all(axis=1) & (places <= self._size).all(axis=1) & (depths > 0)
        return float(np.mean(~inside)) > _LEFT

    def _footage(self) -> RecordedFootage:
        return RecordedFootage(Recording.open(self._folder))

    def _paint(self, frame: int) -> None:
        if self._painter is None or self._camera is None:
            footage = self._footage()
            motion = expected_motion(motion_of(footage, [0]), self._scene)
            width, height = self._size
            (self._camera,) = cameras_for(footage, None, motion=motion, count=1, width=width, height=height)
            background = parse_background("white")
            self._painter = FramePainter(footage, self._renderer, motion=motion, background=background)
        wanting = [output for output in self._outputs if output.wants(frame)]
        if wanting:
            picture = self._painter.paint(frame, self._camera)
            for output in wanting:
                output.take(picture, self._scene.time_of(frame))

    def _take_back(self) -> None:
        """Leave nothing half done."""
        self._stack.__exit__(GaspError, GaspError("not filmed"), None)
        self._stack = ExitStack()


def expected_motion(start: Motion, scene: Scene) -> Motion:
    """Where matter will be, before anything has moved: where it starts, and where it falls to."""
    gravity = np.asarray(scene.gravity)
    strength = float(np.linalg.norm(gravity))
    if strength == 0:
        return start
    down = gravity / strength
    fall = min(0.5 * strength * scene.duration**2, _LONGEST_FALL * start.reach)
    for collider in scene.colliders:
        if isinstance(collider.shape, HalfSpace) and collider.side is Side.OUTSIDE:
            slope = -float(np.asarray(collider.shape.normal) @ down)
            if slope > 0:
                clearance = float(collider.shape.signed_distance(start.points).min())
                fall = min(fall, max(clearance, 0.0) / slope)
    if any(item.collider for item in scene.objects) or any(isinstance(one.shape, FileShape) for one in scene.colliders):
        # It lands on something of the picture, or beside it.
        fall = min(fall, float(np.ptp(start.points @ down)))
    return start.moved(fall * down)
