"""From where something is shown: what the user says, else what its scene says, else a view of all the motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gasp_core.errors import RenderingError
from gasp_core.rendering.camera import Camera, look_at
from gasp_core.rendering.camera_files import choose, placed, read_cameras
from gasp_core.rendering.contract import SplatRenderer
from gasp_core.rendering.fitting import Subject, fitted, moving_cameras
from gasp_core.rendering.footage import Footage
from gasp_core.rendering.framing import Motion, frame_motion
from gasp_core.rendering.sides import follows
from gasp_core.scene.loading import load_camera
from gasp_core.scene.near_words import did_you_mean
from gasp_core.scene.settings import VIEWS, CameraChoice

__all__ = ["cameras_for", "read_choice", "told_cameras"]

_SMOOTHED = 0.2
"""Time [s] over which a camera that follows is smoothed: it is not to jump with what it films."""


def read_choice(text: str) -> CameraChoice:
    """What ``--camera`` names: one of `VIEWS`, a .toml with a ``[camera]``, or a camera file, a colon and which of its
    cameras.

    Raises
    ------
    RenderingError
        Where it is none of them.
    SceneError
        Where a .toml has no camera, or an impossible one.
    """
    if text in VIEWS:
        return CameraChoice(view=text)
    if text.endswith(".toml"):
        return load_camera(text)
    file, _, view = text.rpartition(":") if ".json:" in text else (text, "", "0")
    if not file.endswith(".json"):
        raise RenderingError(
            f'no view "{text}": choose one of {", ".join(VIEWS)}, or name a file: cameras.json:3, transforms.json,'
            f" camera.toml{did_you_mean(text, VIEWS)}"
        )
    return CameraChoice(file=Path(file), view=int(view) if view.isdigit() else view)


def cameras_for(
    footage: Footage,
    choice: CameraChoice,
    *,
    motion: Motion,
    subject: Subject,
    numbers: Sequence[int],
    shares: Sequence[float] | None = None,
    renderer: SplatRenderer,
    width: int,
    height: int,
) -> list[Camera]:
    """Cameras for as many pictures.

    Parameters
    ----------
    footage
        What is shown.
    choice
        A camera; of a view by its name the side is chosen before (`gasp_core.rendering.sides`).
    motion, subject
        What is to be in the picture, by numbers of frames.
    numbers
        Which frame each picture shows.
    shares
        Of a whole film, how much is before each picture, 0..1: so far has a camera turned; None: they are all of it.
    renderer
        Draws the subject's silhouettes.
    width, height [px]
        Of the pictures.

    Raises
    ------
    RenderingError
        Where a camera file cannot be read or has no such camera.
    RecordingError
        Where a camera file is in the frame of an object that is not there.
    """
    told = told_cameras(footage, choice, numbers, width, height)
    if told is not None:
        return told
    around, above = choice.direction
    follow = follows(choice, motion)
    if not (follow or choice.turns):
        camera = frame_motion(motion, width=width, height=height, around=around, above=above)
        return [fitted(camera, motion, subject, renderer)] * len(numbers)
    if shares is None:
        shares = [k / len(numbers) for k in range(len(numbers))]
    return moving_cameras(
        motion,
        numbers,
        subject,
        renderer,
        width=width,
        height=height,
        arounds=[around + 360.0 * choice.turns * share for share in shares],
        above=above,
        smoothed=_SMOOTHED * footage.frame_rate if follow else None,
    )


def told_cameras(
    footage: Footage, choice: CameraChoice, numbers: Sequence[int], width: int, height: int
) -> list[Camera] | None:
    """Cameras for as many pictures where a choice says their places, whatever is in them; None where it names a view.

    Raises
    ------
    RenderingError, RecordingError
        As of `cameras_for`.
    """
    if choice.file is not None:
        found = choose(read_cameras(choice.file), 0 if choice.view is None else choice.view, choice.file)
        return [placed(found.resized(width, height), footage.placement(choice.object))] * len(numbers)
    if choice.position is not None and choice.target is not None:
        eyes, targets = np.array([choice.position]), np.array([choice.target])
        return _standing(choice, eyes, targets, width, height) * len(numbers)
    if choice.path:
        times = np.array([number / footage.frame_rate for number in numbers])
        return _standing(choice, *_along(choice, times), width, height)
    return None


def _standing(choice: CameraChoice, eyes: np.ndarray, targets: np.ndarray, width: int, height: int) -> list[Camera]:
    return [
        look_at(eye, target, width=width, height=height, field_of_view=choice.field_of_view, near=1e-3)
        for eye, target in zip(eyes, targets)
    ]


def _along(choice: CameraChoice, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eyes and targets (N, 3) at times [s] of a path without corners, which never goes beyond its viewpoints."""
    # Slow to import.
    from scipy.interpolate import PchipInterpolator

    moments = np.array([point.time for point in choice.path])
    places = np.array([(*point.position, *point.target) for point in choice.path])
    if len(moments) > 1:
        places = PchipInterpolator(moments, places)(np.clip(times, moments[0], moments[-1]))
    else:
        places = np.repeat(places, len(times), axis=0)
    return places[:, :3], places[:, 3:]
