"""Makes the picture of a frame: reads it, colours it, packs it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import GaspError
from gasp_core.rendering.footage import Footage, RecordedFootage
from gasp_viewer.colouring import (
    QUANTITIES,
    Scale,
    body_colours,
    body_of,
    robust_largest,
    round_up,
    trained_colours,
)
from gasp_viewer.current_frame import Moment
from gasp_viewer.display_units import Stage
from gasp_viewer.layers import Layer, Packed, layers_of

__all__ = ["Eye", "Painter", "Subject"]

Array = NDArray[Any]
Eye = tuple[float, float, float]

_LOOKED_AT = 24
"""Frames in which the largest value of a quantity is looked for."""
_STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Digits a range may end with."""
_GROWTH = 1.5
"""The range is looked for again once there are so many times as many frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is to be seen: names of a layer and of a colouring."""

    layer: str
    colouring: str


class Painter:
    """Paints the frames of a footage; from one thread at a time.

    Parameters
    ----------
    footage
        With at least one frame.
    stage
        Where it is shown.
    frame
        One that is not damaged.
    """

    def __init__(self, footage: Footage, stage: Stage, frame: int = 0) -> None:
        self._footage = footage
        self.layers: dict[str, Layer] = layers_of(footage, stage, frame)
        self.depends_on_eye = footage.splats(frame).sh_degree > 0
        self._measured: dict[str, tuple[int, Scale]] = {}

    def scale(self, colouring: str, count: int) -> Scale | None:
        """The range of a colouring's quantity over the first `count` frames; None where it shows no quantity.

        It is measured in a few frames spread over all, and again when there are half as many more or fewer: frames
        look alike only if they share one. It ends at a round number, so it seldom changes.
        """
        quantity = QUANTITIES.get(colouring)
        if quantity is None:
            return None
        known = self._measured.get(colouring)
        if known is not None and known[0] <= count < _GROWTH * known[0]:
            return known[1]
        largest = 0.0
        for frame in np.unique(np.linspace(0, count - 1, min(count, _LOOKED_AT)).round().astype(int)):
            try:
                largest = max(largest, robust_largest(quantity.measure(Moment(self._footage, int(frame)))))
            except (GaspError, OSError):
                # A damaged frame is reported where it is shown; the others still have a range.
                continue
        scale = Scale(name=quantity.name, unit=quantity.unit, top=round_up(largest, _STEPS))
        self._measured[colouring] = (count, scale)
        return scale

    def paint(self, subject: Subject, frame: int, scale: Scale | None, eye: Eye) -> Packed:
        """A frame, packed.

        Raises
        ------
        RecordingError
            Where it is damaged, or gone.
        """
        layer = self.layers[subject.layer]
        moment = Moment(self._footage, frame)
        elements = layer.elements
        if scale is not None:
            colours = scale.colours(QUANTITIES[scale.name].of(moment, elements))
        elif subject.colouring == "body" and isinstance(self._footage, RecordedFootage):
            colours = body_colours(body_of(self._footage, elements.gaussians))
        else:
            colours = trained_colours(moment.splats, np.array(eye))[elements.gaussians]
        return layer.pack(moment, colours)
