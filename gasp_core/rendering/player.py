"""Where whoever plays a moving splat begins to look from."""

from __future__ import annotations

import logging
import math
from typing import Any

from gasp_core.errors import GaspError, RenderingError
from gasp_core.recording import Recording
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import Motion, frame_motion, motion_of
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.sides import with_side
from gasp_core.rendering.viewpoints import cameras_for, told_cameras
from gasp_core.scene.settings import CameraChoice

__all__ = ["camera_of"]

_LOG = logging.getLogger(__name__)

_SIZE = 1280, 720


def camera_of(recording: Recording) -> dict[str, Any]:
    """Where a player begins: where the scene's camera stands in the first frame; of a named view, from where all that
    moves is in a picture of 16 to 9, as no player's camera goes with it.
    """
    footage = RecordedFootage(recording)
    motion = motion_of(footage)
    camera = _told(footage) or _view(footage, motion)
    height = _SIZE[1]
    eye = -camera.rotation.T @ camera.translation
    means = recording.reference.means[recording.moving]
    forward = camera.rotation[2]
    reach = max(float(forward @ (means.mean(axis=0) - eye)), 10 * camera.near)
    return {
        "position": eye.tolist(),
        "target": (eye + reach * forward).tolist(),
        "vertical_angle": math.degrees(2 * math.atan(height / 2 / camera.focal_y)),
        "reach": motion.reach,
    }


def _told(footage: RecordedFootage) -> Camera | None:
    """The scene's camera in the first frame, where its place is said and can be had; if it cannot, that is said."""
    choice = footage.camera
    if choice is None:
        return None
    try:
        found = told_cameras(footage, choice, [0], *_SIZE)
    except GaspError as error:
        _LOG.warning("it begins with a view of all that moves, and not with the scene's camera: %s", error)
        return None
    return found[0] if found else None


def _view(footage: RecordedFootage, motion: Motion) -> Camera:
    """From the side that the scene's view names, of all that moves."""
    told = footage.camera
    # Of a file the view is one of its cameras.
    view = told.view if told is not None and told.file is None else None
    width, height = _SIZE
    choice = with_side(CameraChoice(view=view, follow=False), motion, footage.colliders, width=width, height=height)
    try:
        renderer = open_renderer()
    except RenderingError:
        around, above = choice.direction
        return frame_motion(motion, width=width, height=height, around=around, above=above)
    (camera,) = cameras_for(
        footage,
        choice,
        motion=motion,
        subject=footage.subject,
        numbers=[0],
        renderer=renderer,
        width=width,
        height=height,
    )
    return camera
