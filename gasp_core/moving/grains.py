"""Grains of what has flowed, in a moving splat: where they lie about their points, and what is seen of them in a frame.

`gasp_core.reduction.grains` says what they are. A file knows of every point, a frame, how far its matter has flowed,
and how much wider its grains are than at rest; the rest is decided once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gasp_core.io.activations import colour_to_dc, dc_to_colour
from gasp_core.moving.integers import decoded, encoded
from gasp_core.reduction.grains import Flow, Grains

__all__ = ["COLOURS", "GRAINS", "GrainState", "PackedGrains"]

Array = NDArray[Any]

GRAINS, COLOURS = "grains", "grain_colours"
"""Files of a body."""
_FLOW_STEPS = 63
"""Of how far matter has flowed, and of how much wider grains are, up to twice as wide."""
_BURIED = 64
"""In the place of the width: grains that nobody sees."""
_OFFSET_STEPS = 32
"""Of the spacing of points."""
_MOST = 1 << 22


@dataclass(frozen=True, slots=True, kw_only=True)
class GrainState:
    """Grains in a frame, and what is left of the Gaussians that follow their points.

    Parameters
    ----------
    left : (N,)
        Of each Gaussian of the body, how much of its opacity it keeps, 0..1.
    means : (G, 3) [m]
    scales : (G,) [m]
    opacities : (G,)
    colours : (G, 3)
        Constant coefficients in the 3DGS basis.
    points : (G,)
        The point that each is about.
    """

    left: Array
    means: Array
    scales: Array
    opacities: Array
    colours: Array
    points: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedGrains:
    """What the points of a body may come apart into, as a file has it.

    Parameters
    ----------
    offsets : (P, M, 3) [m]
        Of M grains from each point.
    colours : (P, 3)
        On the screen, 0..1.
    opacities : (P,)
        Of grains of matter that has flowed.
    scale
        Standard deviation of a grain [m].
    labels : (N, K)
        The points that each Gaussian of the body follows.
    """

    offsets: Array
    colours: Array
    opacities: Array
    scale: float
    labels: Array

    @property
    def most(self) -> int:
        """How many there are when all has flowed."""
        return self.offsets.shape[0] * self.offsets.shape[1]

    @staticmethod
    def files_of(grains: Grains) -> dict[str, bytes]:
        """Files by their names."""
        points, count, _ = grains.offsets.shape
        offsets = np.round(grains.offsets * (_OFFSET_STEPS / grains.carrier.spacing)).astype(np.int64)
        shown = np.clip(dc_to_colour(grains.colours), 0.0, 1.0)
        seen = np.column_stack([shown, grains.opacities])
        return {
            GRAINS: encoded(offsets.reshape(points, 3 * count)),
            COLOURS: encoded(np.round(255 * seen).astype(np.int64)),
        }

    @classmethod
    def of(
        cls, files: Mapping[str, bytes], *, points: int, count: int, scale: float, spacing: float, labels: Array
    ) -> Self:
        """From what `files_of` gave.

        Raises
        ------
        ValueError, KeyError
            Where they are damaged, or of more than anybody draws.
        """
        if points * count > _MOST:
            raise ValueError(f"{points * count:,} grains, {_MOST:,} are the most")
        offsets, rest = decoded(memoryview(files[GRAINS]), points, 3 * count)
        seen, more = decoded(memoryview(files[COLOURS]), points, 4)
        if len(rest) or len(more) or seen.min(initial=0) < 0 or seen.max(initial=0) > 255:
            raise ValueError("its grains are no grains")
        return cls(
            offsets=offsets.reshape(points, count, 3) * (spacing / _OFFSET_STEPS),
            colours=seen[:, :3] / 255,
            opacities=seen[:, 3] / 255,
            scale=scale,
            labels=labels,
        )

    @staticmethod
    def numbers_of(flow: Flow) -> Array:
        """The whole numbers of a frame, (P, 2), in which matter has flowed so far."""
        numbers = np.zeros((len(flow.share), 2), dtype=np.int64)
        # What has hardly begun to flow is there as well: rounded to nothing it would not be.
        numbers[:, 0] = np.ceil(_FLOW_STEPS * flow.share)
        numbers[:, 1] = np.where(numbers[:, 0] > 0, _BURIED, 0)
        numbers[flow.chosen, 1] = np.round(_FLOW_STEPS * np.clip(flow.wider - 1, 0, 1))
        return numbers

    @staticmethod
    def near_enough(foretold: Array, numbers: Array, chosen: Array, followed: Array) -> Array:
        """What is foretold, (P, 2), where nobody sees that it is not the `numbers` (P, 2), these elsewhere.

        A step more or less is not seen, nor how far a point has flowed that is buried and that no Gaussian follows.

        Parameters
        ----------
        foretold, numbers : (P, 2)
        chosen : (C,)
            The points whose grains are seen.
        followed : (F,)
            The points that Gaussians follow.
        """
        off = np.abs(foretold - numbers)
        shown, seen = np.zeros((2, len(numbers)), dtype=bool)
        shown[chosen], seen[followed] = True, True
        hidden = (foretold[:, 0] == 0) | (foretold[:, 1] == _BURIED)
        near = np.where(shown, off.max(axis=1) <= 1, (off[:, 0] <= 1) | ~seen)
        known = (foretold >= 0).all(axis=1) & (foretold[:, 0] <= _FLOW_STEPS) & (foretold[:, 1] <= _BURIED)
        return np.where((near & known & (hidden != shown))[:, None], foretold, numbers)

    @staticmethod
    def left(numbers: Array, labels: Array) -> Array:
        """What is left of the opacity of each Gaussian, (N,), that follows these points, (N, K)."""
        return 1 - numbers[:, 0][labels].max(axis=1) / _FLOW_STEPS

    def at(self, numbers: Array, positions: Array) -> GrainState:
        """A frame, from its whole numbers (P, 2) and where the points are (P, 3) [m].

        Raises
        ------
        ValueError
            Where they are none.
        """
        if (
            numbers.min(initial=0) < 0
            or numbers[:, 0].max(initial=0) > _FLOW_STEPS
            or numbers[:, 1].max(initial=0) > _BURIED
        ):
            raise ValueError("grains are damaged")
        share = numbers[:, 0] / _FLOW_STEPS
        chosen = np.flatnonzero((numbers[:, 0] > 0) & (numbers[:, 1] < _BURIED))
        wider, count = 1 + numbers[chosen, 1] / _FLOW_STEPS, self.offsets.shape[1]
        return GrainState(
            left=self.left(numbers, self.labels),
            means=(positions[chosen, None] + wider[:, None, None] * self.offsets[chosen]).reshape(-1, 3),
            scales=self.scale * np.repeat(wider, count),
            opacities=np.repeat(self.opacities[chosen] * share[chosen], count),
            colours=np.repeat(colour_to_dc(self.colours[chosen]), count, axis=0),
            points=np.repeat(chosen, count),
        )
