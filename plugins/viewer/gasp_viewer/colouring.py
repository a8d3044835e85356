"""Colours for what is shown: as trained, by a quantity, or by body."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.harmonics import basis, material_directions
from gasp_core.render_input import RenderInput
from gasp_core.rendering.footage import Footage, RecordedFootage
from gasp_viewer.current_frame import Moment

__all__ = [
    "BODY_COLOURS",
    "COLOURINGS",
    "QUANTITIES",
    "STATIC",
    "VIRIDIS",
    "Elements",
    "Quantity",
    "Scale",
    "body_colours",
    "body_of",
    "colourings_of",
    "robust_largest",
    "round_up",
    "trained_colours",
    "viridis",
]

Array = NDArray[Any]

VIRIDIS = (
    np.array(
        [
            [0x44, 0x01, 0x54],
            [0x47, 0x2D, 0x7B],
            [0x3B, 0x52, 0x8B],
            [0x2C, 0x72, 0x8E],
            [0x21, 0x90, 0x8C],
            [0x27, 0xAD, 0x81],
            [0x5D, 0xC8, 0x63],
            [0xAA, 0xDC, 0x32],
            [0xFD, 0xE7, 0x25],
        ]
    )
    / 255
)
"""Nine evenly spaced colours of viridis (Smith and van der Walt, CC0), evenly stepped to every kind of eye."""

BODY_COLOURS = (
    np.array(
        [
            [0xE6, 0x9F, 0x00],
            [0x56, 0xB4, 0xE9],
            [0x00, 0x9E, 0x73],
            [0xF0, 0xE4, 0x42],
            [0x00, 0x72, 0xB2],
            [0xD5, 0x5E, 0x00],
            [0xCC, 0x79, 0xA7],
        ]
    )
    / 255
)
"""Colours that the colour-blind tell apart (Okabe and Ito 2008); they begin anew after the last."""

STATIC = np.array([0.6, 0.6, 0.6])
"""Colour of what is not simulated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """What a layer draws M of, and whose colour each wears.

    Parameters
    ----------
    gaussians : (M,)
        Rows of the drawn Gaussians.
    points : (M,)
        Rows of the engine's points they go with; -1: it does not move.
    """

    gaussians: Array
    points: Array

    def __len__(self) -> int:
        return len(self.gaussians)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The range of a quantity that the colour map is stretched over, 0 to `top`.

    Parameters
    ----------
    name, unit
        Of the quantity.
    top
        From here on the colour is the map's last.
    """

    name: str
    unit: str
    top: float

    def colours(self, values: Array) -> Array:
        """Colours (M, 3) of values (M,)."""
        return viridis(values / self.top if self.top > 0 else np.zeros(len(values)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """Something the engine's points have.

    Parameters
    ----------
    name, unit
        For the legend.
    measure
        Of a moment: values (P,), >= 0.
    """

    name: str
    unit: str
    measure: Callable[[Moment], Array]

    def of(self, moment: Moment, elements: Elements) -> Array:
        """Values (M,) of elements; 0 for what does not move."""
        values = np.append(self.measure(moment), 0.0)
        return values[elements.points]


QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        Quantity(name="displacement", unit="m", measure=lambda moment: moment.displacements),
        Quantity(name="speed", unit="m/s", measure=lambda moment: moment.speeds),
    )
}

COLOURINGS = ("trained", *QUANTITIES, "body")
"""All names of colourings, in the order they are offered."""


def colourings_of(footage: Footage) -> tuple[str, ...]:
    """The colourings a footage has what they need for: a file knows its colours, a run its motion too."""
    return COLOURINGS if isinstance(footage, RecordedFootage) else ("trained",)


def trained_colours(splats: RenderInput, eye: Array) -> Array:
    """Colours (N, 3) in 0..1 of Gaussians seen from a point (3,) [m]: max(0, 0.5 + harmonics(R^T d)), at most 1."""
    degree = splats.sh_degree
    if degree == 0:
        seen = basis(np.zeros((1, 3)), 0)[0, 0] * splats.harmonics[:, 0]
    else:
        away = splats.means.astype(np.float64) - eye
        directions = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
        if splats.turns is not None:
            directions = material_directions(directions, splats.turns)
        seen = np.einsum("nk,nkc->nc", basis(directions, degree), splats.harmonics)
    return np.clip(0.5 + seen, 0.0, 1.0)


def body_of(footage: RecordedFootage, gaussians: Array) -> Array:
    """Which simulated body each of some drawn Gaussians (M,) belongs to; -1: to none."""
    bodies = np.full(len(footage.recording.moving), -1)
    for index, body in enumerate(footage.recording.bodies):
        bodies[body.rows] = index
    return bodies[gaussians]


def body_colours(bodies: Array) -> Array:
    """Colours (M, 3) of bodies (M,); -1: none."""
    return np.where((bodies < 0)[:, None], STATIC, BODY_COLOURS[bodies % len(BODY_COLOURS)])


def viridis(shares: Array) -> Array:
    """Colours (M, 3) of shares (M,) of a range; what is outside of 0..1 is cut off."""
    stops = np.linspace(0.0, 1.0, len(VIRIDIS))
    return np.stack([np.interp(shares, stops, VIRIDIS[:, channel]) for channel in range(3)], axis=1)


def robust_largest(values: Array) -> float:
    """The largest of values but for their highest thousandth: one lost point must not dim all others."""
    return float(np.percentile(values, 99.9, method="higher")) if len(values) else 0.0


def round_up(value: float, steps: Sequence[float] = (1.0, 2.0, 5.0)) -> float:
    """The next of some steps (from 1 on, below 10) times a power of ten; 0 stays."""
    if value <= 0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value))
    # A value that is such a number already may come out a rounding error above it.
    return next(step * power for step in (*steps, 10.0) if step * power >= value * (1 - 1e-9))
