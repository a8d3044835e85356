"""What a recording looks like: its Gaussians, and grains of the matter that has flowed. Its data has none of these."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Fluid, Foam, Sand, Snow
from gasp_core.gaussians import Gaussians
from gasp_core.harmonics import turn_coefficients
from gasp_core.recording.reader import Recording
from gasp_core.reduction.bodies import Body
from gasp_core.reduction.grains import FlowedMatter, Grains, grains_of
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.render_input import RenderInput
from gasp_core.scene.objects import SplatObject, laws_of

__all__ = ["Drawn", "DrawnFrames"]

Array = NDArray[Any]

_FLOWS = (Fluid, Foam, Sand, Snow)
_GRANULAR = (Sand, Snow)
_MOST_GRAINS = 8
"""Of a point of sand or snow: half as far apart as points."""
_MOST = 400_000
"""Grains of a body, unless it has more points than that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A frame as it is drawn.

    Parameters
    ----------
    splats
        First the N Gaussians of the recording, a row each, then G grains.
    sources : (N + G,)
        Rows of the Gaussians whose colours they have: of the first N their own.
    """

    splats: RenderInput
    sources: Array


class DrawnFrames:
    """The frames of a recording as they are drawn.

    Objects that are filled and all of which flows (sand, water, snow, foam) come apart into grains where they have
    flowed, see `gasp_core.reduction.grains`; all other Gaussians are those of the recording.

    Parameters
    ----------
    recording
        Whose.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording

    @property
    def most_grains(self) -> int:
        """How many grains a frame may have."""
        return sum(grains.most for _, grains in self.grains)

    def splats(self, frame: int) -> RenderInput:
        """What is drawn in a frame."""
        return self.at(frame).splats

    def at(self, frame: int) -> Drawn:
        """A frame."""
        splats = self.recording.splats(frame)
        flowed = self._flowed(frame)
        own = np.arange(len(splats))
        if not flowed:
            return Drawn(splats=splats, sources=own)
        matters = [matter for _, matter in flowed]
        drawn = dataclasses.replace(splats, opacities=_faded(splats.opacities, flowed)).with_round(
            np.concatenate([matter.means for matter in matters]),
            np.concatenate([matter.scales for matter in matters]),
            np.concatenate([matter.opacities for matter in matters]),
            np.concatenate([matter.colours for matter in matters]),
        )
        return Drawn(splats=drawn, sources=np.concatenate([own, *(rows[matter.sources] for rows, matter in flowed)]))

    def gaussians(self, frame: int) -> Gaussians:
        """The same as Gaussians whose harmonics are turned with the matter; their number differs between frames."""
        drawn = self.splats(frame)
        assert drawn.quaternions is not None and drawn.scales is not None
        harmonics = drawn.harmonics if drawn.turns is None else turn_coefficients(drawn.harmonics, drawn.turns)
        return Gaussians(
            means=drawn.means,
            quaternions=drawn.quaternions,
            scales=drawn.scales,
            opacities=drawn.opacities,
            harmonics=harmonics,
        )

    def _flowed(self, frame: int) -> list[tuple[Array, FlowedMatter]]:
        """Rows of the Gaussians of each body of which something has flowed, and what."""
        if not self.grains:
            return []
        points = self.recording.points(frame)
        found = [(body.rows, grains.at(points[body.points])) for body, grains in self.grains]
        return [(rows, matter) for rows, matter in found if len(matter.means)]

    @cached_property
    def grains(self) -> list[tuple[Body, Grains]]:
        """Of the bodies that may come apart."""
        items = {item.name: item for item in self.recording.scene.objects}
        found: list[tuple[Body, Grains]] = []
        for body in self.recording.bodies:
            carrier = body.carrier
            if isinstance(carrier, PointFrames) and body.drift is None and _flows(items[body.name]):
                granular = all(isinstance(law, _GRANULAR) for law in laws_of(items[body.name]))
                most = max(1, min(_MOST_GRAINS, _MOST // len(carrier.points)))
                found.append((body, grains_of(carrier, body.block.local, most if granular else 1)))
        return found


def _flows(item: SplatObject) -> bool:
    return item.motion is None and all(isinstance(law, _FLOWS) for law in laws_of(item))


def _faded(opacities: Array, flowed: list[tuple[Array, FlowedMatter]]) -> Array:
    faded = opacities.astype(np.float64)
    for rows, matter in flowed:
        faded[rows] *= matter.left
    return faded
