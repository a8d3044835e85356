"""What a solid is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gasp_core.contract.validation import finite, whole_number
from gasp_core.errors import SceneError

__all__ = ["SolidOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidOptions:
    """How the body behind a splat is told from the air around it; the defaults suit captures of objects.

    Parameters
    ----------
    cells
        Of the grid along the longest side of the object. None: a cell is as large as the smallest thing that is told
        apart, see `gasp_core.solid.surfels.detail_of`.
    opacity_gain
        How many times as opaque as it was trained a wall is taken to be when it is asked what one sees through it:
        more closes fainter walls, and closes more of the air between leaves.
    holes
        Share of the sky, 0..1, that a place may see and still belong to the body: a wall with a hole is closed, a
        shallow bowl is not. The middle of a flat hole sees half; the bottom of what is deeper than wide, a mug, next
        to nothing.
    underside
        "closed": nothing is seen from below, the body ends at its lowest layer. "open": it is as the Gaussians have
        it. "auto": closed where the body is dark inside but for what comes in from below.
    interior
        "auto": filled where no light comes to, by `holes`. "filled": by half of the sky, if `holes` is less.
        "hollow": as "auto", but a shell of `wall`.
    wall
        Thickness of that shell; in the unit of the Gaussians, in a scene [m].
    surface
        "seen": the body ends where one sees it, each Gaussian counts by what shows of it from all round. "middle": in
        the middle of its Gaussians, seen or not. "auto": seen if the splat was trained, so that a twentieth of its
        Gaussians or more is of an opacity below .4; what was made from a mesh, or sampled, is as opaque all over.

    Raises
    ------
    SceneError
        Where a value is impossible.
    """

    cells: int | None = None
    opacity_gain: float = 2.5
    holes: float = 0.3
    underside: Literal["auto", "closed", "open"] = "auto"
    interior: Literal["auto", "filled", "hollow"] = "auto"
    wall: float | None = None
    surface: Literal["auto", "seen", "middle"] = "auto"

    def __post_init__(self) -> None:
        if self.cells is not None:
            whole_number(self, "cells", low=8, high=256)
        finite(self, "opacity_gain", low=0.1, high=100.0)
        finite(self, "holes", low=0.0, high=1.0)
        for name, known in (
            ("underside", ("auto", "closed", "open")),
            ("interior", ("auto", "filled", "hollow")),
            ("surface", ("auto", "seen", "middle")),
        ):
            if getattr(self, name) not in known:
                words = ", ".join(f'"{word}"' for word in known)
                raise SceneError(f"SolidOptions.{name} must be one of {words}, found {getattr(self, name)!r}")
        if (self.interior == "hollow") != (self.wall is not None):
            raise SceneError('SolidOptions.wall belongs to interior = "hollow": give both, or none')
        if self.wall is not None:
            finite(self, "wall", low=0.0, open_low=True)
