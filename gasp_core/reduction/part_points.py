"""What the points of a body are made of, from the parts and the fields of its Gaussians, and what of them is held.

A point is of the part of the Gaussians that it leads or, inside a body, of those at the nearest point that leads some,
by way of matter: of most of them. Where a region says what a part is, it says so of the points of a filled body too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, Material, Pinned
from gasp_core.errors import SceneError
from gasp_core.reduction.held_region import held_region
from gasp_core.reduction.rigid_parts import loose_parts, rigid_groups
from gasp_core.reduction.rounded_fields import rounded_rows
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.parts import Part, material_of_part
from gasp_core.scene.selection import PlacedObject
from gasp_core.scene.varying import VaryingMaterial, law_of

__all__ = ["PointMatter", "matter_of_points", "part_of_points"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointMatter:
    """What the points of a body are made of.

    Parameters
    ----------
    materials
        All different.
    rows : (P,)
        Of them, for each point.
    drives
        That hold parts, by what they hold.
    notes
        Sentences for the user, without their subject: one for each part, and for what varies.
    driven : (P,) bool
        What goes where the object's own motion takes it.
    groups : (P,)
        See `gasp_core.reduction.rigid_parts.rigid_groups`.
    """

    materials: tuple[Material, ...]
    rows: Array
    drives: Mapping[str, Drive]
    notes: tuple[str, ...]
    driven: Array
    groups: Array


def matter_of_points(
    placed: PlacedObject, carrier: TransferOperator, points: Array, volumes: Array, spacing: float
) -> PointMatter:
    """Materials of the points (P, 3) [m], of volumes (P,) [m^3], that `carrier` takes the object's Gaussians along by,
    for an engine of this spacing [m].

    Raises
    ------
    SceneError
        Where two regions have points in common.
    """
    own = placed.item.material
    assert own is not None  # SplatObject refuses what moves and is made of nothing
    parts = placed.item.parts
    of_gaussians = placed.part_numbers[placed.moving]
    of_points = part_of_points(parts, of_gaussians, carrier, points, placed.item.name)
    materials: list[Material] = []
    rows = np.zeros(len(points), dtype=np.int64)
    notes: list[str] = []
    choices = [own, *(material_of_part(part, own) for part in parts)]
    for index, material in enumerate(choices, start=-1):
        members = np.flatnonzero(of_points == index)
        found, of_members, note = _materials(
            material, _at_points(placed, index, of_gaussians, carrier, points, members)
        )
        rows[members] = len(materials) + of_members
        densities = np.array([each.density for each in found])
        materials += found
        if index >= 0:
            mass = float((densities[of_members] * volumes[members]).sum())
            gaussians = int((of_gaussians == index).sum())
            notes.append(_told(parts[index], index, material, gaussians, len(members), mass))
        if note:
            notes.append(note if index < 0 else f"{parts[index].called(index)}: {note}")
    groups = rigid_groups(materials, rows, of_points)
    for group in loose_parts(groups, points, spacing):
        part = int(of_points[groups == group][0])
        called = parts[part].called(part) if part >= 0 else "what is in no part"
        notes.append(f"{called} is rigid, and nothing that deforms is within a cell of it: it goes its own way")
    different = list(dict.fromkeys(materials))
    place = {material: row for row, material in enumerate(different)}
    renumbered = np.array([place[material] for material in materials])
    return PointMatter(
        materials=tuple(different),
        rows=renumbered[rows],
        drives=dict(_pins(placed.item, of_points, points, spacing)),
        notes=tuple(notes),
        groups=groups,
        driven=np.isin(of_points, [index for index, part in enumerate(parts) if part.driven]),
    )


def _pins(item: SplatObject, of_points: Array, points: Array, spacing: float) -> Iterator[tuple[str, Drive]]:
    """What holds the pinned parts: their regions or, where they have none, what is nearest to their points."""
    for index, part in enumerate(item.parts):
        own = of_points == index
        if not part.pinned or (part.region is None and not own.any()):
            continue
        called = f'object "{item.name}", {part.called(index)}'
        try:
            yield called, Pinned(region=part.region or held_region(points[own], points[~own], spacing))
        except SceneError as error:
            raise SceneError(f"{called}: {error}") from None


def part_of_points(
    parts: Sequence[Part], of_gaussians: Array, carrier: TransferOperator, points: Array, name: str
) -> Array:
    """The part (P,) of each point (P, 3) [m], -1 where it is in none.

    Parameters
    ----------
    parts
        Of the object.
    of_gaussians : (N,)
        The part that each of its moving Gaussians is in.
    carrier
        Of its points.
    points : (P, 3) [m]
    name
        Of the object, for messages.
    """
    if not parts:
        return np.full(len(points), -1)
    leading = carrier.leaders
    inside = {
        index: np.asarray(part.region.signed_distance(points) <= 0)
        for index, part in enumerate(parts)
        # Elsewhere points are of single Gaussians, or of clusters of them, and go where those do.
        if part.region is not None and carrier.kind in ("mesh", "volume")
    }
    for one, other in combinations(inside, 2):
        shared = int((inside[one] & inside[other]).sum())
        if shared:
            raise SceneError(
                f'object "{name}": {parts[one].called(one)} and {parts[other].called(other)} share {shared:,} points:'
                " their regions must not overlap within it"
            )
    voted = np.where(np.isin(of_gaussians, list(inside)), -1, of_gaussians)
    found = _most_of(voted, leading, len(points))[_sources(carrier)]
    for index, mask in inside.items():
        found[mask] = index
    return found


def _sources(carrier: TransferOperator) -> Array:
    """For each point (P,) the one that leads the Gaussians nearest to it, by way of matter."""
    return carrier.leaders[carrier.followers]


def _most_of(numbers: Array, groups: Array, count: int) -> Array:
    """The number that most of each group (count,) have, of members with numbers (N,) >= -1 and groups (N,)."""
    width = int(numbers.max()) + 2
    keys, votes = np.unique(groups * width + numbers + 1, return_counts=True)
    order = np.lexsort((-votes, keys // width))
    groups_found, first = np.unique(keys[order] // width, return_index=True)
    found = np.full(count, -1)
    found[groups_found] = keys[order][first] % width - 1
    return found


def _at_points(
    placed: PlacedObject, index: int, of_gaussians: Array, carrier: TransferOperator, points: Array, members: Array
) -> dict[str, Array]:
    """What varies of a part's material, at its points `members` (M,): means of the Gaussians of it that lead there.

    Where regions of parts hold all Gaussians, what is left of the body is as those of the parts around it.
    """
    fields = placed.fields[index + 1]
    if not fields or not len(members):
        return {name: np.zeros(0) for name in fields}
    own = np.flatnonzero(of_gaussians == index)
    if not len(own):
        own = np.arange(len(of_gaussians))
    groups, wanted = carrier.leaders[own], _sources(carrier)[members]
    counts = np.bincount(groups, minlength=len(points))
    lone = np.flatnonzero(counts[wanted] == 0)
    nearest = np.zeros(0, dtype=np.int64)
    if len(lone):
        # None of its own part leads there: a region has cut it off from the Gaussians around it.
        from scipy.spatial import KDTree

        tree: Any = KDTree(placed.gaussians.means[placed.moving][own])
        nearest = tree.query(points[members[lone]])[1]
    found: dict[str, Array] = {}
    for name, values in fields.items():
        moving = values[placed.moving][own]
        means = np.bincount(groups, moving, minlength=len(points)) / np.maximum(counts, 1)
        found[name] = means[wanted]
        found[name][lone] = moving[nearest]
    return found


def _materials(material: Material | VaryingMaterial, values: dict[str, Array]) -> tuple[list[Material], Array, str]:
    """Materials, the row of each point, and a note: one for all, or as many as the `values` (M,) by name ask for."""
    law = law_of(material)
    if not values:
        return [law], np.zeros((), dtype=np.int64), ""
    table, rows, off = rounded_rows(values)
    names = list(values)
    found = [dataclasses.replace(law, **dict(zip(names, map(float, row)))) for row in table]
    how = "exactly" if off == 0 else f"to within {100 * off:.2g} %"
    if not len(found):
        return found, rows, ""
    spans = ", ".join(f"{name} {_span(table[:, at])}" for at, name in enumerate(names))
    return found, rows, f"{spans}, as {len(found):,} material{'s' if len(found) > 1 else ''}, {how}"


def _span(values: Array) -> str:
    """The least and the greatest of them, or the one."""
    least, greatest = f"{values.min():.3g}", f"{values.max():.3g}"
    return least if least == greatest else f"{least} to {greatest}"


def _told(
    part: Part, index: int, material: Material | VaryingMaterial, gaussians: int, points: int, mass: float
) -> str:
    law, held = law_of(material), ", pinned" if part.pinned else ", driven" if part.driven else ""
    none = "" if points else ": it is finer than what is simulated, and moves with what is around it"
    return (
        f"{part.called(index)}, {law.name or law.kind}{held}: {gaussians:,} Gaussians, {points:,} points,"
        f" {mass:.3g} kg{none}"
    )
