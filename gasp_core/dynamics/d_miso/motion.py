"""psi of a checkpoint: the simplices of its Gaussians over scene time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.dynamics.d_miso.checkpoint import Checkpoint
from gasp_core.games import edge_axes, to_simplices

__all__ = ["CheckpointMotion"]

Array = NDArray[Any]


class CheckpointMotion:
    """psi of a trained D-MiSo, in the frame and unit it was trained in.

    Vertices are those of the attached Gaussians where training has them at that time, not of the cores: that is what
    was trained and what is seen. Physics, which comes after, moves these vertices.

    Parameters
    ----------
    checkpoint
        Its times go from 0 to 1.
    duration
        Scene time [s] that they take.
    vertices
        Of a simplex, 3 or 4. With 3 the Gaussians at time 0 say which axis of each is left out.
    """

    def __init__(self, checkpoint: Checkpoint, duration: float, vertices: int) -> None:
        self._checkpoint = checkpoint
        self._duration = duration
        self._edges = edge_axes(checkpoint.at(0.0).scales, vertices)

    @property
    def span(self) -> tuple[float, float]:
        """See `SceneMotion`."""
        return 0.0, self._duration

    @property
    def step(self) -> float:
        """See `SceneMotion`.

        The highest frequency of the encoding is 512: over a hundred-thousandth its difference is off by 4e-6.
        """
        return 1e-5 * self._duration

    def __len__(self) -> int:
        return len(self._checkpoint)

    def simplices(self, time: float) -> Array:
        """See `SceneMotion`."""
        # A core without an edge at this time has no frame: its Gaussians are not finite, which is told with their rows.
        with np.errstate(divide="ignore", invalid="ignore"):
            tetrahedra = to_simplices(self._checkpoint.at(time / self._duration), 4)
        edges = np.take_along_axis(tetrahedra[:, 1:], self._edges[:, :, None], axis=1)
        return np.concatenate([tetrahedra[:, :1], edges], axis=1)
