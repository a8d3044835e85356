"""What a splat file holds, and what is odd about it."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.format_errors import shown

__all__ = ["PERCENTILES", "SplatSummary", "inspect_splat", "summarise"]

Array = NDArray[Any]

PERCENTILES = (5, 25, 50, 75, 95)
"""Of which distributions are told."""

VISIBLE = 0.05
"""Opacity above which a Gaussian counts for its shape."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatSummary:
    """Figures of a splat file, in the file's own frame and units.

    Parameters
    ----------
    path
        The file.
    format
        ``ply``, ``compressed ply``, ``splat``, ``spz``, ``sog v1``, ``sog v2``, with ``folder`` for an unzipped one,
        ``glb``, ``usd``, with what is odd about these behind a comma.
    count
        Gaussians, odd ones too.
    sh_degree
        Of the harmonics.
    minimum, maximum : (3,)
        Box of the centres.
    lower, upper : (3,)
        1st and 99th percentile of the centres along each axis: the box without its floaters.
    scale
        Percentiles (`PERCENTILES`) of the largest standard deviation.
    opacity
        Percentiles of opacity.
    flatness
        Percentiles of smallest over middle scale among Gaussians of opacity above 0.05: 0 a flat disc, 1 as thick as
        wide.
    oddities
        A sentence for each thing worth knowing before a simulation.
    """

    path: str
    format: str
    count: int
    sh_degree: int
    minimum: tuple[float, ...]
    maximum: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    scale: tuple[float, ...]
    opacity: tuple[float, ...]
    flatness: tuple[float, ...]
    oddities: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The figures as JSON takes them; what no Gaussian is left for is null."""

        def numbers(values: tuple[float, ...]) -> list[float | None]:
            return [value if np.isfinite(value) else None for value in values]

        def percentiles(values: tuple[float, ...]) -> dict[str, float | None]:
            return {f"p{p}": value for p, value in zip(PERCENTILES, numbers(values))}

        return {
            "path": self.path,
            "format": self.format,
            "count": self.count,
            "sh_degree": self.sh_degree,
            "extents": {
                "min": numbers(self.minimum),
                "max": numbers(self.maximum),
                "p1": numbers(self.lower),
                "p99": numbers(self.upper),
            },
            "scale": percentiles(self.scale),
            "opacity": percentiles(self.opacity),
            "flatness": percentiles(self.flatness),
            "oddities": list(self.oddities),
        }

    def to_text(self) -> str:
        """The figures for people, several lines."""

        def row(name: str, values: tuple[float, ...]) -> str:
            return f"  {name:<10}" + "".join(f"{value:>12.4g}" for value in values)

        lines = [
            shown(self.path),
            f"  {self.format}, {self.count:,} Gaussians, spherical harmonics of degree {self.sh_degree}",
            "",
            f"  {'':<10}" + "".join(f"{axis:>12}" for axis in "xyz"),
            row("min", self.minimum),
            row("1 %", self.lower),
            row("99 %", self.upper),
            row("max", self.maximum),
            "",
            f"  {'':<10}" + "".join(f"{f'{p} %':>12}" for p in PERCENTILES),
            row("scale", self.scale),
            row("opacity", self.opacity),
            row("flatness", self.flatness),
            "  scale: the largest of a Gaussian; flatness: smallest over middle scale, where opacity is above 0.05",
            "",
        ]
        lines += [f"  odd: {oddity}" for oddity in self.oddities] or ["  nothing odd"]
        return "\n".join(lines)


def inspect_splat(path: str | PathLike[str]) -> SplatSummary:
    """Read a splat file and tell what it holds.

    Raises
    ------
    SplatFormatError
        As `gasp_core.io.read_splat`.
    """
    from gasp_core.io.detect import read

    gaussians, kind = read(path)
    return summarise(gaussians, path=fspath(path), kind=kind)


def summarise(gaussians: Gaussians, *, path: str, kind: str) -> SplatSummary:
    """The figures of Gaussians already read; percentiles are of the finite ones."""
    finite = gaussians.select(_finite_rows(gaussians))
    means = finite.means.astype(np.float64)
    scales = np.sort(finite.scales.astype(np.float64), axis=1)
    visible = (finite.opacities > VISIBLE) & (scales[:, 1] > 0)
    return SplatSummary(
        path=path,
        format=kind,
        count=len(gaussians),
        sh_degree=gaussians.sh_degree,
        minimum=_percentiles(means, (0,))[0],
        maximum=_percentiles(means, (100,))[0],
        lower=_percentiles(means, (1,))[0],
        upper=_percentiles(means, (99,))[0],
        scale=_column(scales[:, 2]),
        opacity=_column(finite.opacities),
        flatness=_column(scales[visible, 0] / scales[visible, 1]),
        oddities=tuple(_oddities(gaussians, finite, means, scales)),
    )


def _percentiles(rows: Array, at: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Percentiles of each column, a tuple for each of `at`; NaN where there are no rows."""
    if not len(rows):
        return [tuple(float("nan") for _ in range(rows.shape[1]))] * len(at)
    return [tuple(float(value) for value in row) for row in np.percentile(rows, at, axis=0)]


