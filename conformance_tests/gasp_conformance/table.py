"""A report as lines of text, as wide as a terminal, or as long as they are where nobody has said how wide."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from gasp_conformance.report import CheckResult, Outcome, Report, VerdictOutcome

__all__ = ["Line", "report_lines"]

NARROWEST = 100
_WIDEST_NAME = 0.4
"""Of the width."""

_ENDLESS = 1_000_000

Colour = Literal["green", "red", "yellow"]

_COLOURS: dict[Outcome, Colour | None] = {
    Outcome.PASSED: None,
    Outcome.FAILED: "red",
    Outcome.DEVIATES: "yellow",
    Outcome.STALE: "red",
    Outcome.UNDECLARED: None,
    Outcome.SKIPPED: "yellow",
    Outcome.ERROR: "red",
}
_VERDICT_COLOURS: dict[VerdictOutcome, Colour] = {
    VerdictOutcome.PASSES: "green",
    VerdictOutcome.FAILS: "red",
    VerdictOutcome.PARTIAL: "yellow",
}


@dataclass(frozen=True, slots=True)
class Line:
    """One line; `colour` where it should stand out on a terminal that can."""

    text: str
    colour: Colour | None = None


def report_lines(report: Report, width: int | None = None) -> Iterator[Line]:
    """A table of checks with their worst figures, what did not pass and why, and the verdict.

    Parameters
    ----------
    width
        Of the lines; `NARROWEST` at least. None, for a file or a pipe: nothing is shortened or broken.
    """
    width = _ENDLESS if width is None else max(width, NARROWEST)
    if report.checks:
        yield from _table(report.checks, width)
        yield Line("")
    for result in report.checks:
        if result.outcome.fails or result.outcome is Outcome.DEVIATES:
            told = f"{result.name} {result.outcome.value}: {result.reason}"
            yield from _wrapped(told, width, _COLOURS[result.outcome])
    for one in report.unproven:
        if one.excused:
            yield from _wrapped(f"{one.capability} not shown: {one.reason}", width, "yellow")
    yield from _verdict(report, width)


def _table(results: tuple[CheckResult, ...], full: int) -> Iterator[Line]:
    width = min(int(_WIDEST_NAME * full), max(len("CHECK"), *(len(result.name) for result in results)))
    yield Line(f"{'LEVEL':<12}  {'CHECK':<{width}}  {'OUTCOME':<10}  WORST FIGURE, BOUND")
    for result in results:
        left = f"{result.level.value:<12}  {_cut(result.name, width):<{width}}  {result.outcome.value:<10}  "
        yield Line((left + _finding(result, full - len(left))).rstrip(), _COLOURS[result.outcome])


def _finding(result: CheckResult, width: int) -> str:
    """The worst figure, or else why there is none."""
    worst = result.worst
    if worst is None:
        return _cut(result.reason, width)
    numbers = str(worst).removeprefix(worst.figure)
    return _cut(worst.figure, max(8, width - len(numbers))) + numbers


def _verdict(report: Report, width: int) -> Iterator[Line]:
    engine, verdict = report.engine, report.verdict
    colour = _VERDICT_COLOURS[verdict.outcome]
    counts = Counter(result.outcome for result in report.checks)
    tally = ", ".join(f"{counts[outcome]} {outcome.value}" for outcome in Outcome if counts[outcome])
    said = {
        VerdictOutcome.PASSES: "passes",
        VerdictOutcome.FAILS: "fails",
        VerdictOutcome.PARTIAL: "partial, no verdict",
    }[verdict.outcome]
    yield from _wrapped(
        f"{engine.name} ({engine.precision}, {engine.device}, {report.extent.value}): {said}"
        f" ({tally or 'nothing ran'})",
        width,
        colour,
    )
    for reason in verdict.reasons:
        yield from _wrapped(f"- {reason}", width, colour)


def _wrapped(text: str, width: int, colour: Colour | None) -> Iterator[Line]:
    for line in textwrap.wrap(text, width, subsequent_indent="  ", break_on_hyphens=False):
        yield Line(line, colour)


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"
