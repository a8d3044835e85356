"""A Blender simulation of vertices as a function: state and step in, state out."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from gasp_blender.bpy_runtime import evaluated, new_name, quiet, remove_scene, studio
from gasp_blender.point_cache import Kind, StateFiles

__all__ = ["SLOWEST", "Stepper"]

Array = NDArray[Any]

SLOWEST = 0.01
"""Least value of a soft body's clock."""
_LAST_FRAME = 1_000
"""Of the cache, which then begins anew. Beyond its end, at 250 by default, Blender shows the last state for ever and
says nothing; and every frame it looks through all of it, which with a million frames takes 4 ms."""
_SAME = 2.5e-7
"""Relative: steps that differ by the last two digits of float32 are one step."""


class Stepper:
    """One object in a scene of its own, stepped by one frame at a time.

    Parameters
    ----------
    scene
        That the object is in.
    modifier
        The simulation.
    clock
        The settings' property that says how much time a frame is.
    kind
        What the simulation keeps of a vertex.
    """

    def __init__(self, scene: Any, modifier: Any, clock: str, kind: Kind) -> None:
        _, folder = studio()
        cache = modifier.point_cache
        cache.frame_start, cache.frame_end = 0, _LAST_FRAME
        cache.use_disk_cache = True
        cache.name = new_name("gasp")
        self._scene = scene
        self._settings = modifier.settings
        self._clock = clock
        self._files = StateFiles(folder=folder, name=cache.name, kind=kind)
        self._frame = 0
        self._shown: Array | None = None

    def step(self, state: Array, duration: float) -> Array:
        """State (V, 6) float32, place and velocity, after a step of `duration` units of time, >= SLOWEST.

        Raises
        ------
        RuntimeError
            Where Blender did not simulate.
        """
        with quiet():
            same = abs(getattr(self._settings, self._clock) / duration - 1) <= _SAME
            if self._shown is None or not same or self._frame >= _LAST_FRAME:
                self._begin(duration)
            if self._shown is None or self._shown.tobytes() != state.tobytes():
                self._files.write(self._frame, state)
                evaluated(self._scene, self._frame)
            # Every frame, one after the other: Blender simulates no frame that does not follow the last one.
            evaluated(self._scene, self._frame + 1)
            # Blender looks for the last state but one, back to the first frame where there is none.
            self._files.forget(self._frame - 1)
            self._frame += 1
            self._shown = self._files.read(self._frame)
        return self._shown.copy()

    def close(self) -> None:
        """Remove the scene and what it has written."""
        with quiet():
            remove_scene(self._scene)
            self._forget()

    def _begin(self, duration: float) -> None:
        """Go back to the first frame, after which a setting may differ; the frame after it is one to be replaced."""
        self._forget()
        setattr(self._settings, self._clock, duration)
        self._shown = None
        for self._frame in (0, 1):
            evaluated(self._scene, self._frame)

    def _forget(self) -> None:
        for frame in (self._frame - 1, self._frame):
            self._files.forget(frame)
