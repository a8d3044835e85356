"""A folder of splats, one a frame, matched row by row."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.games import edge_axes, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat
from gasp_core.io.format_errors import malformed

__all__ = ["SequenceMotion", "frame_files"]

Array = NDArray[Any]

_SAMPLE = 1000
_FAR = 5.0
"""Times the distance in the first frame: what grows so much in the median grows as no object does that stays one."""


def frame_files(folder: Path) -> list[Path]:
    """The splats of a folder in the natural order of their names: 2 before 10; what systems hide is left out.

    Raises
    ------
    SplatFormatError
        Where it is no folder of frames, or holds files of several kinds.
    """
    if not folder.is_dir():
        raise SplatFormatError(f"{folder}: is no folder: a motion of frames wants one, with a splat for each frame")
    if (folder / "meta.json").exists():
        raise SplatFormatError(f"{folder}: is one splat (SOG), not a folder of frames: name the folder it lies in")
    files = sorted((entry for entry in folder.iterdir() if not _hidden(entry)), key=_natural)
    if not files:
        raise SplatFormatError(f"{folder}: is empty: put a splat for each frame into it")
    kinds = {"".join(file.suffixes[-2:]).lower() if _compressed(file) else file.suffix.lower(): file for file in files}
    if len(kinds) > 1:
        first, second = list(kinds.values())[:2]
        raise SplatFormatError(
            f"{folder}: holds files of several kinds, such as {first.name} and {second.name}:"
            " leave nothing in it but frames of one format"
        )
    return files


class SequenceMotion:
    """psi of a folder of frames, in the frame and unit of the files.

    Between two frames every vertex goes along a straight line at constant speed, the interpolation that is natural to
    simplices: means and edges are linear in time. What turns by an angle a from one frame to the next is thinner by a
    factor cos(a / 2) halfway. The k-th axis of a row must be the same axis of the matter in all frames: one sorted anew
    shrinks to nothing on the way there. Colours and opacities are those of the first frame.

    Parameters
    ----------
    files
        In order.
    frame_rate
        [1/s] of scene time; the first frame is at 0.
    vertices
        Of a simplex, 3 or 4. With 3 the first frame says which axis of each Gaussian is left out.
    match
        As `FrameSequence` has it.

    Raises
    ------
    SplatFormatError
        Where a file is no splat, has another number of Gaussians or another degree of harmonics than the first, or its
        rows seem not to be the same Gaussians and `match` does not say so. All are looked at: a run that fails here
        fails before it began.
    """

    def __init__(
        self,
        files: list[Path],
        frame_rate: float,
        vertices: int,
        match: Literal["rows"] | None = None,
    ) -> None:
        self._files = files
        self._frame_rate = frame_rate
        first = read_splat(files[0])
        self._count, self._degree = len(first), first.sh_degree
        self._edges = edge_axes(first.scales, vertices)
        self._compare(first.means, refused=match is None)
        # A run asks for two frames in turn, over and over.
        self._frame = lru_cache(maxsize=2)(self._simplices_of)

    @property
    def span(self) -> tuple[float, float]:
        """See `SceneMotion`."""
        return 0.0, (len(self._files) - 1) / self._frame_rate

    @property
    def step(self) -> float:
        """See `SceneMotion`: a frame."""
        return 1 / self._frame_rate

    def __len__(self) -> int:
        return self._count

    def simplices(self, time: float) -> Array:
        """See `SceneMotion`."""
        place = time * self._frame_rate
        # A hair of tolerance: what is meant to be at a frame is that frame, to the last bit.
        nearest = round(place)
        if abs(place - nearest) <= 1e-9 * max(1.0, abs(place)):
            return self._frame(nearest)
        before = int(place)
        share = place - before
        return (1 - share) * self._frame(before) + share * self._frame(before + 1)

    def _compare(self, means: Array, *, refused: bool) -> None:
        """Look at all frames; refuse those whose rows are not those of the first, as far as that can be told."""
        pairs = _neighbours(means)
        apart = [_distance(self._read(file).means, pairs) for file in self._files[1:]]
        farthest, near = max(apart, default=0.0), _distance(means, pairs)
        if refused and farthest > _FAR * near > 0:
            first, other = self._files[0], self._files[1 + int(np.argmax(apart))]
            raise malformed(
                other,
                f"Gaussians that are neighbours in {first.name} are {farthest / near:.0f} times as far apart here: rows"
                " seem not to be the same Gaussians in all frames",
                'say match = "rows" if they are; of frames that were made one by one "gasp track" makes such as are',
            )

    def _simplices_of(self, number: int) -> Array:
        tetrahedra = to_simplices(self._read(self._files[number]), 4)
        edges = np.take_along_axis(tetrahedra[:, 1:], self._edges[:, :, None], axis=1)
        return np.concatenate([tetrahedra[:, :1], edges], axis=1)

    def _read(self, file: Path) -> Gaussians:
        gaussians = read_splat(file)
        for what, found, expected in (
            ("Gaussians", len(gaussians), self._count),
            ("as its degree of harmonics", gaussians.sh_degree, self._degree),
        ):
            if found != expected:
                raise SplatFormatError(
                    f"{file}: has {found} {what}, the first frame ({self._files[0].name}) {expected}:"
                    ' frames are matched row by row and must be alike; of others "gasp track" makes such as are'
                )
        return gaussians


def _neighbours(means: Array) -> Array:
    """Some rows (2, K), and the nearest other row of each."""
    from scipy.spatial import KDTree

    rows = np.flatnonzero(np.isfinite(means).all(axis=1))
    if len(rows) < 2:
        return np.zeros((2, 0), dtype=np.int64)
    some = rows[np.linspace(0, len(rows) - 1, min(len(rows), _SAMPLE)).astype(np.int64)]
    tree: Any = KDTree(means[rows])
    return np.stack([some, rows[tree.query(means[some], k=[2])[1][:, 0]]])


def _distance(means: Array, pairs: Array) -> float:
    """Median distance of pairs of rows (2, K)."""
    distances = np.linalg.norm(means[pairs[0]] - means[pairs[1]], axis=1)
    return float(np.median(distances)) if len(distances) else 0.0


def _natural(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _hidden(entry: Path) -> bool:
    return entry.name.startswith(".") or entry.name.lower() in ("thumbs.db", "desktop.ini")


def _compressed(file: Path) -> bool:
    return file.name.lower().endswith(".compressed.ply")
