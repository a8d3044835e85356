"""How points carry Gaussians, as files: what a decoder cannot find out by itself, and no more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.moving.integers import decoded, encoded
from gasp_core.reduction.cores import Level, Levels
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.reduction.transfer import Cores, LeastSquares, OneFrame, Transfer

__all__ = ["KINDS", "carrier_labels", "carrier_of", "files_of"]

Array = NDArray[Any]
Carrier = PointFrames | Levels

KINDS = ("volume", "cores")
_SHARES = 65535
"""Weights are so many parts of one."""
_WIDEST = 12
"""Of a table of rows, at most."""


def files_of(carrier: Carrier, order: Array) -> dict[str, bytes]:
    """Files by their names.

    Parameters
    ----------
    carrier
        Of a body.
    order : (N,)
        Its Gaussians, rows of the body's, as they lie in the splat.
    """
    return _of_points(carrier, order) if isinstance(carrier, PointFrames) else _of_cores(carrier, order)


def carrier_of(kind: str, files: Mapping[str, bytes], points: int, rows: int, spacing: float) -> Carrier:
    """From what `files_of` gave.

    Parameters
    ----------
    kind
        One of `KINDS`.
    files
        By their names.
    points, rows
        How many points the body has, and how many Gaussians.
    spacing
        Mean distance of the points [m].

    Raises
    ------
    ValueError, KeyError
        Where they are not of so many, or name what there is not.
    """
    if kind == "cores":
        return _cores_of(files, points, rows)
    if kind != "volume":
        raise ValueError(f"it is carried by {kind[:40]!r}")
    own = np.arange(points)[:, None]
    labels = carrier_labels(files, points, rows)
    return PointFrames(
        points=_floats(files["points"], (points, 3)),
        neighbours=_rows_within(_table(files["neighbours"], points) + own, points),
        order=np.arange(rows, dtype=np.int32),
        labels=labels,
        weights=_weights(files["weights"], labels.shape),
        standing_for=np.zeros(points, dtype=np.int32),
        spacing=spacing,
    )


def carrier_labels(files: Mapping[str, bytes], points: int, rows: int) -> Array:
    """The points that each of the rows of a "volume" follows, (N, K).

    Raises
    ------
    ValueError, KeyError
        Where they are damaged.
    """
    labels = _table(files["labels"], rows)
    labels[:, 1:] += labels[:, :1]
    return _rows_within(labels, points)


def _of_points(carrier: PointFrames, order: Array) -> dict[str, bytes]:
    place = np.argsort(carrier.order)[order]
    labels = carrier.labels[place].astype(np.int64)
    labels[:, 1:] -= labels[:, :1]
    # Whom nobody follows needs no map of its own.
    away = np.zeros(carrier.neighbours.shape, dtype=np.int64)
    away[carrier.followed] = carrier.neighbours[carrier.followed] - carrier.followed[:, None]
    return {
        "points": carrier.points.astype("<f4").tobytes(),
        "neighbours": _table_bytes(away),
        "labels": _table_bytes(labels),
        "weights": _weight_bytes(carrier.weights[place]),
    }


def _of_cores(carrier: Levels, order: Array) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for number, level in enumerate(carrier.levels):
        last = number == len(carrier.levels) - 1
        rows = order if last else np.arange(len(level.transfer.labels))
        files[f"{number}/points"] = level.cores.points.astype("<f4").tobytes()
        files[f"{number}/labels"] = _table_bytes(level.transfer.labels[rows][:, None])
        if isinstance(level.transfer, LeastSquares):
            place = np.argsort(level.transfer.order)[rows]
            files[f"{number}/neighbours"] = _table_bytes(level.transfer.neighbours[place])
            files[f"{number}/weights"] = _weight_bytes(level.transfer.weights[place])
    return files


def _cores_of(files: Mapping[str, bytes], points: int, rows: int) -> Levels:
    count = len({name.partition("/")[0] for name in files})
    tetrahedra = [np.frombuffer(files[f"{number}/points"], "<f4") for number in range(count)]
    if not count or any(len(corners) % 12 for corners in tetrahedra) or len(tetrahedra[0]) != 3 * points:
        raise ValueError("its cores are no tetrahedra")
    cores = [Cores(points=_finite(corners.astype(np.float64).reshape(-1, 4, 3))) for corners in tetrahedra]
    carried = [*(len(core) for core in cores[1:]), rows]
    return Levels(
        levels=tuple(
            Level(cores=core, transfer=_transfer(files, number, core, below))
            for number, (core, below) in enumerate(zip(cores, carried))
        )
    )


def _transfer(files: Mapping[str, bytes], number: int, cores: Cores, rows: int) -> Transfer:
    labels = _rows_within(_table(files[f"{number}/labels"], rows), len(cores))[:, 0]
    if f"{number}/neighbours" not in files:
        return OneFrame(labels=labels)
    neighbours = _rows_within(_table(files[f"{number}/neighbours"], rows), len(cores))
    weights = _weights(files[f"{number}/weights"], neighbours.shape)
    return LeastSquares.fitted(cores, labels, np.arange(rows, dtype=np.int32), neighbours, weights)


def _table_bytes(table: Array) -> bytes:
    return bytes([table.shape[1]]) + encoded(table)


def _table(data: bytes, rows: int) -> Array:
    """Whole numbers (rows, C) int64; how wide it is, is its first byte."""
    columns = data[0] if data else 0
    if not 1 <= columns <= _WIDEST:
        raise ValueError("a table has no columns")
    numbers, rest = decoded(memoryview(data)[1:], rows, columns)
    if len(rest):
        raise ValueError("a table is too long")
    return numbers


def _rows_within(table: Array, end: int) -> Array:
    if table.size and not (table.min() >= 0 and table.max() < end):
        raise ValueError("a table names rows that there are not")
    return table.astype(np.int32)


def _weight_bytes(weights: Array) -> bytes:
    """Parts that add up to one in every row, or to nothing."""
    parts = np.round(weights.astype(np.float64) * _SHARES).astype(np.int64)
    rows, largest = np.arange(len(parts)), weights.argmax(axis=1)
    parts[rows, largest] += np.where(weights.sum(axis=1) > 0, _SHARES - parts.sum(axis=1), 0)
    return _table_bytes(parts)


def _weights(data: bytes, shape: tuple[int, ...]) -> Array:
    parts = _table(data, shape[0])
    sums = parts.sum(axis=1)
    if parts.shape != shape or (parts.size and parts.min() < 0) or not np.isin(sums, (0, _SHARES)).all():
        raise ValueError("weights do not add up to one")
    return (parts / _SHARES).astype(np.float32)


def _floats(data: bytes, shape: tuple[int, int]) -> Array:
    values = np.frombuffer(data, "<f4")
    if values.size != shape[0] * shape[1]:
        raise ValueError("places are cut off")
    return _finite(values.astype(np.float64).reshape(shape))


def _finite(values: Array) -> Array:
    if not np.isfinite(values).all():
        raise ValueError("a place is no number")
    return values
