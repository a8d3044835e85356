"""What an object's place, its turn and how far it goes are measured by."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.recording.reader import Recording

__all__ = ["places_at", "places_at_start"]

Array = NDArray[Any]


def places_at_start(recording: Recording) -> dict[str, Array]:
    """Places (M, 3) [m] of every object that moves, before it does, by name: the engine's points; of what moves by
    itself as well the middles of its Gaussians, as it is not seen where points alone are.
    """
    start, means = recording.start_points, recording.reference.means
    return {
        body.name: means[body.rows].astype(np.float64) if entry.drifts else start[body.points]
        for body, entry in zip(recording.bodies, recording.header.bodies)
    }


def places_at(recording: Recording, frame: int, names: Collection[str]) -> dict[str, Array]:
    """The same of the objects of these names, in the same order, in a frame.

    Raises
    ------
    RecordingError
        Where there is no such frame, or it is damaged.
    """
    wanted = [pair for pair in zip(recording.bodies, recording.header.bodies) if pair[0].name in names]
    points = recording.points(frame)
    # Simplices are those of all Gaussians, a hundred times as many as points.
    seen = recording.simplices(frame) if any(entry.drifts for _, entry in wanted) else {}
    return {body.name: seen[body.name][:, 0] if entry.drifts else points[body.points] for body, entry in wanted}
