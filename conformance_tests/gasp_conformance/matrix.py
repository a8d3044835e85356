"""Reports of several engines as one Markdown table: checks by engines.

python -m gasp_conformance.matrix REPORT.json ... [--into README.md]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import click

from gasp_conformance.checks import Level
from gasp_conformance.declarations import base_name
from gasp_conformance.report import CheckResult, Extent, Outcome, Report, ReportError, read_report
from gasp_core.errors import GaspError
from gasp_core.io.atomic import replacing

__all__ = ["BEGIN", "END", "Column", "columns_of", "main", "markdown", "spliced"]

BEGIN = "<!-- conformance matrix -->"
END = "<!-- end of matrix -->"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """What a table says of an engine.

    Parameters
    ----------
    title
        The engine, its precision, its device unless that is the CPU, and whatever else it was run with.
    cells
        By level and row.
    verdict
        The outcome of all.
    notes
        Lines below the table: deviations with their figures and reasons.
    """

    title: str
    cells: Mapping[tuple[str, str], str]
    verdict: str
    notes: tuple[str, ...]

    @classmethod
    def of(cls, report: Report) -> Column:
        """A report as a column.

        A row is a check with all its parameters (of the level capability: all checks of one kind), and says the worst
        of them. The number behind "pass" is the share of its bound that the worst figure used up.
        """
        groups: dict[tuple[str, str], list[CheckResult]] = {}
        for one in report.checks:
            groups.setdefault((one.level.value, _row(one)), []).append(one)
        return cls(
            title=_title(report),
            cells={place: _cell(results) for place, results in groups.items()},
            verdict=report.verdict.outcome.value,
            notes=tuple(_notes(report)),
        )


def markdown(columns: Sequence[Column]) -> str:
    """The table in the order of titles, and below it every deviation.

    Raises
    ------
    ReportError
        Where two columns have one title.
    """
    titles = [column.title for column in columns]
    for title in titles:
        if titles.count(title) > 1:
            raise ReportError(f"two reports of {title}: name one of them")
    columns = sorted(columns, key=attrgetter("title"))
    lines = [f"| check | {' | '.join(column.title for column in columns)} |", "|---" * (len(columns) + 1) + "|"]
    for level in Level:
        rows = {row for column in columns for found, row in column.cells if found == level.value}
        if rows:
            lines.append(f"| **{level.value}** |{' |' * len(columns)}")
        for row in sorted(rows, key=_natural):
            cells = (column.cells.get((level.value, row), "") for column in columns)
            lines.append(f"| {row} | {' | '.join(cells)} |")
    lines.append(f"| **verdict** | {' | '.join(f'**{column.verdict}**' for column in columns)} |")
    notes = [note for column in columns for note in column.notes]
    return "\n".join([*lines, "", *notes]).rstrip() + "\n"


def columns_of(table: str) -> list[Column]:
    """What `markdown` was given, from what it made; none where that is no such table.

    Raises
    ------
    ReportError
        Where a row has not as many cells as the first.
    """
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("|")]
    if not rows:
        return []
    titles = rows[0][1:]
    cells: list[dict[tuple[str, str], str]] = [{} for _ in titles]
    verdicts = [""] * len(titles)
    level = ""
    for name, *found in rows[2:]:
        if len(found) != len(titles):
            raise ReportError(f'the table has {len(found)} cells in the row "{name}", {len(titles)} columns: remove it')
        if name == "**verdict**":
            verdicts = [verdict.strip("*") for verdict in found]
        elif name.startswith("**"):
            level = name.strip("*")
        else:
            for column, cell in zip(cells, found):
                if cell:
                    column[level, name] = cell
    notes: dict[str, list[str]] = {title: [] for title in titles}
    for line in table.splitlines():
        # "engine float64, cuda" begins as "engine float64" does.
        owners = [title for title in titles if line.startswith(f"- {title}, ")]
        if owners:
            notes[max(owners, key=len)].append(line)
    return [
        Column(title=title, cells=own, verdict=verdict, notes=tuple(notes[title]))
        for title, own, verdict in zip(titles, cells, verdicts)
    ]


def spliced(text: str, columns: Sequence[Column], where: str) -> str:
    """`text` with these columns in the table between the two marks; others that stand there stay as they are.

    Raises
    ------
    ReportError
        Where the marks are not there once each, in their order.
    """
    begin, end = text.find(BEGIN), text.find(END)
    if text.count(BEGIN) != 1 or text.count(END) != 1 or begin > end:
        raise ReportError(f"{where} must hold the lines {BEGIN} and {END} once each, in this order: put them there")
    begin += len(BEGIN)
    titles = {column.title for column in columns}
    kept = [column for column in columns_of(text[begin:end]) if column.title not in titles]
    return f"{text[:begin]}\n{markdown([*kept, *columns])}{text[end:]}"


@click.command()
@click.argument("files", metavar="REPORT.json...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--into",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help=f"Put the columns into the table in FILE between {BEGIN} and {END}, instead of printing them; those of engines"
    " without a report stay.",
)
def main(files: tuple[Path, ...], into: Path | None) -> None:
    """Print reports of the suite as one Markdown table."""
    try:
        columns = [Column.of(read_report(file)) for file in files]
        if into is None:
            click.echo(markdown(columns), nl=False)
            return
        text = spliced(into.read_text(encoding="utf-8"), columns, str(into))
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
