"""The page of a comparison: one file that needs nothing else."""

from __future__ import annotations

import base64
import functools
import importlib.metadata
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gasp_core.studies.comparison.curves import RunCurves
from gasp_core.studies.comparison.measures import Comparison, Row
from gasp_core.studies.comparison.plots import Line, Look, look_of, plot

__all__ = ["page_of"]

_MARKS = {"complete": "✓", "diverged": "↯", "crashed": "✗", "unable": "–", "failed": "✗"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Film:
    engine: str
    base64: str
    short: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plot:
    title: str
    about: str
    svg: Any


def page_of(comparison: Comparison, curves: Mapping[str, RunCurves]) -> str:
    """HTML of a comparison.

    Parameters
    ----------
    comparison
        Whose films are on disk.
    curves
        Of the runs that have frames, by the name of the engine.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    looks = {row.engine: look_of(index) for index, row in enumerate(comparison.rows)}
    films = [_film(row, comparison) for row in comparison.rows if row.film is not None]
    counts = [row.outcome.frame_count for row in comparison.rows if row.film is not None]
    pictures = {len(pair.likeness.frames) for pair in comparison.pairs if pair.likeness is not None}
    machine = Environment(
        loader=PackageLoader("gasp_core.studies.comparison", ""),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    machine.filters |= {"figures": _figures, "decibels": _decibels}
    return machine.get_template("page.html.jinja").render(
        comparison=comparison,
        matrix=_matrix(comparison) if len(comparison.pairs) > 1 else {},
        reasons=[row for row in comparison.rows if row.outcome.reason],
        looks=looks,
        marks=_MARKS,
        films=films,
        # As long as the longest film, whose last picture stays for a frame.
        duration=max(counts, default=0) / comparison.frame_rate,
        step=1 / comparison.frame_rate,
        pictures=f"up to {max(pictures)}" if pictures else "0",
        plots=_plots(curves, looks),
        version=_version(),
    )


def _film(row: Row, comparison: Comparison) -> _Film:
    assert row.film is not None
    frames = row.outcome.frame_count
    ends = f"{(frames - 1) / comparison.frame_rate:.2f} s" if frames < comparison.frames_wanted else ""
    return _Film(engine=row.engine, base64=base64.b64encode(row.film.read_bytes()).decode(), short=ends)


def _matrix(comparison: Comparison) -> dict[str, list[float | None]]:
    """Shares of the RMS distances of each engine that has frames from every other; None where there is none."""
    shares = {
        frozenset((pair.first, pair.second)): None if pair.distance is None else pair.distance.rms_share
        for pair in comparison.pairs
    }
    names = [row.engine for row in comparison.rows if any(row.engine in pair for pair in shares)]
    return {name: [shares.get(frozenset((name, other))) for other in names] for name in names}


def _plots(curves: Mapping[str, RunCurves], looks: Mapping[str, Look]) -> list[_Plot]:
    """Of each body its height, and of all of them energy and momentum."""
    if not curves:
        return []
    bodies = next(iter(curves.values())).heights
    found = [
        _drawn(
            f"Height of {body}",
            "its centre of mass",
            "height [m]",
            {name: Line(x=run.times, y=run.heights[body]) for name, run in curves.items()},
            looks,
        )
        for body in bodies
    ]
    energies = {name: Line(x=run.times, y=run.energy) for name, run in curves.items() if np.isfinite(run.energy).any()}
    momenta = {
        "Upward momentum": {name: run.momentum[:, 2] for name, run in curves.items()},
        "Sideways momentum": {name: np.linalg.norm(run.momentum[:, :2], axis=1) for name, run in curves.items()},
    }
    about = "kinetic and of gravity; not what deformed matter stores"
    found += [_drawn("Energy", about, "energy [J]", energies, looks)] if energies else []
    found += [
        _drawn(
            title,
            "of all objects, from their centres' way between frames",
            "momentum [kg m/s]",
            {name: Line(x=curves[name].momentum_times, y=values) for name, values in part.items()},
            looks,
        )
        for title, part in momenta.items()
    ]
    return found


def _drawn(title: str, about: str, y: str, lines: Mapping[str, Line], looks: Mapping[str, Look]) -> _Plot:
    from markupsafe import Markup

    svg = plot(lines, looks, x="time [s]", y=y, says=f"{title} over time, of {', '.join(lines)}", salt=title)
    # matplotlib and `plot` have escaped what is in it.
    return _Plot(title=title, about=about, svg=Markup(svg))


def _figures(value: float) -> str:
    """Three figures, without powers of ten where that can be read."""
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e6:
        return f"{value:.2g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def _decibels(value: float) -> str:
    return "∞" if math.isinf(value) else f"{value:.1f}"


@functools.cache
def _version() -> str:
    try:
        return importlib.metadata.version("gasp-core")
    except importlib.metadata.PackageNotFoundError:
        return ""
