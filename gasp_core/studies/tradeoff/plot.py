"""The picture of a trade: error over time."""

from __future__ import annotations

import io
from typing import Any

from gasp_core.studies.tradeoff.report import Row, Tradeoff

__all__ = ["pictures"]

# Told apart by those who see few colours too (Okabe and Ito 2008), and in grey by their markers.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_MARKERS = ("o", "s", "^", "D", "v", "P")


def pictures(tradeoff: Tradeoff) -> dict[str, bytes]:
    """PNG and SVG of a trade with at least one complete setting, by their endings."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "gasp"}):
        # No pyplot: it is the program's that calls us.
        figure: Any = Figure(figsize=(8, 5.2), layout="constrained")
        FigureCanvasAgg(figure)
        _draw(figure.add_subplot(), tradeoff)
        found: dict[str, bytes] = {}
        for ending, options in {"png": {"dpi": 130}, "svg": {"metadata": {"Date": None}}}.items():
            stream = io.BytesIO()
            figure.savefig(stream, format=ending, **options)
            found[ending] = stream.getvalue()
    return found


def _draw(axes: Any, tradeoff: Tradeoff) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    rows = [row for row in tradeoff.rows if row.error is not None]
    fractions = list(dict.fromkeys(row.setting.cores for row in rows))
    kinds = list(dict.fromkeys((row.setting.precision.value, row.setting.substep_fraction) for row in rows))
    several = len({substep for _, substep in kinds}) > 1
    floor = min((row.error for row in rows if row.error), default=1e-6) / 3
    shown: set[str] = set()
    for row in rows:
        assert row.error is not None and row.error_low is not None and row.error_high is not None
        assert row.run is not None
        kind = (row.setting.precision.value, row.setting.substep_fraction)
        cores = "all vertices" if row.setting.fraction is None else f"{100 * row.setting.fraction:g} % cores"
        label = ", ".join([cores, kind[0], *([f"substep {kind[1]:g}"] if several else [])])
        place = (row.run.median, 100 * max(row.error, floor))
        axes.errorbar(
            *place,
            xerr=[[row.run.median - row.run.low], [row.run.high - row.run.median]],
            # An interval that reaches down to nothing ends below the picture.
            yerr=[[place[1] - 100 * max(row.error_low, floor / 3)], [100 * row.error_high - place[1]]],
            fmt=_MARKERS[kinds.index(kind) % len(_MARKERS)],
            color=_COLOURS[fractions.index(row.setting.cores) % len(_COLOURS)],
            markerfacecolor=None if row.on_front else "white",
            elinewidth=0.8,
            capsize=2,
            label=None if label in shown else label,
        )
        shown.add(label)
        axes.annotate(str(row.setting.resolution), place, xytext=(5, 4), textcoords="offset points", size=8)
    _front(axes, [row for row in rows if row.on_front])
    axes.set(xscale="log", yscale="log", xlabel="time of the frames, without the start [s]")
    axes.set_ylabel("error, rms over vertices and frames [% of the diagonal]")
    axes.set_title(
        f"{tradeoff.scene}, {tradeoff.engine['name']}: numbers are cells across, full ones are unbeaten", size=10
    )
    axes.set_ylim(100 * floor, 150 * max(row.error_high or 0.0 for row in rows) or 1.0)
    axes.margins(x=0.08)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(_plain))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize="small", loc="best")


def _plain(value: float, place: int | None) -> str:
    return f"{value:g}"


def _front(axes: Any, rows: list[Row]) -> None:
    """Steps through what is unbeaten: to its right and above it nothing is gained."""
    points = sorted((row.run.median, 100 * row.error) for row in rows if row.run is not None and row.error is not None)
    axes.step([time for time, _ in points], [error for _, error in points], where="post", color="0.5", zorder=0)
