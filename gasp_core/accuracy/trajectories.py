"""How far apart two runs of the same Gaussians are, frame by frame: in place, in shape, in the centre of mass.

For a frame let d_i be the offsets between the vertices of all simplices of one run and those of another. Then

| measure | of a frame |
|---|---|
| `rms` | sqrt(mean of d_i^2) |
| `p95` | the 95th percentile of d_i |
| `shape_rms` | the rms that is left after the best rigid motion of each body (Kabsch 1976; proper rotations only) |
| `centre_of_mass` | offset of the bodies' centres; of several bodies the rms, each as often as it has vertices |

Vertices count alike, in the centre too: recordings keep no volumes, and by those of two engines a body would not lie
where it lies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import AccuracyError
from gasp_core.recording.reader import Recording

__all__ = ["Curves", "Distance", "TrajectoryDistance", "distance", "distance_from", "diagonal_of"]

Array = NDArray[Any]
SimplicesAt = Callable[[int], Mapping[str, Array]]

_PER_OCTAVE = 512
"""Bins of `_Tally`: a percentile is right to half a bin, 0.07 %."""
_LOWEST = -80
"""log2 of the least offset it tells from none, as a share of the diagonal; below what a double knows of a place."""
_HIGHEST = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """Each measure in each frame, (T,) [m]."""

    rms: Array
    p95: Array
    shape_rms: Array
    centre_of_mass: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """Of a body, or of all of them.

    Parameters
    ----------
    diagonal [m]
        Of the box around the centres of the Gaussians at rest; of several bodies that of the largest.
    vertices
        How many are compared.
    rms, shape_rms, centre_of_mass [m]
        Root mean square over the frames.
    p95 [m]
        95th percentile over vertices and frames, to 0.1 %.
    per_frame
        Each measure in each frame.
    """

    diagonal: float
    vertices: int
    rms: float
    p95: float
    shape_rms: float
    centre_of_mass: float
    per_frame: Curves

    @property
    def rms_share(self) -> float:
        """Of the diagonal."""
        return self.rms / self.diagonal

    @property
    def p95_share(self) -> float:
        """Of the diagonal."""
        return self.p95 / self.diagonal

    @property
    def shape_share(self) -> float:
        """Of the diagonal."""
        return self.shape_rms / self.diagonal

    @property
    def centre_share(self) -> float:
        """Of the diagonal."""
        return self.centre_of_mass / self.diagonal


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryDistance(Distance):
    """Of all bodies together.

    Parameters
    ----------
    frames
        Their numbers.
    times : (T,) [s]
        Of the frames.
    bodies
        The same of each body, by name.
    """

    frames: tuple[int, ...]
    times: Array
    bodies: Mapping[str, Distance]


def distance(run: Recording, other: Recording, frames: Sequence[int] | None = None) -> TrajectoryDistance:
    """How far apart two runs of the same Gaussians are, over all vertices of all simplices that move.

    Frames are read one at a time: memory does not grow with their number.

    Parameters
    ----------
    run, other
        Of any engines, resolutions and reductions; the diagonal is that of `run`.
    frames
        Numbers of those compared; None: all that both have.

    Raises
    ------
    AccuracyError
        Where the two do not describe the same Gaussians, tell of other times, or share no frame.
    RecordingError
        Where a frame that is asked for is not there, or damaged.
    """
    _refuse_others(run, other)
    if run.header.frame_rate != other.header.frame_rate:
        raise AccuracyError(
            f"{other.path} has {other.header.frame_rate:g} frames a second, {run.path} {run.header.frame_rate:g}:"
            " run both at the same frame rate"
        )
    if frames is None:
        frames = range(min(run.frame_count, other.frame_count))
        if not frames:
            empty = run if run.frame_count == 0 else other
            raise AccuracyError(f"{empty.path} has no frame yet: there is nothing to compare")
    return distance_from(run, other.simplices, frames)


def distance_from(run: Recording, elsewhere: SimplicesAt, frames: Sequence[int]) -> TrajectoryDistance:
    """How far a run is from where its simplices are told to be.

    Parameters
    ----------
    run
        What is measured.
    elsewhere
        Gives the simplices (N, V, 3) [m] of each body by name at a frame.
    frames
        Numbers of those compared.

    Raises
    ------
    AccuracyError
        Where no frame is named.
    RecordingError
        Where a frame is not there, or damaged.
    """
    if len(frames) == 0:
        raise AccuracyError(f"{run.path}: no frame was named to be compared")
    diagonals = {body.name: diagonal_of(body.block.rest) for body in run.bodies}
    whole = _Series(max(diagonals.values()))
    bodies = {name: _Series(diagonal) for name, diagonal in diagonals.items()}
    for frame in frames:
        own, its = run.simplices(frame), elsewhere(frame)
        parts = [_offsets(own[name], its[name]) for name in bodies]
        for series, part in zip(bodies.values(), parts):
            series.add([part])
        whole.add(parts)
    measured = whole.result()
    return TrajectoryDistance(
        **{name: getattr(measured, name) for name in Distance.__dataclass_fields__},
        frames=tuple(int(frame) for frame in frames),
        times=np.array([frame / run.header.frame_rate for frame in frames]),
        bodies={name: series.result() for name, series in bodies.items()},
    )


def diagonal_of(simplices: Array) -> float:
    """Diagonal [m] of the box around the centres of Gaussians, of their simplices (N, V, 3).

    Of the vertices where all centres are one; a metre where all of them are, so that a share has a meaning.
    """
    for points in (simplices[:, 0], simplices.reshape(-1, 3)):
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
        if diagonal > 0:
            return diagonal
    return 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Offsets:
    """Of a body in a frame: squares of the offsets (M,), the same after the best rigid motion, that of the centres."""

    squares: Array
    shape_squares: Array
    centre_square: float


def _offsets(simplices: Array, others: Array) -> _Offsets:
    """Between simplices (N, V, 3) and others, vertex by vertex."""
    first, second = simplices.reshape(-1, 3), others.reshape(-1, 3)
    # About one of them: far from the origin a mean of places is less exact than a mean of differences.
    origin = first[0].copy()
    first, second = first - origin, second - origin
    centre = first.mean(axis=0)
    shift = (second - first).mean(axis=0)
    unturned = second - (first + shift)
    turned = second - (centre + shift) - (first - centre) @ _best_rotation(first - centre, second - (centre + shift)).T
    left = (unturned**2).sum(axis=1), (turned**2).sum(axis=1)
    return _Offsets(
        squares=((second - first) ** 2).sum(axis=1),
        # A rotation is known to rounding only: it must not part what lies together.
        shape_squares=min(left, key=np.sum),
        centre_square=float(shift @ shift),
    )


def _best_rotation(points: Array, others: Array) -> Array:
    """The proper rotation (3, 3) of points (M, 3) about their centre that brings them nearest to others."""
    left, _, right = np.linalg.svd(others.T @ points)
    handed = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return (left * (1.0, 1.0, handed)) @ right


class _Series:
    """Gathers a body's frames, or those of several bodies."""

    def __init__(self, diagonal: float) -> None:
        self._diagonal = diagonal
        self._tally = _Tally(diagonal)
        self._rows: list[tuple[float, float, float, float]] = []
        self._vertices = 0

    def add(self, parts: Sequence[_Offsets]) -> None:
        squares = np.concatenate([part.squares for part in parts])
        shape = np.concatenate([part.shape_squares for part in parts])
        counts = [len(part.squares) for part in parts]
        lengths = np.sqrt(squares)
        self._tally.add(lengths)
        self._vertices = len(squares)
        self._rows.append(
            (
                float(np.sqrt(squares.mean())),
                float(np.quantile(lengths, 0.95)),
                float(np.sqrt(shape.mean())),
                float(np.sqrt(np.average([part.centre_square for part in parts], weights=counts))),
            )
        )

    def result(self) -> Distance:
        rms, p95, shape, centre = (np.array(column) for column in zip(*self._rows))
        return Distance(
            diagonal=self._diagonal,
            vertices=self._vertices,
            rms=_root_mean_square(rms),
            # Of one frame it is known exactly.
            p95=float(p95[0]) if len(p95) == 1 else self._tally.quantile(0.95),
            shape_rms=_root_mean_square(shape),
            centre_of_mass=_root_mean_square(centre),
            per_frame=Curves(rms=rms, p95=p95, shape_rms=shape, centre_of_mass=centre),
        )


