"""One body of a moving splat, written frame by frame and held against what was recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.moving.bodies import Corrections, FreeBody, MovingBody
from gasp_core.moving.frames import FrameWriter, encoded_corrections
from gasp_core.moving.grains import PackedGrains
from gasp_core.reduction.grains import Grains

__all__ = ["BodyFrame", "BodyWriter"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFrame:
    """Of a body in a frame of a recording.

    Parameters
    ----------
    simplices : (N, 3 | 4, 3) [m]
        Of its Gaussians, rows as the body has them.
    displacements : (P, 3) [m]
        Of its points, less their mean.
    shift : (3,) [m]
        That mean.
    """

    simplices: Array
    displacements: Array
    shift: Array


@dataclass(slots=True, kw_only=True)
class BodyWriter:
    """Writes frames of one body, one after the other.

    Parameters
    ----------
    moving
        What a reader will have.
    rows : (N,)
        Which of the body's Gaussians each row of that is.
    held, recorded
        These at rest: as the file holds them, and as they were recorded.
    quantum, allowed
        Whole numbers are in steps of the one, and means may be off by the other [m].
    grains, start
        What it comes apart into where it flows, and where its points begin, (P, 3) [m].
    largest
        How far any mean of any frame is off by now [m].
    """

    moving: MovingBody
    rows: Array
    held: Gaussians
    recorded: Gaussians
    quantum: float
    allowed: float
    grains: Grains | None
    start: Array
    largest: float = 0.0
    _frames: FrameWriter = field(default_factory=FrameWriter)
    _flows: FrameWriter = field(default_factory=FrameWriter)

    def write(self, frame: BodyFrame) -> bytes:
        """The next frame.

        Raises
        ------
        ValueError
            Where a number is too large.
        """
        simplices = frame.simplices[self.rows]
        if isinstance(self.moving, FreeBody):
            numbers = self.moving.numbers_of(simplices, self.recorded, frame.shift, self.quantum)
        else:
            numbers = np.round(frame.displacements / self.quantum).astype(np.int64)
        found = self.moving.simplices(numbers, frame.shift, self.quantum)
        corrections = Corrections.of(found, simplices, self.held, self.recorded, self.quantum, self.allowed)
        written = frame.shift.astype("<f8").tobytes() + self._frames.write(numbers) + encoded_corrections(corrections)
        if self.grains is not None:
            flow = PackedGrains.numbers_of(self.grains, self.start + frame.displacements + frame.shift)
            written += self._flows.write(flow)
        found = corrections.applied(found, self.held, self.quantum)
        off = np.linalg.norm(found[:, 0] - simplices[:, 0], axis=1)
        self.largest = max(self.largest, float(off.max(initial=0.0)))
        return written
