"""Which Gaussians of an object each of its parts has, and what varies from Gaussian to Gaussian."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.scene.columns import Column, column_name, read_column
from gasp_core.scene.floaters import components
from gasp_core.scene.objects import SplatObject
from gasp_core.scene.parts import Part, material_of_part
from gasp_core.scene.varying import VaryingMaterial

__all__ = ["Fields", "checked_fields", "fields_of", "in_regions", "part_numbers", "selected_by_file"]

Array = NDArray[Any]

Fields = tuple[dict[str, Array], ...]
"""Of what the object is made of, then of each part: by name of a number that varies, (N,) of the drawn Gaussians."""

_MOST_TOLD = 12


def selected_by_file(item: SplatObject, gaussians: Gaussians, rows: Array) -> Array:
    """Masks (K, N) of the Gaussians that each part has by its component or its labels; none where a region decides.

    Parameters
    ----------
    item
        With K parts.
    gaussians
        As the file holds them.
    rows : (N,)
        Those that are drawn, in the order of the file.

    Raises
    ------
    SceneError
        Where labels cannot be read or are no whole numbers, or there is no such component or label.
    """
    selected = np.zeros((len(item.parts), len(rows)), dtype=bool)
    numbers: Array | None = None
    read: dict[Column, Array] = {}
    for index, part in enumerate(item.parts):
        where = f'object "{item.name}", {part.called(index)}'
        if part.component is not None:
            numbers = components(gaussians.means[rows]) if numbers is None else numbers
            selected[index] = numbers == part.component
            if not selected[index].any():
                raise SceneError(f"{where}: there is no component {part.component}: {_told(numbers, 'they are')}")
        elif part.labels is not None:
            if part.labels not in read:
                read[part.labels] = _whole(
                    read_column(part.labels, item.splat, len(gaussians), f"{where}: labels"), part.labels, where
                )
            found = read[part.labels]
            for label in part.wanted:
                if not (found == label).any():
                    raise SceneError(
                        f"{where}: {column_name(part.labels)} has no label {label}: {_told(found, 'its labels are')}"
                    )
            selected[index] = np.isin(found[rows], part.wanted)
    return selected


def _whole(values: Array, column: Column, where: str) -> Array:
    """Labels as integers; properties of a .ply are often floats."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    bad = np.flatnonzero(~(np.isfinite(values) & (values == np.round(values)) & (np.abs(values) < 2.0**53)))
    if len(bad):
        raise SceneError(
            f"{where}: labels must be whole numbers, {column_name(column)} has {values[bad[0]]:g}"
            f" of Gaussian {bad[0]:,}{_and_more(bad)}"
        )
    return values.astype(np.int64)


def _told(numbers: Array, what: str) -> str:
    """The different numbers and how often each is there, the most frequent first."""
    different, counts = np.unique(numbers, return_counts=True)
    order = np.argsort(-counts, kind="stable")[:_MOST_TOLD]
    listed = ", ".join(f"{different[row]} ({counts[row]:,} Gaussians)" for row in order)
    return f"{what} {listed}{', ...' if len(different) > _MOST_TOLD else ''}"


def _and_more(rows: Array) -> str:
    return f", and {len(rows) - 1:,} more" if len(rows) > 1 else ""


def in_regions(item: SplatObject, selected: Array, means: Array, moving: Array) -> Array:
    """The masks (K, N) of `selected_by_file`, with those of regions, of Gaussians at (N, 3) [m] that are `moving` (N,).

    Raises
    ------
    SceneError
        Where a part has nothing that moves, or two parts have something in common.
    """
    selected = selected.copy()
    for index, part in enumerate(item.parts):
        if part.region is not None:
            selected[index] = part.region.signed_distance(means) <= 0
        found, own = int(selected[index].sum()), selected[index] & moving
        if not own.any():
            raise SceneError(_nothing(item, part.called(index), part, found))
        selected[index] = own
    for one, other in combinations(range(len(item.parts)), 2):
        shared = int((selected[one] & selected[other]).sum())
        if shared:
            raise SceneError(
                f'object "{item.name}": {item.parts[one].called(one)} and {item.parts[other].called(other)} share'
                f" {shared:,} Gaussians: each may be of one part only"
            )
    return selected


def _nothing(item: SplatObject, called: str, part: Part, found: int) -> str:
    if found:
        why = f"none of its {found:,} Gaussians is simulated (region and floaters of the object say which are)"
    elif part.region is not None:
        why = "no Gaussian is inside its region: move it (it is in world coordinates, metres, +z up)"
    else:
        why = "none of its Gaussians is drawn (they are faint, without extent, not finite, or dropped)"
    return f'object "{item.name}", {called}: {why}'


def part_numbers(selected: Array) -> Array:
    """Of masks (K, N) that have nothing in common: the row that each of N is in, -1 where it is in none."""
    if not len(selected):
        return np.full(selected.shape[1], -1)
    return np.where(selected.any(axis=0), np.argmax(selected, axis=0), -1)


def fields_of(item: SplatObject, count: int, rows: Array) -> Fields:
    """What varies, of the drawn `rows` (N,) of a file's `count` Gaussians.

    Raises
    ------
    SceneError
        Where a column cannot be read, or is of another number of Gaussians.
    """
    found: list[dict[str, Array]] = []
    own = item.material
    materials = [own, *(material_of_part(part, own) for part in item.parts)] if own is not None else []
    for index, material in enumerate(materials):
        columns = material.columns if isinstance(material, VaryingMaterial) else {}
        where = _whose(item, index - 1)
        found.append(
            {
                name: read_column(column, item.splat, count, f"{where}: {name}")[rows].astype(np.float64)
                for name, column in columns.items()
            }
        )
    return tuple(found)


_ALLOWED = {"density": (0.0, np.inf), "youngs_modulus": (0.0, np.inf), "poissons_ratio": (-1.0, 0.5)}
"""Open intervals, as materials have them."""


def checked_fields(item: SplatObject, fields: Fields, parts: Array, rows: Array, moving: Array) -> None:
    """Refuse numbers that no matter has, of Gaussians that they matter for.

    Parameters
    ----------
    item, fields
        As from `fields_of`.
    parts : (N,)
        Of the drawn Gaussians, as `part_numbers` gives them.
    rows : (N,)
        Theirs in the file, for the message.
    moving : (N,)
        Which are simulated.

    Raises
    ------
    SceneError
        Naming object, number and the first Gaussian.
    """
    cut_out = any(part.region is not None for part in item.parts)
    for index, columns in enumerate(fields):
        own = moving & (parts == index - 1)
        if cut_out and not own.any():
            # Regions that hold all Gaussians may leave matter of the body, which is then as any of these.
            own = moving
        for name, values in columns.items():
            low, high = _ALLOWED[name]
            bad = np.flatnonzero(own & ~((values > low) & (values < high)))
            if len(bad):
                words = f"> {low:g}" if high == np.inf else f"> {low:g} and < {high:g}"
                raise SceneError(
                    f"{_whose(item, index - 1)}: {name} must be {words}, is {values[bad[0]]:g} of Gaussian"
                    f" {rows[bad[0]]:,} of the file{_and_more(bad)}"
                )


def _whose(item: SplatObject, part: int) -> str:
    called: Sequence[str] = [f'object "{item.name}"', *([item.parts[part].called(part)] if part >= 0 else [])]
    return ", ".join(called)
