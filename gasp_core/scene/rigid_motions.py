"""How a collider moves, as a scene or a file of moments says it."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any, cast

from gasp_core.contract import KeyframedMotion, RigidMotion, SteadyMotion
from gasp_core.errors import SceneError
from gasp_core.io.format_errors import shown
from gasp_core.io.text_files import read_text
from gasp_core.scene.tables import Table, kind_of

__all__ = ["read_moments", "read_rigid_motion"]

_COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
_LONGEST = 64 * 2**20
"""Bytes of a file of moments: half a million of them."""


def read_rigid_motion(table: Table, folder: Path | None, middle: tuple[float, float, float] | None) -> RigidMotion:
    """A table `motion`: steady, or moments of its own or in a file; a file's path starts at the folder.

    `middle` [m] is the center where none is said; a shape that has none wants one as soon as it decides something.
    """
    if middle is None and not table.has("center"):
        telling = [key for key in ("file", "places", "quaternions", "angular_velocity") if table.has(key)]
        if telling:
            table.fail("center", f"missing: the point [m] of it, in the scene, that {telling[0]} is of")
    center = table.vector("center", middle or (0.0, 0.0, 0.0))
    if table.has("file"):
        table.only("file", "center")
        path = Path(table.text("file"))
        return read_moments(path if folder is None else folder / path, center)
    if table.has("times"):
        table.only("times", "places", "quaternions", "center")
        given: dict[str, Any] = {"times": tuple(value for (value,) in _rows(table, "times", 1))}
        given |= {key: _rows(table, key, width) for key, width in (("places", 3), ("quaternions", 4)) if table.has(key)}
        return table.make(KeyframedMotion, {**given, "center": center})
    return table.build(SteadyMotion, center=center)


def _rows(table: Table, key: str, width: int) -> tuple[tuple[float, ...], ...]:
    """A list of numbers, or of lists of as many numbers as `width`."""
    values: object = table.values[key]
    rows: list[tuple[float, ...]] = []
    for value in cast("list[object]", values) if isinstance(values, list) else [values]:
        row = cast("list[object]", value) if isinstance(value, list) else [value]
        if len(row) != width or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in row):
            what = "numbers" if width == 1 else f"lists of {width} numbers"
            table.fail(key, f"must be a list of {what}, found {kind_of(values)}")
        rows.append(tuple(float(cast("float", one)) for one in row))
    return tuple(rows)


def read_moments(path: Path, center: tuple[float, float, float]) -> KeyframedMotion:
    """The motion in a CSV file, see docs/scene.md: a line of names, then one for each moment.

    Columns are time [s], x, y, z [m] and, if it turns, qw, qx, qy, qz; in any order, others are passed over.

    Raises
    ------
    SceneError
        Where it cannot be read or a line is no moment; the message names file and line.
    """
    name = shown(path)
    try:
        # As spreadsheets write it: with a mark before the first letter.
        text = read_text(path, _LONGEST).removeprefix("\ufeff")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{name}: cannot be read as a file of moments: {reason}") from None
    lines = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    names = [one.strip() for one in lines.fieldnames or ()]
    lines.fieldnames = names
    columns = _COLUMNS if any(one in names for one in _COLUMNS[4:]) else _COLUMNS[:4]
    for column in columns:
        if column not in names:
            wanted = ", ".join(columns) if len(columns) > 4 else "time, x, y, z (and qw, qx, qy, qz, if it turns)"
            raise SceneError(f'{name}: has no column "{column}": its first line must name {wanted}')
    moments: list[tuple[float, ...]] = []
    for line in lines:
        try:
            moments.append(tuple(float(line[column]) for column in columns))
        except (TypeError, ValueError):
            raise SceneError(f"{name}: line {lines.line_num} is no moment: {len(columns)} numbers are wanted") from None
        if not all(math.isfinite(value) for value in moments[-1]):
            raise SceneError(f"{name}: line {lines.line_num} has a number that is not finite")
    if not moments:
        raise SceneError(f"{name}: has no moment: a line of {len(columns)} numbers each must follow the names")
    try:
        return KeyframedMotion(
            times=tuple(one[0] for one in moments),
            places=tuple((one[1], one[2], one[3]) for one in moments),
            quaternions=tuple((one[4], one[5], one[6], one[7]) for one in moments) if len(columns) > 4 else (),
            center=center,
        )
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from None
