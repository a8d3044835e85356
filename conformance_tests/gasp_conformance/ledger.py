"""Where a check writes down what it measured, beside what it was allowed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

__all__ = ["FIGURE", "NOTE", "Figure", "Ledger"]

FIGURE = "gasp figure"
"""Name of the pytest properties of a check that are `Figure`s."""
NOTE = "gasp note"
"""Of those that are text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measured number beside its bound.

    Parameters
    ----------
    case
        What was run, e.g. "V8 4 cells".
    figure
        What was measured, with its unit.
    value
        Signed, as measured.
    bound
        What is allowed.
    sense
        "<=" where |value| may be at most `bound`, ">=" where value has to be at least that.
    """

    case: str
    figure: str
    value: float
    bound: float
    sense: Literal["<=", ">="]

    @property
    def holds(self) -> bool:
        """Whether it keeps its bound; what is not a number keeps none."""
        return abs(self.value) <= self.bound if self.sense == "<=" else self.value >= self.bound

    @property
    def share(self) -> float:
        """How much of what is allowed is used up, >= 0: above 1 the bound is broken; infinite for a NaN."""
        if math.isnan(self.value):
            return math.inf
        used, allowed = (abs(self.value), self.bound) if self.sense == "<=" else (self.bound, self.value)
        if used <= 0:
            return 0.0 if self.holds else math.inf
        return used / allowed if allowed > 0 else math.inf

    def __str__(self) -> str:
        return f"{self.figure} {self.shown} {self.sense} {self.bound:.5g}"

    @property
    def shown(self) -> str:
        """The value as it is judged: between bars where that is its magnitude, and shows."""
        return f"|{self.value:.4g}|" if self.sense == "<=" and self.value < 0 else f"{self.value:.4g}"


class Ledger:
    """Records what a case measured beside what it was allowed, and holds the one against the other."""

    def __init__(self, record: Callable[[str, object], None]) -> None:
        self._record = record

    def at_most(self, case: str, figure: str, value: float, bound: float) -> None:
        """|value| <= bound."""
        self._enter(Figure(case=case, figure=figure, value=float(value), bound=float(bound), sense="<="))

    def at_least(self, case: str, figure: str, value: float, bound: float) -> None:
        """Value >= bound."""
        self._enter(Figure(case=case, figure=figure, value=float(value), bound=float(bound), sense=">="))

    def note(self, text: str) -> None:
        """Text that the report keeps, which no terminal has room for."""
        self._record(NOTE, text)

    def _enter(self, entry: Figure) -> None:
        self._record(FIGURE, entry)
        assert entry.holds, f"{entry.case}: {entry.figure} is {entry.shown}, bound {entry.bound:.4g}"
