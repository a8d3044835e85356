"""Where matter will probably go, from its first frame alone: a camera has to stand somewhere before the end."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, Drive, Driven, Impulse, Side
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.scene.file_shapes import FileShape
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import SplatObject

__all__ = ["Forecast"]

Array = NDArray[Any]

_POINTS = 200
"""Of an object, that may meet a collider."""
_STEP = 0.01
"""Longest step of the flight [s]."""
_STEPS = 2_000
"""Most of them: of a long run, the first seconds decide where things lie."""


class Forecast:
    """Frames of a run of which only the first is there: objects fly as stones do until they meet a collider.

    They neither turn, nor change shape, nor meet each other; what a drive holds goes with it.

    Parameters
    ----------
    footage
        With a first frame.
    scene
        That is run.
    count
        Frames there will be.
    """

    def __init__(self, footage: RecordedFootage, scene: Scene, count: int) -> None:
        self.path: Path = footage.path
        self.frame_count = count
        recording = footage.recording
        names = [entry.name for entry in recording.header.objects]
        self._start, self._movers, self._frame_rate = footage.matter(0), footage.movers, footage.frame_rate
        rows = np.flatnonzero(footage.in_subject)
        owner = np.full(len(footage.in_subject), -1)
        for number, entry in enumerate(recording.header.objects):
            owner[entry.first : entry.last] = number
        owner[~recording.moving] = -1
        self._owner = owner[rows]
        means = self._start.means
        self._shifts = np.zeros((len(names) + 1, count, 3))
        for item in scene.objects:
            number = names.index(item.name)
            own = means[self._owner == number]
            if len(own):
                self._shifts[number] = _flight(own, item, scene, count)

    def subject(self, frame: int) -> RenderInput:
        """What is to be in the picture."""
        return self._movers.joined(dataclasses.replace(self._start, means=self._means(frame)), frame / self._frame_rate)

    def positions(self, frame: int) -> Array:
        """Means of the subject."""
        return self._movers.beside(self._means(frame), frame / self._frame_rate)

    def _means(self, frame: int) -> Array:
        return self._start.means + self._shifts[self._owner, frame]


def _flight(means: Array, item: SplatObject, scene: Scene, count: int) -> Array:
    """How far an object has moved by each frame, (count, 3) [m]."""
    points = means[:: max(1, len(means) // _POINTS)]
    held = [
        drive
        for drive in scene.drives
        if not isinstance(drive, Impulse) and bool((drive.region.signed_distance(means) <= 0).any())
    ]
    walls = [one for one in scene.colliders if not isinstance(one.shape, FileShape)]
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    # What a file describes, and what another object is, is met somewhere: about its own height further down.
    lands = len(walls) < len(scene.colliders) or any(other.collider for other in scene.objects)
    deepest = float(np.ptp(points @ gravity)) / max(float(np.linalg.norm(gravity)), 1e-300) if lands else np.inf
    end = (count - 1) / scene.frame_rate
    steps = int(min(max(np.ceil(end / _STEP), 1), _STEPS))
    step = min(end / steps, 10 * _STEP) if end > 0 else 0.0
    shift, velocity = np.zeros(3), np.asarray(item.velocity, dtype=np.float64)
    course = [shift]
    for number in range(steps):
        time = number * step
        held_now = [drive for drive in held if drive.start <= time < drive.end]
        if held_now:
            velocity = _velocity_of(held_now[0])
            shift = shift + step * velocity
        else:
            velocity = velocity + step * gravity
            shift = shift + step * velocity
            for wall in walls:
                shift, velocity = _met(points, shift, velocity, wall, float(np.linalg.norm(gravity)) * step)
            if float(np.linalg.norm(shift)) > deepest:
                velocity = np.zeros(3)
                shift = shift * (deepest / float(np.linalg.norm(shift)))
        course.append(shift)
    frames = np.arange(count) / scene.frame_rate
    times = step * np.arange(steps + 1)
    return np.stack([np.interp(frames, times, column) for column in np.array(course).T], axis=1)


def _velocity_of(drive: Drive) -> Array:
    return np.asarray(drive.velocity) if isinstance(drive, Driven) else np.zeros(3)


def _met(points: Array, shift: Array, velocity: Array, wall: Collider, braked: float) -> tuple[Array, Array]:
    """Shift and velocity once the deepest point is out of a wall again; friction takes `braked` [m/s] times itself."""
    sign = -1.0 if wall.side is Side.INSIDE else 1.0
    places = points + shift
    distances = sign * wall.shape.signed_distance(places)
    k = int(distances.argmin())
    if distances[k] >= 0:
        return shift, velocity
    normal = sign * wall.shape.outward_normal(places[k : k + 1])[0]
    velocity = velocity - min(float(velocity @ normal), 0.0) * normal
    along = velocity - (velocity @ normal) * normal
    speed = float(np.linalg.norm(along))
    if speed > 0:
        velocity = velocity - min(1.0, wall.friction * braked / speed) * along
    return shift - distances[k] * normal, velocity
