"""Where whoever plays a moving splat begins to look from."""

from __future__ import annotations

import math
from typing import Any

from gasp_core.errors import RenderingError
from gasp_core.recording import Recording
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import frame_motion, motion_of
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.viewpoints import cameras_for
from gasp_core.scene.settings import CameraChoice

__all__ = ["camera_of"]

_SIZE = 1280, 720


def camera_of(recording: Recording) -> dict[str, Any]:
    """Where a player begins: where the scene's camera stands, or where all that moves is in a picture of 16 to 9."""
    width, height = _SIZE
    footage = RecordedFootage(recording)
    motion = motion_of(footage)
    told = footage.camera
    choice = told if told is not None and told.position is not None else CameraChoice(follow=False)
    try:
        renderer = open_renderer()
    except RenderingError:
        around, above = choice.direction
        camera = frame_motion(motion, width=width, height=height, around=around, above=above)
    else:
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
