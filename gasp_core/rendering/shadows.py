"""The shadow that splats cast on the scenery: without it nothing seems to stand on the ground.

That of colliders is part of the scenery as it is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.contract import Picture, SplatRenderer
from gasp_core.rendering.framing import Motion
from gasp_core.rendering.scenery import LIGHT, Scenery, nearest_hits

__all__ = ["Lamp", "ShadowedScenery"]

Array = NDArray[Any]

_SIDE = 256
_LARGEST_SIDE = 1024
"""Of a map [px]; of what goes several times as far as it is large it shows more, for shadows that are as sharp."""
_WIDTH = 1.4
"""Of the map in sizes of the motion: Gaussians have a size of their own, and what casts must not be cut off."""
_FAR = 30.0
"""Distance of the lamp in sizes of the motion: its rays are nearly parallel."""
_SOFTNESS = 2.0
"""Blur of the shadow [px of its map]: a map's pixels would show otherwise."""
_OUTSIDE = -1e6
"""A place in no picture: there is no shadow beyond the map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamp:
    """What casts shadows: it is the same for all cameras.

    Parameters
    ----------
    camera
        That looks from the lamp.
    lit : (h, w)
        Depth at which its light meets the scenery: what is behind it casts no shadow.
    """

    camera: Camera
    lit: Array

    @classmethod
    def of(cls, colliders: Sequence[Collider], motion: Motion, time: float = 0.0) -> Lamp:
        """A lamp that sees all of a motion, among colliders at a time [s]."""
        camera = _looking_down(motion)
        lit = nearest_hits(colliders, camera.position, camera.rays(), time).depth
        return cls(camera=camera, lit=lit)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowedScenery:
    """Scenery seen from one camera, and where each of its pixels is seen by the lamp.

    Parameters
    ----------
    scenery
        Without the shadow of splats.
    lamp
        That shines on it.
    places : (2, H, W) float32 [px]
        Down and across in the lamp's picture, from the middle of its first pixel; far outside where there is none.
    """

    scenery: Scenery
    lamp: Lamp
    places: Array

    @classmethod
    def of(cls, scenery: Scenery, camera: Camera, lamp: Lamp) -> ShadowedScenery:
        """From the scenery that a camera sees."""
        eye = lamp.camera
        places = np.empty((2, *scenery.depth.shape), np.float32)
        # From the camera's frame to the lamp's: turn @ depth (x / z, y / z, 1) + shift.
        turn = eye.rotation @ camera.rotation.T
        shift = eye.rotation @ camera.position + eye.translation
        for rows in camera.bands():
            depth = scenery.depth[rows].astype(np.float64)
            depth[~np.isfinite(depth)] = 0.0
            x, y = camera.slopes(rows)
            across, down, ahead = (s + depth * (t[0] * x + (t[1] * y + t[2])) for t, s in zip(turn, shift))
            # The ground goes on behind the lamp, and at the horizon there is none.
            met = (depth > 0) & (ahead > eye.near)
            ahead[~met] = 1.0
            # Pixel k's centre is at k + 1/2.
            places[0, rows] = np.where(met, eye.focal_y * down / ahead + eye.center_y - 0.5, _OUTSIDE)
            places[1, rows] = np.where(met, eye.focal_x * across / ahead + eye.center_x - 0.5, _OUTSIDE)
        return cls(scenery=scenery, lamp=lamp, places=places)

    def under(self, splats: RenderInput, renderer: SplatRenderer) -> Picture:
        """The scenery with the shadow of splats on it."""
        # Slow to import.
        from scipy.ndimage import gaussian_filter, map_coordinates

        cast = gaussian_filter(renderer.render(splats, self.lamp.camera, occluders=self.lamp.lit).alpha, _SOFTNESS)
        shade = map_coordinates(cast, self.places, order=1, mode="constant", cval=0.0, prefilter=False)
        return replace(self.scenery, colour=self.scenery.colour * (1 - self.scenery.lamplight * shade)[:, :, None])


def _looking_down(motion: Motion) -> Camera:
    direction = LIGHT / np.linalg.norm(LIGHT)
    distance = _FAR * motion.reach
    side = min(round(_SIDE * max(motion.reach / max(motion.size, 1e-9 * motion.reach), 1.0)), _LARGEST_SIDE)
    return look_at(
        motion.centre + distance * direction,
        motion.centre,
        width=side,
        height=side,
        field_of_view=math.degrees(2 * math.atan(0.5 * _WIDTH / _FAR)),
        near=1e-3 * distance,
    )
