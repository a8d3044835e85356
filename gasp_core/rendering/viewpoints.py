"""From where something is shown: what the user says, else what its scene says, else a view of all the motion."""

from __future__ import annotations

from pathlib import Path

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.camera_files import choose, placed, read_cameras
from gasp_core.rendering.footage import Footage
from gasp_core.rendering.framing import VIEWS, Motion, frame_motion, turntable
from gasp_core.scene.settings import CameraChoice

__all__ = ["camera_of_choice", "cameras_for", "read_choice"]

DEFAULT_VIEW = "three-quarter"


def read_choice(text: str) -> str | CameraChoice:
    """What ``--camera`` names: one of `VIEWS`, or a camera file, a colon and which of its cameras.

    Raises
    ------
    RenderingError
        Where it is neither.
    """
    if text in VIEWS:
        return text
    file, _, view = text.rpartition(":") if ".json:" in text else (text, "", "0")
    if not file.endswith(".json"):
        raise RenderingError(
            f'no view "{text}": choose one of {", ".join(VIEWS)}, or name a file: cameras.json:3, transforms.json'
        )
    return CameraChoice(file=Path(file), view=int(view) if view.isdigit() else view)


def camera_of_choice(choice: CameraChoice, footage: Footage, *, width: int, height: int) -> Camera:
    """The camera that a scene or a user describes, for pictures of a size.

    Raises
    ------
    RenderingError
        Where its file cannot be read or has no such camera.
    RecordingError
        Where it is in the frame of an object that is not there.
    """
    if choice.file is not None:
        camera = choose(read_cameras(choice.file), choice.view, choice.file)
        return placed(camera.resized(width, height), footage.placement(choice.object))
    assert choice.position is not None and choice.target is not None  # CameraChoice refuses anything else
    return look_at(
        choice.position, choice.target, width=width, height=height, field_of_view=choice.field_of_view, near=1e-3
    )


def cameras_for(
    footage: Footage,
    choice: str | CameraChoice | None,
    *,
    motion: Motion,
    count: int,
    width: int,
    height: int,
    turning: bool = False,
) -> list[Camera]:
    """Cameras for `count` pictures.

    Parameters
    ----------
    footage
        What is shown; its scene's camera is taken where `choice` is None.
    choice
        A name of `VIEWS` or a camera.
    motion
        What is to be in the picture.
    count, width, height
        Of the pictures.
    turning
        Once around it during the film, starting at a named view.

    Raises
    ------
    RenderingError
        Where a turn is asked of a camera that stands somewhere.
    """
    if turning and isinstance(choice, CameraChoice):
        raise RenderingError("a turntable starts at a named view, not at a camera of a file or position")
    if not turning:
        choice = choice if choice is not None else footage.camera
    if isinstance(choice, CameraChoice):
        return [camera_of_choice(choice, footage, width=width, height=height)] * count
    around, above = VIEWS[choice or DEFAULT_VIEW]
    if turning:
        return turntable(motion, count, width=width, height=height, around=around, above=above)
    return [frame_motion(motion, width=width, height=height, around=around, above=above)] * count
