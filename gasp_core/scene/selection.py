"""Which Gaussians of an object are simulated, which stay still, which are left out, and why."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.scene.floaters import floating
from gasp_core.scene.membership import Fields, checked_fields, fields_of, in_regions, part_numbers, selected_by_file
from gasp_core.scene.objects import Floaters, SplatObject
from gasp_core.scene.placed_solid import FEW, PlacedSolid, solid_behind
from gasp_core.scene.placement import Placement, place, placement_of, up_axis

__all__ = ["PlacedObject", "SetAside", "bounded_by_region", "drawn_rows", "place_object", "settle"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class SetAside:
    """How many Gaussians of an object are not simulated, by reason; each is counted once, under the first that fits.

    Parameters
    ----------
    total
        In the file.
    non_finite
        With a NaN or an infinity in any array; left out.
    invisible
        With all scales zero, or one below zero; left out. Needles and flat discs stay: the maps bear them.
    faint
        Below `min_opacity`; left out.
    floaters
        Outside the large connected components, whatever is done with them.
    floaters_rule
        What is done with them.
    outside_region
        Outside `region`; still.
    first_non_finite
        Rows of the file, at most five.
    """

    total: int
    non_finite: int
    invisible: int
    faint: int
    floaters: int
    floaters_rule: str
    outside_region: int
    first_non_finite: tuple[int, ...]

    def sentences(self, name: str, *, static: bool = False) -> list[str]:
        """One sentence for each reason that applies to an object, for the user."""
        found: list[str] = []

        def say(count: int, what: str) -> None:
            if count:
                found.append(f'object "{name}": {count} of {self.total} Gaussians {what}')

        rows = ", ".join(str(row) for row in self.first_non_finite)
        say(self.non_finite, f"are not finite (first rows {rows}) and are left out")
        say(self.invisible, "have no extent (all scales zero, or one below zero) and are left out")
        say(self.faint, "are below min_opacity and are left out")
        fate = {
            Floaters.DROP.value: "float apart from the rest and are left out",
            Floaters.STILL.value: "float apart from the rest and stay still",
            Floaters.KEEP.value: 'float apart from the rest and are simulated (floaters = "drop" or "still": not)',
        }
        if static:
            drawn = 'float apart from the rest (floaters = "drop" leaves them out)'
            fate |= {Floaters.STILL.value: drawn, Floaters.KEEP.value: drawn}
        say(self.floaters, fate[self.floaters_rule])
        if not static:
            say(self.outside_region, "are outside the region and stay still")
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedObject:
    """An object in the world.

    Parameters
    ----------
    item
        As the scene describes it.
    gaussians
        All that are drawn, in metres and +z up, in the order of the file.
    moving : (N,)
        Mask of those that are simulated.
    floating : (N,)
        Mask of those that float apart from the rest: they count neither for the size nor for the resolution.
    rows : (N,)
        Their rows in the file.
    placement
        How they came from the file's frame into the world.
    set_aside
        What is not simulated, and why.
    selected : (K, N)
        Masks of the Gaussians that each of its parts has.
    fields
        What of its materials varies.
    """

    item: SplatObject
    gaussians: Gaussians
    moving: Array
    floating: Array
    rows: Array
    placement: Placement
    set_aside: SetAside
    selected: Array
    fields: Fields

    @property
    def part_numbers(self) -> Array:
        """For each Gaussian (N,) the part it is in, from 0 on, -1 where it is in none."""
        return part_numbers(self.selected)

    def told_components(self) -> list[str]:
        """One sentence for each part that is a component: it is numbered among what is drawn, and may be another one
        than was meant."""
        found: list[str] = []
        for index, part in enumerate(self.item.parts):
            if part.component is not None:
                own = self.gaussians.means[self.selected[index]]
                middle = ", ".join(f"{value:.3g}" for value in own.mean(axis=0))
                found.append(
                    f'object "{self.item.name}": {part.called(index)} is component {part.component}, of'
                    f" {len(own):,} Gaussians around ({middle}) m"
                )
        return found

    def solid(self) -> PlacedSolid:
        """The body that all of it that does not float is the surface of, in the world."""
        kept = self.gaussians.select(~self.floating)
        return solid_behind(kept, self.placement, up_axis(self.item), self.item.solid)


def place_object(item: SplatObject, gaussians: Gaussians) -> PlacedObject:
    """Select and place the Gaussians of an object: `settle`, then `bounded_by_region`."""
    return bounded_by_region(settle(item, gaussians))


def settle(item: SplatObject, gaussians: Gaussians) -> PlacedObject:
    """Select and place the Gaussians of an object, whatever its region.

    Parameters
    ----------
    item
        As the scene describes it.
    gaussians
        As the file holds them.

    Raises
    ------
    SceneError
        Where nothing is left to draw, or parts name what there is not.
    """
    finite, visible, opaque = _reasons(gaussians, item.min_opacity)
    rows = np.flatnonzero(finite & visible & opaque)
    if len(rows) == 0:
        raise SceneError(
            f'object "{item.name}": none of its {len(gaussians)} Gaussians is left'
            f" ({int((~finite).sum())} not finite, {int((finite & ~visible).sum())} without extent,"
            f" {int((finite & visible & ~opaque).sum())} below min_opacity {item.min_opacity:g})"
        )
    floats = floating(gaussians.means[rows])
    # The object is as tall as its connected parts; what floats above it does not count, whatever becomes of it.
    placement = placement_of(item, gaussians.select(rows[~floats]))
    count = int(floats.sum())
    selected = selected_by_file(item, gaussians, rows)
    if item.floaters is Floaters.DROP:
        rows, selected, floats = rows[~floats], selected[:, ~floats], np.zeros(len(rows) - count, dtype=bool)
    placed = place(gaussians.select(rows), placement)
    moving = np.full(len(rows), not item.static)
    if item.floaters is Floaters.STILL:
        moving &= ~floats
    set_aside = SetAside(
        total=len(gaussians),
        non_finite=int((~finite).sum()),
        invisible=int((finite & ~visible).sum()),
        faint=int((finite & visible & ~opaque).sum()),
        floaters=count,
        floaters_rule=item.floaters.value,
        outside_region=0,
        first_non_finite=tuple(int(row) for row in np.flatnonzero(~finite)[:5]),
    )
    return _standing(
        PlacedObject(
            item=item,
            gaussians=placed,
            moving=moving,
            floating=floats,
            rows=rows,
            placement=placement,
            set_aside=set_aside,
            selected=selected,
            fields=fields_of(item, len(gaussians), rows),
        )
    )


def _standing(placed: PlacedObject) -> PlacedObject:
    """The object with its solid, and not its outermost Gaussian, at the height of its position."""
    item = placed.item
    if item.position is None or len(placed.gaussians) <= FEW:
        return placed
    lowest = placed.solid().lowest()
    if not math.isfinite(lowest):
        return placed
    shift = np.array([0.0, 0.0, item.position[2] - lowest])
    return dataclasses.replace(
        placed,
        gaussians=placed.gaussians.with_(means=placed.gaussians.means + shift),
        placement=dataclasses.replace(placed.placement, translation=placed.placement.translation + shift),
    )


def bounded_by_region(placed: PlacedObject) -> PlacedObject:
    """The object with what is outside its region standing still, and its parts by those of theirs.

    Raises
    ------
    SceneError
        Where nothing is left to simulate of an object that is not static, or of a part; where parts overlap, or what
        varies has impossible values.
    """
    item, moving = placed.item, placed.moving
    outside = np.zeros_like(moving)
    if item.region is not None:
        outside = moving & (item.region.signed_distance(placed.gaussians.means) > 0)
        moving = moving & ~outside
    if not item.static and not moving.any():
        raise SceneError(
            f'object "{item.name}": none of its {len(moving)} Gaussians is inside the region:'
            " move the region (it is in world coordinates, metres, +z up), or say static = true"
        )
    set_aside = dataclasses.replace(placed.set_aside, outside_region=int(outside.sum()))
    selected = in_regions(item, placed.selected, placed.gaussians.means, moving)
    checked_fields(item, placed.fields, part_numbers(selected), placed.rows, moving)
    return dataclasses.replace(placed, moving=moving, set_aside=set_aside, selected=selected)


def drawn_rows(gaussians: Gaussians, min_opacity: float = 0.0) -> Array:
    """Rows (D,) of the Gaussians of a file that an object of this `min_opacity` draws, but for floaters it drops."""
    return np.flatnonzero(np.logical_and.reduce(_reasons(gaussians, min_opacity)))


def _reasons(gaussians: Gaussians, min_opacity: float) -> tuple[Array, Array, Array]:
    """Which (N,) are finite, have an extent and are opaque enough."""
    scales: Array = gaussians.scales
    visible = np.logical_and((scales > 0).any(axis=1), (scales >= 0).all(axis=1))
    return _finite_rows(gaussians), visible, gaussians.opacities >= min_opacity


def _finite_rows(gaussians: Gaussians) -> Array:
    finite = np.isfinite(gaussians.opacities)
    for array in (gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.harmonics):
        finite &= np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    return finite
