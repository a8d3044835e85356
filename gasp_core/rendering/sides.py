"""From which side to look where nobody has said: the one from which less is hidden behind what stands there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, HalfSpace
from gasp_core.rendering.framing import Motion, direction, distance_for, frame_motion
from gasp_core.rendering.scenery import nearest_hits
from gasp_core.scene.settings import CameraChoice

__all__ = ["LEFT", "RIGHT", "follows", "hidden_share", "side_told", "with_side"]

Array = NDArray[Any]

RIGHT, LEFT = "three-quarter", "three-quarter-left"
"""Views that are chosen from; the first is the usual one."""
_FAR = 5.0
"""Times its own size that something has to go for the camera to go with it."""
_LESS = 0.02
"""Share of all points that has to be hidden less from the other side: with as many points as are looked at, their
sampling alone makes one of a percent."""
_FRAMES = 24
_POINTS = 200
"""Of a frame."""
_INTO = 0.02
"""Of the size of what moves: matter so far behind a surface is not hidden, it is pressed into what it meets."""


def follows(choice: CameraChoice, motion: Motion) -> bool:
    """Whether the camera of a view by its name goes along with what moves."""
    return motion.reach > _FAR * motion.size if choice.follow is None else choice.follow


def with_side(
    choice: CameraChoice,
    motion: Motion,
    colliders: Sequence[Collider],
    *,
    width: int,
    height: int,
    usual: str = RIGHT,
) -> CameraChoice:
    """The choice with a view by its name: one side for all of a film, as what moves would jump otherwise.

    Parameters
    ----------
    choice
        Comes back as it is where it says a view or a place, or goes around.
    motion
        What is to be in the picture.
    colliders
        Those that stand still may hide it.
    width, height [px]
        Of a picture.
    usual
        Of `RIGHT` and `LEFT` the one that is taken unless noticeably less is hidden from the other one.
    """
    if choice.view is not None or not choice.sees_all or choice.turns:
        return choice
    # From the side on which matter may be, a plane hides nothing of it, and from the other side it is not there.
    standing = [one for one in colliders if one.motion is None and not isinstance(one.shape, HalfSpace)]
    view = usual
    if standing:
        other = LEFT if usual == RIGHT else RIGHT
        shares = [
            hidden_share(replace(choice, view=name), motion, standing, width=width, height=height)
            for name in (usual, other)
        ]
        view = other if shares[1] < shares[0] - _LESS else usual
    return replace(choice, view=view)


def hidden_share(
    choice: CameraChoice, motion: Motion, colliders: Sequence[Collider], *, width: int, height: int
) -> float:
    """Share of a motion's points that a view by its name does not see for colliders, 0..1.

    Parameters
    ----------
    choice
        A view by its name.
    motion
        Of which points of some frames are looked at.
    colliders
        That stand still.
    width, height [px]
        Of a picture.
    """
    clouds = list(motion.clouds().values())
    clouds = [
        clouds[k] for k in np.unique(np.linspace(0, len(clouds) - 1, min(len(clouds), _FRAMES)).round().astype(int))
    ]
    around, above = choice.direction
    if follows(choice, motion):
        toward = direction(around, above)
        middles = [(cloud.min(axis=0) + cloud.max(axis=0)) / 2 for cloud in clouds]
        distance = max(distance_for(cloud, aim, toward, width, height) for cloud, aim in zip(clouds, middles))
        eyes = [aim + distance * toward for aim in middles]
    else:
        eyes = [frame_motion(motion, width=width, height=height, around=around, above=above).position] * len(clouds)
    into = _INTO * motion.size
    hidden = []
    for cloud, eye in zip(clouds, eyes):
        ways = cloud[:: max(1, len(cloud) // _POINTS)] - eye
        met = nearest_hits(colliders, eye, ways).depth
        hidden.append(met < 1 - into / np.linalg.norm(ways, axis=1))
    return float(np.concatenate(hidden).mean())


def side_told(said: CameraChoice | None, taken: CameraChoice) -> str:
    """A line that says which side was taken; none where it is the usual one, or was asked for."""
    if taken.view != LEFT or (said is not None and said.view is not None):
        return ""
    return f'seen from the left (view "{LEFT}"): from the right ("{RIGHT}") colliders would hide more of what moves'
