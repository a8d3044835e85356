"""Reports of several engines as one Markdown table: checks by engines.

python -m gasp_conformance.matrix REPORT.json ... [--into README.md]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from gasp_conformance.checks import Level
from gasp_conformance.declarations import base_name
from gasp_conformance.report import CheckResult, Extent, Outcome, Report, ReportError, read_report
from gasp_core.errors import GaspError
from gasp_core.io.atomic import replacing

__all__ = ["BEGIN", "END", "main", "markdown", "spliced"]

BEGIN = "<!-- conformance matrix -->"
END = "<!-- end of matrix -->"


def markdown(reports: Sequence[Report]) -> str:
    """The table, and below it every deviation with its figure and reason.

    A row is a check with all its parameters (of the level capability: all checks of one kind), and says the worst of
    them. The number behind "pass" is the share of its bound that the worst figure used up.

    Raises
    ------
    ReportError
        Where two reports would be one column.
    """
    columns = [_title(report) for report in reports]
    for title in columns:
        if columns.count(title) > 1:
            raise ReportError(f"two reports of {title}: name one of them")
    lines = [f"| check | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for level in Level:
        rows = list(dict.fromkeys(_row(one) for report in reports for one in report.checks if one.level is level))
        if not rows:
            continue
        lines.append(f"| **{level.value}** |{' |' * len(columns)}")
        for row in sorted(rows, key=_natural):
            cells = (
                _cell([one for one in report.checks if one.level is level and _row(one) == row]) for report in reports
            )
            lines.append(f"| {row} | {' | '.join(cells)} |")
    verdicts = (f"**{report.verdict.outcome.value}**" for report in reports)
    lines.append(f"| **verdict** | {' | '.join(verdicts)} |")
    notes = [note for report in reports for note in _notes(report)]
    return "\n".join([*lines, "", *notes]).rstrip() + "\n"


def spliced(text: str, table: str, where: str) -> str:
    """`text` with what stands between the two marks replaced.

    Raises
    ------
    ReportError
        Where the marks are not there once each, in their order.
    """
    begin, end = text.find(BEGIN), text.find(END)
    if text.count(BEGIN) != 1 or text.count(END) != 1 or begin > end:
        raise ReportError(f"{where} must hold the lines {BEGIN} and {END} once each, in this order: put them there")
    return f"{text[: begin + len(BEGIN)]}\n{table}{text[end:]}"


@click.command()
@click.argument("files", metavar="REPORT.json...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--into",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help=f"Replace what stands in FILE between {BEGIN} and {END}, instead of printing it.",
)
def main(files: tuple[Path, ...], into: Path | None) -> None:
    """Print reports of the suite as one Markdown table."""
    try:
        table = markdown([read_report(file) for file in files])
        if into is None:
            click.echo(table, nl=False)
            return
        text = spliced(into.read_text(encoding="utf-8"), table, str(into))
        with replacing(into) as stream:
            stream.write(text.encode())
    except GaspError as error:
        raise click.ClickException(str(error)) from error
    except (OSError, UnicodeDecodeError) as error:
        raise click.ClickException(f"{into}: cannot be read: {error}") from error


def _title(report: Report) -> str:
    device = "" if report.engine.device == "cpu" else f", {report.engine.device}"
    extent = ", quick" if report.extent is Extent.QUICK else ""
    return f"{report.engine.name} {report.engine.precision}{device}{extent}"


def _row(result: CheckResult) -> str:
    name = base_name(result.name)
    return name.partition(":")[0] if result.level is Level.CAPABILITY else name


def _natural(row: str) -> tuple[str, int, str]:
    """V2 before V10."""
    letters = row.rstrip("0123456789")
    return letters, int(row[len(letters) :] or 0), row


def _cell(results: Sequence[CheckResult]) -> str:
    """The worst of the checks of a row."""
    if not results:
        return ""
    outcomes = {result.outcome for result in results}
    if any(outcome.fails for outcome in outcomes):
        return "**fails**"
    if Outcome.DEVIATES in outcomes:
        return "deviates"
    if Outcome.PASSED in outcomes:
        share = _worst_share(results)
        return "pass" if share is None else f"pass {share:.2g}"
    return "not declared" if Outcome.UNDECLARED in outcomes else "not run"


def _worst_share(results: Iterable[CheckResult]) -> float | None:
    shares = [result.worst.share for result in results if result.worst is not None]
    return max(shares, default=None)


def _notes(report: Report) -> list[str]:
    found: list[str] = []
    for result in report.checks:
        if result.outcome is Outcome.DEVIATES:
            figure = "" if result.worst is None or math.isnan(result.worst.value) else f": {result.worst}"
            found.append(f"- {_title(report)}, {result.name}{figure}. {result.reason}")
    return found


if __name__ == "__main__":
    main()