def _column(values: Array) -> tuple[float, ...]:
    return tuple(row[0] for row in _percentiles(values.astype(np.float64)[:, None], PERCENTILES))


def _finite_rows(gaussians: Gaussians) -> Array:
    rows = np.ones(len(gaussians), bool)
    for array in (
        gaussians.means,
        gaussians.quaternions,
        gaussians.scales,
        gaussians.opacities,
        gaussians.harmonics,
    ):
        rows &= np.isfinite(array).reshape(len(gaussians), -1).all(axis=1)
    return rows


def _oddities(gaussians: Gaussians, finite: Gaussians, means: Array, scales: Array) -> list[str]:
    """Sentences; `means` and `scales` (sorted along each row) are float64 of the finite Gaussians."""
    count, found = len(gaussians), list[str]()

    def tell(rows: Array, sentence: str, least: float = 0.0) -> None:
        """Add a sentence on the rows of a mask, if they are more than the share `least`."""
        number = int(np.count_nonzero(rows))
        if number > least * len(rows):
            found.append(f"{number:,} Gaussians ({_percent(number / len(rows))}) {sentence}")

    for name in ("means", "quaternions", "scales", "opacities", "harmonics"):
        array = getattr(gaussians, name)
        tell(~np.isfinite(array).reshape(count, -1).all(axis=1), f"have {name} that are not finite; a scene drops them")
    if not len(finite):
        return found

    if np.all(scales[:, 0] == 0):
        found.append("every Gaussian is flat: one scale is zero")
    else:
        tell(scales[:, 0] == 0, "have a scale of zero")
    tell(scales[:, 1] == 0, "have two scales of zero, so no area at all")
    norms = np.linalg.norm(finite.quaternions.astype(np.float64), axis=1)
    tell(norms == 0, "have a quaternion of zero; it is taken as no rotation")
    spread = f"norms {norms.min():.2g} to {norms.max():.2g}"
    tell(np.abs(norms - 1) > 0.01, f"have quaternions that are not normalised ({spread}); harmless", 0.01)
    found += _about_opacity(finite.opacities)
    visible = finite.opacities > VISIBLE
    needle = visible & (scales[:, 1] < 0.1 * scales[:, 2])
    tell(needle, "are needles, ten times longer than wide, that show as streaks when stretched", 0.01)

    lower, upper = np.percentile(means, [1, 99], axis=0)
    diagonal = float(np.linalg.norm(upper - lower))
    beyond = np.linalg.norm(np.maximum(np.maximum(lower - means, means - upper), 0), axis=1)
    if diagonal > 0:
        tell(beyond > 0.5 * diagonal, "lie far outside the box of 98 % (floaters, or a background)")
        tell(visible & (scales[:, 2] > 0.25 * diagonal), "are larger than a quarter of the object")
        coarse = float(np.spacing(np.abs(means).max().astype(np.float32))) / diagonal
        if coarse > 1e-5:
            found.append(f"so far from the origin that float32 positions are {coarse:.1g} of the object apart")
    elif len(finite) > 1:
        found.append("nearly all centres are at one point")
    order = np.lexsort(finite.means.T)
    same = np.all(finite.means[order[1:]] == finite.means[order[:-1]], axis=1)
    tell(np.append(same, False), "share their centre with another one", 0.001)
    if finite.sh_degree and not np.any(finite.harmonics[:, 1:]):
        found.append(f"harmonics of degree 1 to {finite.sh_degree} are all zero")
    return found


def _about_opacity(opacities: Array) -> list[str]:
    if np.all(opacities >= 0.99):
        return ["every Gaussian is opaque: made from a mesh rather than trained"]
    faint = float(np.mean(opacities < 1 / 255))
    if faint > 0.05:
        return [f"{_percent(faint)} of the Gaussians are invisible (opacity below 1/255)"]
    return []


def _percent(share: float) -> str:
    """A share to two digits, without an exponent for whole ones."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"
