"""One body of a moving splat, written frame by frame and held against what was recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.moving.bodies import Corrections, FreeBody, MovingBody
from gasp_core.moving.frames import CorrectionWriter, FrameWriter
from gasp_core.moving.grains import PackedGrains
from gasp_core.moving.settling import near_enough
from gasp_core.reduction.grains import Flow, Grains
from gasp_core.reduction.point_frames import PointFrames

__all__ = ["BodyFrame", "BodyWriter"]

Array = NDArray[Any]

_STAYS = 3**0.5 / 2
"""Quanta that a point may be off by, as it may by rounding."""
_SHIFT_STAYS = 16
"""Quanta that the mean displacement may have gone on before the one that is written follows."""


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
    _frames: FrameWriter = field(init=False)
    _flows: FrameWriter = field(init=False)
    _corrections: CorrectionWriter = field(init=False)
    _shift: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        self._frames = FrameWriter(self.moving.numbers)
        self._flows = FrameWriter((self.moving.numbers[0], 2))
        self._corrections = CorrectionWriter(len(self.rows))

    def write(self, frame: BodyFrame) -> bytes:
        """The next frame.

        Raises
        ------
        ValueError
            Where a number is too large.
        """
        simplices = frame.simplices[self.rows]
        filled = getattr(self.moving, "carrier", None)
        flowed, shown, chosen = b"", np.ones(len(self.rows), dtype=bool), np.zeros(0, dtype=np.int64)
        if self.grains is not None:
            assert isinstance(filled, PointFrames)
            flow = self.grains.flow(self.start + frame.displacements + frame.shift)
            chosen = flow.chosen
            flowed, shown = self._flow(flow, filled)
        shift = self._shift_of(frame.shift)
        if isinstance(self.moving, FreeBody):
            exact = self.moving.numbers_of(simplices, self.recorded, shift, self.quantum)
            written, numbers = self._frames.write(lambda _: exact)
        else:
            wanted = (frame.displacements + (frame.shift - shift)) / self.quantum
            # What swings is foretold best from numbers that are exact; grains lie where they are.
            slack = np.full(len(wanted), 0.0 if self.grains is None else _STAYS)
            if isinstance(filled, PointFrames):
                slack[~_seen(filled, shown, chosen)] = np.inf
            written, numbers = self._frames.write(lambda foretold: near_enough(foretold, wanted, slack))
        found = self.moving.simplices(numbers, shift, self.quantum)
        last = self._corrections.last
        corrections = Corrections.of(
            found, simplices, self.held, self.recorded, self.quantum, self.allowed, shown, last
        )
        found = corrections.applied(found, self.held, self.quantum)
        off = found[shown, 0] - simplices[shown, 0]
        if len(chosen):
            off = np.append(
                off, numbers[chosen] * self.quantum - frame.displacements[chosen] + (shift - frame.shift), axis=0
            )
        self.largest = max(self.largest, float(np.linalg.norm(off, axis=1).max(initial=0.0)))
        return shift.astype("<f8").tobytes() + written + self._corrections.write(corrections) + flowed

    def _shift_of(self, mean: Array) -> Array:
        """The mean displacement that is written, (3,) [m].

        What stays whole drifts as a whole; grains lie where they are while others move the mean.
        """
        if self.grains is None:
            return mean
        if np.abs(mean - self._shift).max() > _SHIFT_STAYS * self.quantum:
            self._shift = np.round(mean / self.quantum) * self.quantum
        return self._shift

    def _flow(self, flow: Flow, filled: PointFrames) -> tuple[bytes, Array]:
        """How far matter has flowed, written, and of which Gaussians (N,) anything is left to be seen."""
        exact = PackedGrains.numbers_of(flow)
        written, numbers = self._flows.write(
            lambda foretold: PackedGrains.near_enough(foretold, exact, flow.chosen, filled.followed)
        )
        return written, PackedGrains.left(numbers, filled.labels) > 0


def _seen(filled: PointFrames, shown: Array, chosen: Array) -> Array:
    """Which points (P,) tell where what is seen is: Gaussians shown, (N,), and grains of chosen points, (C,)."""
    followed = np.zeros(len(filled.points), dtype=bool)
    followed[filled.labels[shown]] = True
    needed = followed.copy()
    needed[filled.neighbours[followed]], needed[chosen] = True, True
    return needed
