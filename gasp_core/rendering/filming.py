"""A recording, a scene, or a splat, as films, pictures and sheets."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from gasp_core.errors import RenderingError, SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.progress import counting
from gasp_core.recording import Recording
from gasp_core.rendering.footage import Footage, open_footage
from gasp_core.rendering.framing import motion_of
from gasp_core.rendering.outputs import open_output
from gasp_core.rendering.painting import FramePainter, parse_background
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.sides import side_told, with_side
from gasp_core.rendering.viewpoints import cameras_for, read_choice
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import UpAxis
from gasp_core.scene.settings import CameraChoice

__all__ = ["render"]

_LOG = logging.getLogger(__name__)

_TURN = 100
"""Pictures of a turn around something that does not move."""


def render(
    run: Recording | Scene | Gaussians | str | Path,
    *outs: str | Path,
    size: tuple[int, int] = (1280, 720),
    camera: str | CameraChoice | None = None,
    frames: Sequence[int] | None = None,
    turntable: bool = False,
    follow: bool | None = None,
    slower: float = 1.0,
    background: str = "white",
    colliders: bool | None = None,
    up: UpAxis = "-y",
    renderer: str | None = None,
    progress: bool | None = None,
) -> None:
    """Show a run as a film, as pictures, or as a sheet of key frames; a scene or a splat as a picture.

    Every file appears whole, or not at all where anything fails; what was there under its name is replaced.

    Parameters
    ----------
    run
        A recording, finished or not; a scene, which is shown as it begins; a splat; or the path of one of these.
    outs
        ``film.mp4``, ``.webm``, ``.gif``, ``sheet.png`` (key frames; of one frame a plain picture), else a folder of
        pictures. Each frame is painted once for all of them.
    size [px]
        Width and height of a picture.
    camera
        A named view ("three-quarter", "front", "right", "back", "left", "top", "three-quarter-left"), "cameras.json:3",
        "transforms.json:NAME", a .toml with a ``[camera]``, or a `CameraChoice`. None: the scene's, else three-quarter,
        from the left where less is hidden then behind colliders that stand still, and the log says so. Named views
        have all that moves in the picture.
    frames
        Numbers of the frames to show; None: all.
    turntable
        Go around once during the film, from a named view.
    follow
        A named view goes along with what moves; None: where it goes several times as far as it is large.
    slower
        Slow motion: 2 makes the film twice as long.
    background
        A colour name, #rrggbb, or "transparent" (all but .mp4).
    colliders
        Draw floors and what else is solid, with shadows on them; None: but for a transparent background.
    up
        A splat's axis that points up.
    renderer
        Name of an installed renderer; None: the default.
    progress
        Show a bar; None: on terminals and in notebooks.

    Raises
    ------
    RenderingError
        Where there is no frame, a camera or colour does not exist, an output cannot be what its name says, a codec is
        missing.
    RecordingError, SplatFormatError
        Where `run` is neither, or damaged.
    SceneError
        Where it is a scene that cannot be read.
    """
    if not outs:
        raise RenderingError("name what to write: film.mp4, sheet.png or a folder for pictures")
    if not (math.isfinite(slower) and slower > 0):
        raise RenderingError(f"slower must be a number > 0, found {slower!r}")
    if isinstance(size, int) or len(size) != 2:  # pyright: ignore[reportUnnecessaryIsInstance]
        raise RenderingError(f"size must be (width, height) in pixels, found {size!r}")
    if isinstance(frames, int):
        frames = [frames]
    if not isinstance(camera, str | CameraChoice | None):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise RenderingError(f"camera must be a text or a CameraChoice, found {camera!r}")
    for number, out in enumerate(outs):
        if Path(out) in map(Path, outs[:number]):
            raise RenderingError(f"{out} is named twice: name each output once")
    colour = parse_background(background)
    footage = open_footage(run, up)
    choice = _choice(footage, read_choice(camera) if isinstance(camera, str) else camera, turntable, follow)
    count = footage.frame_count
    chosen = list(range(count) if frames is None else frames)
    for number in chosen:
        if not 0 <= number < count:
            raise RenderingError(f"{footage.path}: has frames 0 to {count - 1}, not {number}")
    if not chosen:
        raise RenderingError(f'{footage.path}: holds no frame yet: wait for one, or go on with "gasp run --resume"')
    if turntable and len(chosen) == 1:
        chosen *= _TURN
    motion = motion_of(footage, chosen)
    width, height = size
    painting = open_renderer(renderer)
    drawn = footage.colliders if (colour is not None if colliders is None else colliders) else ()
    said = choice or footage.camera or CameraChoice()
    # What is not drawn hides nothing.
    choice = with_side(said, motion, drawn, width=width, height=height)
    if told := side_told(said, choice):
        _LOG.warning("%s", told)
    cameras = cameras_for(
        footage,
        choice,
        motion=motion,
        subject=footage.subject,
        numbers=chosen,
        # A frame alone is seen as it is in the film of all.
        shares=None if turntable else [number / count for number in chosen],
        renderer=painting,
        width=width,
        height=height,
    )
    rate, title = footage.frame_rate / slower, footage.path.name
    outputs = [open_output(Path(out), count=len(chosen), frame_rate=rate, title=title) for out in outs]
    painter = FramePainter(footage, painting, motion=motion, background=colour, colliders=drawn)
    with counting(progress, "frame", len(chosen)) as painted, ExitStack() as stack:
        for output in outputs:
            stack.enter_context(output)
        for index, (number, seen) in enumerate(zip(chosen, cameras)):
            wanting = [output for output in outputs if output.wants(index)]
            if wanting:
                picture = painter.paint(number, seen)
                for output in wanting:
                    output.take(picture, number / footage.frame_rate)
            painted()


def _choice(footage: Footage, said: CameraChoice | None, turntable: bool, follow: bool | None) -> CameraChoice | None:
    """A camera that turns or follows as it is asked to."""
    if not turntable and follow is None:
        return said
    # A turn around all of it is not asked of the camera that a scene has.
    choice = said or (CameraChoice() if turntable else footage.camera) or CameraChoice()
    try:
        return replace(choice, turns=1.0 if turntable else choice.turns, follow=follow)
    except SceneError as error:
        wish = "a turntable starts" if turntable else "what is followed is seen"
        raise RenderingError(f"{wish} from a named view: {error}") from None
