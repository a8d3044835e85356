"""A Blender soft body as a function: state and step in, state out.

A step is one frame, and one step of Blender's own integrator within it. That integrator is Heun's in name. What it
does, measured, is x1 = x + dt v1 and then x + dt (v1 + v2) / 2 with the mean of both forces in v2: symplectic Euler in
a uniform field, to the last digit, and for an oscillator a determinant of 1 - (w dt)^2 / 2, which damps and is stable
up to w dt = 2.

All is scaled: lengths by the voxels' size, times by the longest step ever taken. Blender's soft bodies ignore the
frame rate and take gravity for a thousandth of what it is; `speed` is the only clock they have, and it ends at 0.01.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_blender.meshes import mesh_object, weigh
from gasp_blender.states import SOFT_BODY, StateFiles
from gasp_blender.studio import evaluated, new_name, new_scene, quiet, remove_scene, studio

__all__ = ["SLOWEST", "SPRING", "SoftBody"]

Array = NDArray[Any]

_GRAVITY_SCALE = 1000.0
"""Blender's gravity of one accelerates a soft body by a thousandth."""
SLOWEST = 0.01
"""Least value of `speed`."""
_PULL = 2.0**-10
SPRING = float(np.float32(1) / (np.float32(1) - np.float32(_PULL)) - np.float32(1))
"""Force of a spring at a strain of one: p / (1 - p) of pull and push, with Blender's own rounding. Small, because
Blender's masses end at 5e4."""
_LAST_FRAME = 1_000_000
_SAME = 2.5e-7
"""Relative: steps that differ by the last two digits of float32 are one step."""


class SoftBody:
    """One object in a scene of its own.

    Parameters
    ----------
    places : (V, 3)
        At rest, in voxels.
    edges : (E, 2)
        Springs; each bears a force of `SPRING` at a strain of one.
    masses : (V,)
        Times the square of the unit of time, so that force over mass is in voxels per squared unit.
    gravity : (3,)
        In voxels per squared unit of time.
    """

    def __init__(self, places: Array, edges: Array, masses: Array, gravity: Array) -> None:
        with quiet():
            _, folder = studio()
            self._scene = new_scene()
            self._scene.gravity = (_GRAVITY_SCALE * gravity).tolist()
            self._object = mesh_object(self._scene, places, edges)
            modifier = self._object.modifiers.new("gasp", "SOFT_BODY")
            settings = modifier.settings
            settings.use_goal = False
            settings.use_edges = True
            settings.pull = settings.push = _PULL
            settings.mass = float(masses.max())
            settings.vertex_group_mass = weigh(self._object, masses / masses.max())
            # Left at their defaults these brake a free fall.
            settings.friction = settings.damping = 0.0
            # One step a frame, whatever Blender thinks of its error: a step that it repeats or adds shifts the clock.
            settings.step_min = settings.step_max = 1
            settings.error_threshold = 10.0
            cache = modifier.point_cache
            cache.frame_start, cache.frame_end = 0, _LAST_FRAME
            cache.use_disk_cache = True
            cache.name = new_name("soft")
        self._settings = settings
        self._files = StateFiles(folder=folder, name=cache.name, kind=SOFT_BODY)
        self._frame = 0
        self._shown: Array | None = None

    def step(self, state: Array, speed: float) -> Array:
        """State (V, 6) float32 after a step of `speed` units of time; `speed` >= SLOWEST."""
        with quiet():
            if self._shown is None or self._frame >= _LAST_FRAME or abs(self._settings.speed / speed - 1) > _SAME:
                self._begin(speed)
            if self._shown is None or self._shown.tobytes() != state.tobytes():
                self._files.write(self._frame, state)
                evaluated(self._scene, self._frame)
            evaluated(self._scene, self._frame + 1)
            self._files.forget(self._frame)
            self._frame += 1
            self._shown = self._files.read(self._frame)
        return self._shown.copy()

    def close(self) -> None:
        """Remove the scene and what it has written."""
        with quiet():
            remove_scene(self._scene)
            self._files.forget(self._frame)

    def _begin(self, speed: float) -> None:
        """Go back to the first frame, after which a setting may differ; the frame after it is one to be replaced."""
        self._files.forget(self._frame)
        self._settings.speed = speed
        self._shown = None
        for self._frame in (0, 1):
            evaluated(self._scene, self._frame)
