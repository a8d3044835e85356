"""Frames as pictures: splats with the scenery behind and before them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.errors import RenderingError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import Picture, SplatRenderer
from gasp_core.rendering.footage import Footage
from gasp_core.rendering.framing import Motion
from gasp_core.rendering.scenery import draw_scenery
from gasp_core.rendering.shadows import Lamp, ShadowedScenery

__all__ = ["FramePainter", "parse_background", "to_bytes"]

Array = NDArray[Any]


class FramePainter:
    """Paints frames; scenery is cast anew only where the camera moves.

    Parameters
    ----------
    footage
        Frames.
    renderer
        Draws the splats.
    motion
        Where the matter goes: planes and shadows are drawn there.
    background : (3,)
        Colour 0..1 behind everything; None: transparent.
    colliders
        That are drawn; None: all of the footage.
    """

    def __init__(
        self,
        footage: Footage,
        renderer: SplatRenderer,
        *,
        motion: Motion,
        background: tuple[float, float, float] | None,
        colliders: tuple[Collider, ...] | None = None,
    ) -> None:
        self._footage = footage
        self._renderer = renderer
        self._motion = motion
        self._background = background
        self._colliders = footage.colliders if colliders is None else colliders
        self._camera: Camera | None = None
        self._scenery: ShadowedScenery | None = None
        self._lamp: Lamp | None = None

    def paint(self, frame: int, camera: Camera) -> Array:
        """A frame as bytes: (H, W, 3) uint8, (H, W, 4) with straight alpha where the background is transparent."""
        picture = self._picture(self._footage.drawn(frame), camera, frame / self._footage.frame_rate)
        if self._background is not None:
            return to_bytes(picture.over(np.asarray(self._background)))
        alpha = picture.alpha[:, :, None]
        straight = picture.colour / np.where(alpha > 0, alpha, 1.0)
        return to_bytes(np.concatenate([straight, alpha], axis=2))

    def _picture(self, splats: RenderInput, camera: Camera, time: float) -> Picture:
        if not self._colliders:
            return self._renderer.render(splats, camera)
        shadowed = self._scenery_from(camera, time)
        drawn = self._renderer.render(splats, camera, occluders=shadowed.scenery.depth)
        return drawn.before(shadowed.under(splats, self._renderer))

    def _scenery_from(self, camera: Camera, time: float) -> ShadowedScenery:
        colliders = self._colliders
        moves = any(collider.motion is not None for collider in colliders)
        if self._scenery is None or camera is not self._camera or moves:
            motion = self._motion
            if self._lamp is None or moves:
                self._lamp = Lamp.of(colliders, motion, time)
            lamp, middle = self._lamp.camera.position, motion.centre
            scenery = draw_scenery(colliders, camera, centre=middle, reach=motion.reach, time=time, lamp=lamp)
            self._scenery = ShadowedScenery.of(scenery, camera, self._lamp)
            self._camera = camera
        return self._scenery


def to_bytes(values: Array) -> Array:
    """Display values 0..1 as uint8, rounded; what is outside is cut off."""
    return (np.clip(values, 0.0, 1.0) * 255 + 0.5).astype(np.uint8)


def parse_background(text: str) -> tuple[float, float, float] | None:
    """A colour name or #rrggbb as 0..1; None for "transparent".

    Raises
    ------
    RenderingError
        Where it is neither.
    """
    if text == "transparent":
        return None
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError:
        raise RenderingError(
            f'background "{text}" is no colour: a name (white, black, gray), #rrggbb, or transparent'
        ) from None
    return (red / 255, green / 255, blue / 255)
