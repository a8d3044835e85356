"""What a header, a commit and the arrays of a carrier must be, whoever wrote them.

Asked once, where they enter: behind it, compiled loops take rows as they are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.recording.files import FileCheck
from gasp_core.recording.layout import BodyEntry, Commit, Header

__all__ = ["check_carrier", "check_header", "check_status", "commit_of"]

Array = NDArray[Any]

_PATH = re.compile(r"[a-z0-9_.]+(/[a-z0-9_.]+)*")
_MOST_ROWS = 1 << 40
_MOST_FRAMES = 10**8
"""Their numbers have eight digits."""
_CORNERS = 4
"""Of a simplex, at most; so many points can a Gaussian have."""
_NEIGHBOURS = 8
_WIDEST = 12
_LONGEST_NAME = 1000
_LONGEST_PATH = 200
_ROUNDING = 1e-4
"""Of the sum of eight weights in float32, with room for those of earlier versions."""


def check_header(header: Header) -> None:
    """Refuse a header whose rows do not add up.

    Raises
    ------
    ValueError
        Saying what is wrong.
    """
    _expect(bool(header.objects) and bool(header.bodies), "it has no objects")
    _expect(_number(header.frame_rate) and header.frame_rate > 0, "frame_rate is no rate")
    _expect(_number(header.spacing) and header.spacing > 0, "spacing is no length")
    _expect(all(_text(text) for text in (header.scene, *header.notes)), "a text is none")
    names = (header.gasp_version, header.scene_digest, header.points_digest)
    _expect(all(_name(text) for text in names), "a name is none")
    _expect(header.maps.get("covariance") in ("exact", "gram_schmidt"), "covariance is no map")
    rule = header.maps.get("control", "bounded")
    _expect(
        rule == "bounded" or (rule == "as_printed" and header.maps["covariance"] == "gram_schmidt"),
        "control is no rule",
    )
    alpha = header.maps.get("alpha")
    _expect(alpha is None or (_number(alpha) and alpha > 0), "alpha is no bound")
    last = 0
    for item in header.objects:
        _expect(_name(item.name) and _name(item.splat_digest), "an object has no name")
        _expect(item.first == last and _count(item.last) and item.last >= item.first, "rows of the objects have gaps")
        _expect(item.placement is None or _placement(item.placement), "an object is placed nowhere")
        last = item.last
    _check_bodies(header)
    for key, entry in header.files.items():
        known = len(key) <= _LONGEST_PATH and _PATH.fullmatch(key) is not None and ".." not in key
        _expect(known, "it names a file that is none of its own")
        _expect(_check(entry).checksum is not None, "it does not know its files")
    engine = header.engine
    told = (engine.name, engine.version, engine.device, engine.precision)
    _expect(all(_name(text) for text in told), "the engine has no name")
    _expect(type(engine.seed) is int and abs(engine.seed) < _MOST_ROWS**2, "the engine's seed is none")
    _expect(type(engine.checkpoints) is bool, "whether the engine makes checkpoints is not said")
    _expect(_fields(engine.options), "the engine's options are none")


def _check_bodies(header: Header) -> None:
    last, before = 0, -1
    for body in header.bodies:
        known = _count(body.item) and before < body.item < len(header.objects)
        _expect(known, "a body is of no object")
        _expect(body.vertices in (3, 4) and type(body.vertices) is int, "a body is not of triangles or tetrahedra")
        _expect(body.first == last and _count(body.last) and body.last > body.first, "rows of the bodies have gaps")
        item = header.objects[body.item]
        most = _CORNERS * (item.last - item.first)
        _expect(_name(body.carrier) and type(body.drifts) is bool, "a body has no carrier")
        # What fills a body is as many as the grid asks for.
        fits = body.carrier in ("mesh", "volume") or body.last - body.first <= most
        _expect(fits, "a body has more points than its Gaussians have corners")
        _expect(body.motion is None or _fields(body.motion), "a motion is none")
        last, before = body.last, body.item


def check_status(state: Mapping[str, Any]) -> None:
    """Refuse a status that none wrote.

    Raises
    ------
    ValueError
        Saying what is wrong.
    """
    _expect(state.get("state") in ("running", "complete", "incomplete"), "it is in no state")
    _expect(isinstance(state.get("reason"), str), "it has no reason")
    wanted: Any = state.get("frames_wanted")
    _expect(_count(wanted) and wanted < _MOST_FRAMES, "it wants no number of frames")
    _expect(_text(state.get("scene", "")), "its scene is no text")


def commit_of(attributes: Mapping[str, Any], frame: int, header: Header) -> Commit:
    """The commit of a frame from its attributes.

    Raises
    ------
    ValueError, KeyError, TypeError
        Where it is damaged.
    """
    fields: dict[str, Any] = dict(attributes)
    fields["chunks"] = {key: _check(entry) for key, entry in fields["chunks"].items()}
    found = Commit(**fields)
    _expect(found.frame == frame and type(found.frame) is int, "it is of another frame")
    _expect(_number(found.time), "its time is no number")
    _check_diagnostics(found.diagnostics)
    means = [[*row] for row in found.body_displacements]
    _expect(len(means) == len(header.bodies) and all(len(row) == 3 for row in means), "it lacks displacements")
    _expect(all(_number(value) for row in means for value in row), "a displacement is no number")
    lists = isinstance(found.degenerate, list) and all(isinstance(rows, list) for rows in found.degenerate)
    _expect(lists and len(found.degenerate) == len(header.bodies), "it lacks the rows without a frame")
    told: Any = found.degenerate
    for rows, body in zip(told, header.bodies):
        item = header.objects[body.item]
        pairs = all(type(row) is list and len(row) == 2 for row in rows)
        _expect(pairs and all(_count(number) for row in rows for number in row), "rows without a frame are no pairs")
        _expect(all(row < item.last - item.first for row, _ in rows), "a row without a frame is no row")
        _expect(all(before <= frame for _, before in rows), "a frame before is no frame")
    return found


def _check_diagnostics(known: Any) -> None:
    """What every version has told of a frame."""
    _expect(_fields(known), "it lacks its diagnostics")
    for name in ("substeps", "degenerate", "clipped"):
        _expect(_count(known[name]), f"{name} is no number of them")
    for name in ("smallest_substep", "largest_substep"):
        _expect(_number(known[name]), f"{name} is no number")
    for name in ("kinetic_energy", "potential_energy"):
        _expect(known[name] is None or _number(known[name]), f"{name} is no number")
    for name in ("inverted", "stretched"):
        _expect(known[name] is None or _count(known[name]), f"{name} is no number of them")
    warnings = known["warnings"]
    _expect(isinstance(warnings, list) and all(_text(warning) for warning in warnings), "its warnings are no texts")


def check_carrier(arrays: Mapping[str, Array], body: BodyEntry, count: int, *, driven: bool = False) -> None:
    """Refuse the arrays of a body's carrier that do not fit its Gaussians, its points and each other.

    Parameters
    ----------
    arrays
        By their names below the body, finite.
    body
        Of the header.
    count
        Its moving Gaussians.
    driven
        Whether what moves by itself asks nothing of the others.

    Raises
    ------
    ValueError, KeyError
        Saying which, and what is wrong.
    """
    points = body.last - body.first
    if body.carrier == "all":
        _shape(arrays, "magnification", (count, body.vertices - 1), "f")
        _expect(bool((arrays["magnification"] > 0).all()), "magnification is none")
        _expect(points == count * body.vertices, "its points are not its vertices")
        if (body.drifts and not driven) or any(name.startswith("gradients/") for name in arrays):
            _check_fit(arrays, "gradients", count, count)
        return
    if body.carrier == "centres":
        _expect(points == count, "its points are not its means")
        _shape(arrays, "points", (points, 3), "f")
        _check_table(arrays, "neighbours", count, points)
        return
    if body.carrier == "d-miso":
        cores = arrays["points"]
        _expect(cores.ndim == 3 and cores.shape[1:] == (3, 3) and cores.dtype.kind == "f", "its cores are no triangles")
        _expect(points == 3 * len(cores), "its points are not the corners of its cores")
        labels = _shape(arrays, "labels", (count,), "i")
        _expect(_within(labels, len(cores)), "labels names cores that there are not")
        _expect(len(np.unique(labels)) == len(cores), "a core carries nothing")
        return
    if body.carrier == "mesh":
        _shape(arrays, "points", (points, 3), "f")
        corners = _shape(arrays, "corners", (count, 3), "i")
        _expect(_within(corners, points), "corners names points that there are not")
        _shape(arrays, "coefficients", (count, body.vertices, 3), "f")
        standing = _shape(arrays, "standing_for", (points,), "i")
        _expect(_within(standing, count), "standing_for names rows that there are not")
        return
    if body.carrier == "volume":
        _check_points(arrays, points, count)
        return
    number = 0
    carried: list[int] = []
    while f"levels/{number}/points" in arrays:
        cores = arrays[f"levels/{number}/points"]
        _expect(cores.ndim == 3 and cores.shape[1:] == (_CORNERS, 3) and cores.dtype.kind == "f", "cores are none")
        _expect(0 < len(cores) <= count, "it has more cores than Gaussians")
        carried.append(len(cores))
        number += 1
    _expect(bool(carried) and _CORNERS * carried[0] == points, "its points are not the corners of its cores")
    for index, (cores, rows) in enumerate(zip(carried, [*carried[1:], count])):
        _check_fit(arrays, f"levels/{index}/transfer", rows, cores)


def _check_points(arrays: Mapping[str, Array], points: int, rows: int) -> None:
    """Of rows that follow material points."""
    _shape(arrays, "points", (points, 3), "f")
    _shape(arrays, "spacing", (1,), "f")
    _expect(bool(arrays["spacing"][0] > 0), "its points have no spacing")
    _check_table(arrays, "neighbours", points, points)
    labels = _check_table(arrays, "labels", rows, points)
    _expect(labels.shape[1] >= 1, "labels is no table")
    weights = _shape(arrays, "weights", labels.shape, "f")
    sums = weights.sum(axis=1, dtype=np.float64)
    shared = (np.abs(sums - 1) <= _ROUNDING) | (sums == 0)
    _expect(bool(shared.all() and (weights >= 0).all()), "weights do not add up to one")
    _expect(_within(_shape(arrays, "standing_for", (points,), "i"), rows), "standing_for names rows that there are not")
    _check_order(arrays, "order", rows)


def _check_table(arrays: Mapping[str, Array], name: str, rows: int, points: int) -> Array:
    """Points for each row."""
    table = arrays[name]
    columns = table.shape[1] if table.ndim == 2 else -1
    _expect(0 <= columns <= _WIDEST and len(table) == rows and table.dtype.kind == "i", f"{name} is no table")
    _expect(_within(table, points), f"{name} names points that there are not")
    return table


def _check_order(arrays: Mapping[str, Array], name: str, rows: int) -> None:
    """Every row once."""
    order = _shape(arrays, name, (rows,), "i")
    _expect(_within(order, rows), f"{name} names rows that there are not")
    seen = np.zeros(rows, dtype=bool)
    seen[order] = True
    _expect(bool(seen.all()), f"{name} leaves rows out")


def _check_fit(arrays: Mapping[str, Array], head: str, rows: int, cores: int) -> None:
    """Of rows that are moved by cores, in one frame or by a fit."""
    labels = _shape(arrays, f"{head}/labels", (rows,), "i")
    _expect(_within(labels, cores), f"{head}/labels names cores that there are not")
    fit = [name for name in ("neighbours", "weights", "inverses", "fallen") if f"{head}/{name}" in arrays]
    if not fit:
        return
    neighbours = arrays[f"{head}/neighbours"]
    columns = neighbours.shape[1] if neighbours.ndim == 2 else 0
    _expect(1 <= columns <= _NEIGHBOURS, f"{head}/neighbours is no table")
    _shape(arrays, f"{head}/neighbours", (rows, columns), "i")
    _expect(_within(neighbours, cores), f"{head}/neighbours names cores that there are not")
    weights = _shape(arrays, f"{head}/weights", (rows, columns), "f")
    sums = weights.sum(axis=1, dtype=np.float64)
    _expect(
        bool((np.abs(sums - 1) <= _ROUNDING).all() and (weights >= 0).all()), f"{head}/weights do not add up to one"
    )
    _shape(arrays, f"{head}/inverses", (rows, 6), "f")
    fallen = arrays[f"{head}/fallen"]
    _expect(fallen.ndim == 1 and fallen.dtype.kind == "i" and len(fallen) <= rows, f"{head}/fallen is no list")
    _expect(_within(fallen, rows), f"{head}/fallen names rows that there are not")
    if f"{head}/order" in arrays:
        _check_order(arrays, f"{head}/order", rows)


def _shape(arrays: Mapping[str, Array], name: str, shape: Sequence[int], kind: str) -> Array:
    values = arrays[name]
    fits = values.shape == tuple(shape) and values.dtype.kind == kind
    _expect(fits, f"{name} has shape {values.shape} of {values.dtype}, expected {tuple(shape)}")
    return values


def _within(values: Array, end: int) -> bool:
    """Whether all are whole numbers from 0 to before `end`."""
    if values.size == 0:
        return True
    whole = values.dtype.kind in "iu" or bool((values == np.floor(values)).all())
    return whole and bool(values.min() >= 0) and bool(values.max() < end)


def _check(entry: Any) -> FileCheck:
    """A length, or a length and a checksum."""
    values: list[Any] = entry if isinstance(entry, list) else [entry]
    _expect(1 <= len(values) <= 2 and all(_count(value) for value in values), "it does not say what its files are")
    return FileCheck(size=values[0], checksum=values[1] if len(values) > 1 else None)


def _placement(value: Any) -> bool:
    if not isinstance(value, Mapping) or set(value) != {"rotation", "scale", "translation"}:
        return False
    rotation, translation, scale = value["rotation"], value["translation"], value["scale"]
    rows = [*rotation, translation] if isinstance(rotation, list) and len(rotation) == 3 else []
    fine = bool(rows) and all(isinstance(row, list) and len(row) == 3 and all(map(_number, row)) for row in rows)
    return fine and _number(scale) and scale > 0


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _name(value: Any) -> bool:
    """Whether it is a text that may stand in a message."""
    return isinstance(value, str) and len(value) <= _LONGEST_NAME and value.isprintable()


def _fields(value: Any) -> bool:
    return isinstance(value, Mapping)


def _number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300 and math.isfinite(value)


def _count(value: Any) -> bool:
    return type(value) is int and 0 <= value < _MOST_ROWS


def _expect(fine: bool, fault: str) -> None:
    if not fine:
        raise ValueError(fault)
