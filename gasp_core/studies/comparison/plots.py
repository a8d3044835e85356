"""Curves of all engines in one plot, as SVG to be put into a page."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

__all__ = ["Line", "Look", "look_of", "plot"]

Array = NDArray[Any]

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Of Okabe and Ito, told apart by eyes of every kind; without yellow, which white swallows."""
_DASHES = ("solid", (0, (5, 1.5)), (0, (2, 1)), (0, (6, 1.5, 1, 1.5)), (0, (1, 1)))
_SIZE = (3.8, 2.6)
"""Inches; at 9 points, text is read where a telephone shows that at its whole width."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How an engine is drawn, wherever it is."""

    colour: str
    dashes: Any


def look_of(index: int) -> Look:
    """Of the engine of this number: colours come again with other dashes."""
    return Look(colour=_COLOURS[index % len(_COLOURS)], dashes=_DASHES[(index + index // len(_COLOURS)) % len(_DASHES)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A curve: x (T,) and y (T,), which may be NaN."""

    x: Array
    y: Array


def plot(lines: Mapping[str, Line], looks: Mapping[str, Look], *, x: str, y: str, says: str, salt: str) -> str:
    """An ``<svg>`` element that takes the width it is given.

    Parameters
    ----------
    lines
        By name, for the legend.
    looks
        By the same.
    x, y
        Labels of the axes, with units.
    says
        What is seen, for those who do not see it.
    salt
        Different for every plot of a page: what one defines another must not use.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    style: Any = {
        "svg.fonttype": "none",
        "svg.hashsalt": salt,
        "font.family": "sans-serif",
        "font.size": 9,
        "text.parse_math": False,  # a name may have any sign in it
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=_SIZE, layout="constrained")
        axes = figure.add_subplot()
        for name, line in lines.items():
            look = looks[name]
            axes.plot(line.x, line.y, color=look.colour, linestyle=look.dashes, linewidth=1.6, label=name)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        figure.legend(loc="outside upper left", ncols=3, frameon=False, fontsize=8, handlelength=2.4, columnspacing=1.0)
        stream = io.StringIO()
        FigureCanvasSVG(figure).print_svg(stream, metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    return _embedded(stream.getvalue(), says)


def _embedded(document: str, says: str) -> str:
    """The element of an SVG document, without a size of its own and without names that come in every plot."""
    from html import escape

    element = document[document.index("<svg") :]
    head, _, rest = element.partition(">")
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    rest = re.sub(r' id="(?:figure|axes|patch|text|line2d|xtick|ytick|legend|matplotlib\.axis)_?\d*"', "", rest)
    return f'{head} role="img" aria-label="{escape(says)}">{rest}'
