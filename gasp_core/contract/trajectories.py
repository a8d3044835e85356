"""Where some of the points are at moments, whatever else acts on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.validation import frozen_array
from gasp_core.errors import SceneError

__all__ = ["Trajectories"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectories:
    """Prescribed displacements of some points; the matter around them is held by theirs as by a wall that moves.

    Between two moments a point goes along the cubic that has its places and its velocities at both. These are the
    slopes of the parabola through a moment and its two neighbours; at either end, through the three that are there.
    From the last moment on it rests.

    Parameters
    ----------
    rows : (K,)
        Of the points, rising.
    times : (T,) [s]
        Moments, rising; the first is 0.
    displacements : (T, K, 3) float32 [m]
        From `PointCloud.reference_positions`; zero at the first moment.

    Raises
    ------
    SceneError
        Where shapes disagree, a number is not finite, rows or times do not rise, or the points begin elsewhere.
    """

    rows: Array
    times: Array
    displacements: Array

    def __post_init__(self) -> None:
        rows = frozen_array(self, "rows", (None,), np.int64)
        times = frozen_array(self, "times", (None,), np.float64, what="moment")
        displacements = frozen_array(self, "displacements", (len(times), len(rows), 3), np.float32, what="moment")
        if not len(rows) or rows[0] < 0 or (np.diff(rows) <= 0).any():
            raise SceneError("Trajectories.rows must be rows of points, rising, at least one")
        if not len(times) or times[0] != 0 or (np.diff(times) <= 0).any():
            raise SceneError("Trajectories.times must rise from 0")
        if displacements[0].any():
            raise SceneError("Trajectories.displacements must be zero at the first moment: points begin where they are")

    def __len__(self) -> int:
        return len(self.rows)
