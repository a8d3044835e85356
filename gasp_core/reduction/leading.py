"""Driven parts of objects that move by themselves: where their motion takes the engine's points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Trajectories
from gasp_core.dynamics.composition import PrescribedMotion
from gasp_core.errors import SceneError
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.scene.model import Scene
from gasp_core.scene.selection import PlacedObject

__all__ = ["Lead", "driven_gaussians", "refuse_too_large", "trajectories_at_rest", "trajectories_of"]

Array = NDArray[Any]

_MOST_BYTES = 4 * 2**30
"""Of a table of trajectories."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """What drives points of a body.

    Parameters
    ----------
    motion
        Of all its Gaussians.
    carrier
        Of its points.
    rest : (N, V, 3) [m]
        Its simplices at the start.
    rows : (K,)
        The driven ones of its points.
    first
        Its first point among all.
    """

    motion: PrescribedMotion
    carrier: TransferOperator
    rest: Array
    rows: Array
    first: int

    def __post_init__(self) -> None:
        if not len(self.rows):
            raise SceneError(
                f'object "{self.motion.played.name}": its driven parts have none of its points, they are finer than'
                " what is simulated: make them larger, or the resolution finer"
            )


def driven_gaussians(placed: PlacedObject) -> Array:
    """Rows (M,) of the moving Gaussians of an object that are in driven parts."""
    driven = [index for index, part in enumerate(placed.item.parts) if part.driven]
    return np.flatnonzero(np.isin(placed.part_numbers[placed.moving], driven))


def trajectories_at_rest(leads: Sequence[Lead]) -> Trajectories | None:
    """Those that stay where they begin; None where nothing is driven."""
    if not leads:
        return None
    rows = _rows(leads)
    return Trajectories(rows=rows, times=np.zeros(1), displacements=np.zeros((1, len(rows), 3)))


def trajectories_of(scene: Scene, leads: Sequence[Lead], watch: Callable[[int, int], None]) -> Trajectories:
    """Where motions take the points, at the moments of all frames and of one more.

    That one decides nothing but the slope at the last frame: a run that is made longer goes on as it was. `watch` is
    told of each frame, and how many there are.

    Raises
    ------
    SceneError
        Where the table would be too large, or there is no motion to be had.
    """
    refuse_too_large(leads, scene.frame_count)
    times = np.array([scene.time_of(frame) for frame in range(scene.frame_count + 1)])
    rows = _rows(leads)
    followers = [lead.carrier.follower(lead.rest) for lead in leads]
    displacements = np.zeros((len(times), len(rows), 3), dtype=np.float32)
    for frame in range(1, len(times)):
        watch(frame, len(times) - 1)
        moved = [
            follow(lead.motion.displacements(float(times[frame])))[lead.rows] for lead, follow in zip(leads, followers)
        ]
        displacements[frame] = np.concatenate(moved)
    return Trajectories(rows=rows, times=times, displacements=displacements)


def refuse_too_large(leads: Sequence[Lead], frames: int) -> None:
    """Refuse what would be a table of trajectories that nobody could hold.

    Raises
    ------
    SceneError
        With how large it would be.
    """
    count = sum(len(lead.rows) for lead in leads)
    size = (frames + 1) * count * 12
    if size > _MOST_BYTES:
        raise SceneError(
            f"{count:,} driven points over {frames:,} frames are {size / 2**30:.1f} GiB:"
            ' say reduction = { mode = "cores" }, or simulate fewer frames'
        )


def _rows(leads: Sequence[Lead]) -> Array:
    return np.concatenate([lead.first + lead.rows for lead in leads])
