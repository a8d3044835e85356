"""Cameras whose pictures a subject fills, by its silhouettes: standing, following it, going around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import SplatRenderer
from gasp_core.rendering.framing import Motion, as_near_as_may_be, direction, distance_for, framed, orbiting
from gasp_core.rendering.silhouettes import SAFE, Extent, Sight, outline, seen_from

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
    frames = extreme_frames(cameras[0], motion) if standing else list(motion.clouds())
    whole = _joined([seen_from(cameras[frame], outline(subject(frame)), renderer) for frame in frames])
    if whole is None or whole.well:
        return whole is not None
    # A needle that points at the camera cannot fill its picture: nothing of it may be behind the eye.
    return whole.reach <= SAFE and standing and as_near_as_may_be(cameras[0], motion.points)


def extreme_frames(camera: Camera, motion: Motion) -> list[int]:
    """Frames of a motion in which it comes farthest to one side of a camera's picture, or is largest."""
    clouds = motion.clouds()
    places = [camera.project(cloud)[0] for cloud in clouds.values()]
    lower, upper = (np.array([extreme(own, axis=0) for own in places]) for extreme in (np.min, np.max))
    chosen = {*lower.argmin(axis=0), *upper.argmax(axis=0), (upper - lower).max(axis=1).argmax()}
    return sorted(list(clouds)[k] for k in chosen)


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
    clouds = motion.clouds()
    nearest = [min(clouds, key=lambda frame: abs(frame - number)) for number in numbers]
    needed = np.array(
        [distance_for(clouds[frame], aim, toward, width, height) for frame, aim, toward in zip(nearest, aims, towards)]
    )
    distance = max(float(needed.max()), 0.1 * motion.reach)
    hardest = np.argsort(-needed, kind="stable")[:_HARDEST]
    shown = [outline(subject(numbers[k])) for k in hardest]
    for _ in range(_ROUNDS):
        cameras = [orbiting(aims[k], towards[k], distance, width, height) for k in hardest]
        sights = [seen_from(camera, splats, renderer) for camera, splats in zip(cameras, shown)]
        whole = _joined(sights)
        if whole is None or whole.well:
            break
        distance = max(
            distance_for(sight.places, aims[k], towards[k], width, height) for k, sight in zip(hardest, sights)
        )
    return [orbiting(aim, toward, distance, width, height) for aim, toward in zip(aims, towards)]


def _joined(sights: Sequence[Sight]) -> Extent | None:
    """What holds the extents of all of them; None where one saw nothing."""
    whole: Extent | None = None
    for sight in sights:
        if sight.extent is None:
            return None
        whole = sight.extent if whole is None else whole.joined(sight.extent)
    return whole


def _aims(motion: Motion, numbers: Sequence[int], smoothed: float | None) -> Array:
    """What each picture looks at, (pictures, 3)."""
    if smoothed is None:
        return np.tile(motion.centre, (len(numbers), 1))
    # Slow to import.
    from scipy.ndimage import gaussian_filter1d

    clouds = motion.clouds()
    middles = np.array([(cloud.min(axis=0) + cloud.max(axis=0)) / 2 for cloud in clouds.values()])
    course = np.arange(min(numbers), max(numbers) + 1)
    aims = np.stack([np.interp(course, list(clouds), column) for column in middles.T], axis=1)
    # Gone on with at either end as it goes there, so that what flies evenly is followed evenly to the last.
    room = min(int(4 * smoothed) + 1, len(course) - 1)
    aims = np.pad(aims, ((room, room), (0, 0)), mode="reflect", reflect_type="odd") if room else aims
    aims = gaussian_filter1d(aims, smoothed, axis=0, mode="nearest", truncate=4.0)
    return aims[room + np.asarray(numbers) - course[0]]
