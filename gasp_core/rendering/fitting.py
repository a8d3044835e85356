"""Cameras whose pictures a subject fills, by its silhouettes: standing, following it, going around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import SplatRenderer
from gasp_core.rendering.framing import Motion, direction, distance_for, framed, orbiting
from gasp_core.rendering.silhouettes import Extent, Sight, outline, seen_from

__all__ = ["Subject", "extreme_frames", "fitted", "moving_cameras", "well_framed"]

Array = NDArray[Any]
Subject = Callable[[int], RenderInput]
"""What is to be in the picture, by the number of a frame."""

_ROUNDS = 4
_HARDEST = 4
"""Pictures of a camera that moves in which the subject is measured: those that it takes most of."""


def fitted(camera: Camera, motion: Motion, subject: Subject, renderer: SplatRenderer) -> Camera:
    """The camera, moved so that a subject fills the middle of its picture, and nothing of it is ever outside.

    Parameters
    ----------
    camera
        Looks at the motion; its direction stays.
    motion
        Where the subject goes.
    subject
        By the numbers in `motion.frames`.
    renderer
        Draws its silhouettes.
    """
    shown = [outline(subject(frame)) for frame in extreme_frames(camera, motion)]
    for _ in range(_ROUNDS):
        sights = [seen_from(camera, splats, renderer) for splats in shown]
        whole = _joined(sights)
        if whole is None or whole.well:
            break
        places = np.concatenate([sight.places for sight in sights])
        camera = framed(places, -camera.rotation[2], width=camera.width, height=camera.height)
    return camera


def well_framed(cameras: Sequence[Camera], motion: Motion, subject: Subject, renderer: SplatRenderer) -> bool:
    """Whether a subject was wholly in all pictures, and large in them as far as its motion lets it be.

    Parameters
    ----------
    cameras
        Of the frames, by their numbers; one that stands is the same all the time.
    motion, subject, renderer
        As in `fitted`.
    """
    standing = all(camera is cameras[0] for camera in cameras)
    frames = extreme_frames(cameras[0], motion) if standing else [int(frame) for frame in np.unique(motion.frames)]
    whole = _joined([seen_from(cameras[frame], outline(subject(frame)), renderer) for frame in frames])
    return whole is not None and whole.well


def extreme_frames(camera: Camera, motion: Motion) -> list[int]:
    """Frames of a motion in which it comes farthest to one side of a camera's picture, or is largest."""
    frames = np.unique(motion.frames)
    extents = np.array([_extent(camera.project(motion.points[motion.frames == frame])[0]) for frame in frames])
    size = (extents[:, 2:] - extents[:, :2]).max(axis=1)
    chosen = {*extents[:, :2].argmin(axis=0), *extents[:, 2:].argmax(axis=0), size.argmax()}
    return sorted(int(frames[k]) for k in chosen)


def moving_cameras(
    motion: Motion,
    numbers: Sequence[int],
    subject: Subject,
    renderer: SplatRenderer,
    *,
    width: int,
    height: int,
    arounds: Sequence[float],
    above: float,
    smoothed: float | None,
) -> list[Camera]:
    """Cameras for as many pictures, all as far from what they look at.

    Parameters
    ----------
    motion
        Where the subject goes.
    numbers
        Which frame each picture shows.
    subject
        By these numbers.
    renderer
        Draws its silhouettes.
    width, height [px]
        Of a picture.
    arounds, above [degrees]
        From where each looks.
    smoothed [frames]
        Follow the subject, over about so long; None: look at the middle of all of its motion.
    """
    towards = [direction(around, above) for around in arounds]
    aims = _aims(motion, numbers, smoothed)
    known = np.unique(motion.frames)
    nearest = known[np.abs(known[None, :] - np.asarray(numbers)[:, None]).argmin(axis=1)]
    clouds = {int(frame): motion.points[motion.frames == frame] for frame in known}
    needed = np.array(
        [
            distance_for(clouds[int(frame)], aim, toward, width, height)
            for frame, aim, toward in zip(nearest, aims, towards)
        ]
    )
    distance = max(float(needed.max()), 0.1 * motion.reach)
    hardest = np.argsort(-needed, kind="stable")[:_HARDEST]
    shown = [outline(subject(numbers[k])) for k in hardest]
    for _ in range(_ROUNDS):
        nearest, whole = 0.0, None
        for k, splats in zip(hardest, shown):
            sight = seen_from(orbiting(aims[k], towards[k], distance, width, height), splats, renderer)
            if sight.extent is not None:
                nearest = max(nearest, distance_for(sight.places, aims[k], towards[k], width, height))
                whole = sight.extent if whole is None else whole.joined(sight.extent)
        if whole is None or whole.well:
            break
        distance = nearest
    return [orbiting(aim, toward, distance, width, height) for aim, toward in zip(aims, towards)]


def _joined(sights: Sequence[Sight]) -> Extent | None:
    """What holds the extents of all of them; None where one saw nothing."""
    whole: Extent | None = None
    for sight in sights:
        if sight.extent is None:
            return None
        whole = sight.extent if whole is None else whole.joined(sight.extent)
    return whole


def _extent(places: Array) -> Array:
    """Left, upper, right, lower (4,) of places (N, 2)."""
    return np.concatenate([places.min(axis=0), places.max(axis=0)])


def _aims(motion: Motion, numbers: Sequence[int], smoothed: float | None) -> Array:
    """What each picture looks at, (pictures, 3)."""
    if smoothed is None:
        return np.tile(motion.centre, (len(numbers), 1))
    # Slow to import.
    from scipy.ndimage import gaussian_filter1d

    known = np.unique(motion.frames)
    clouds = [motion.points[motion.frames == frame] for frame in known]
    middles = np.array([(cloud.min(axis=0) + cloud.max(axis=0)) / 2 for cloud in clouds])
    course = np.arange(min(numbers), max(numbers) + 1)
    aims = np.stack([np.interp(course, known, column) for column in middles.T], axis=1)
    # Gone on with at either end as it goes there, so that what flies evenly is followed evenly to the last.
    room = min(int(4 * smoothed) + 1, len(course) - 1)
    aims = np.pad(aims, ((room, room), (0, 0)), mode="reflect", reflect_type="odd") if room else aims
    aims = gaussian_filter1d(aims, smoothed, axis=0, mode="nearest", truncate=4.0)
    return aims[room + np.asarray(numbers) - course[0]]