class _Tally:
    """Counts lengths in bins of equal ratio, so that a percentile over all frames needs no memory for them."""

    def __init__(self, unit: float) -> None:
        self._unit = unit
        self._counts = np.zeros((_HIGHEST - _LOWEST) * _PER_OCTAVE + 1, dtype=np.int64)

    def add(self, lengths: Array) -> None:
        with np.errstate(divide="ignore"):
            octaves = np.log2(lengths / self._unit)
        bins = np.clip((octaves - _LOWEST) * _PER_OCTAVE, -1, len(self._counts) - 2).astype(np.int64) + 1
        self._counts += np.bincount(bins, minlength=len(self._counts))

    def quantile(self, share: float) -> float:
        """In the middle of its bin; 0 in the lowest, where lengths that are nothing lie."""
        ranks = np.cumsum(self._counts)
        found = int(np.searchsorted(ranks, share * ranks[-1]))
        return 0.0 if found == 0 else self._unit * 2.0 ** (_LOWEST + (found - 0.5) / _PER_OCTAVE)


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _refuse_others(run: Recording, other: Recording) -> None:
    """Where two recordings do not describe the same Gaussians by the same simplices."""
    where = f"{run.path} and {other.path} do not describe the same Gaussians"
    names, others = [body.name for body in run.bodies], [body.name for body in other.bodies]
    if names != others:
        raise AccuracyError(f"{where}: {', '.join(names)} move in the one, {', '.join(others)} in the other")
    for body, its in zip(run.bodies, other.bodies):
        mine, yours = body.block.local, its.block.local
        if len(mine) != len(yours):
            raise AccuracyError(f'{where}: of the object "{body.name}" {len(mine)} move in the one, {len(yours)}')
        if body.block.vertices != its.block.vertices:
            raise AccuracyError(
                f'{where} by the same simplices: those of the object "{body.name}" have {body.block.vertices} vertices'
                f" in the one, {its.block.vertices} in the other: say vertices in the scene"
            )
        # Wherever they start: opacities and axes are those of the file, in its order.
        same = np.array_equal(mine.opacities, yours.opacities) and np.allclose(
            mine.scales, yours.scales, rtol=1e-5, atol=0.0
        )
        if not same:
            raise AccuracyError(f'{where}: those of the object "{body.name}" are of other shapes, or in another order')
