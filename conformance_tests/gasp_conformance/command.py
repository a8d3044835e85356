"""``gasp conformance``: the suite in a process of its own, and what becomes of that process."""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import click

__all__ = ["conformance"]

PASSES = 0
FAILS = 1
USAGE_ERROR = 2
PARTIAL = 3
"""Exit status where nothing failed, but only a selection was run."""


@click.command(
    epilog="""\b
Examples:
  gasp-conformance my-engine --quick
  gasp-conformance my-engine --precision float32 --json my-engine.json
  gasp-conformance my-engine --device cuda
  gasp-conformance my-engine -k "core or V12"
  gasp-conformance my-engine --write-scene "V8[4 cells]"
  gasp-conformance --list

\b
Exit status: 0 the engine passes, 1 it fails, 2 the command could not be
carried out, 3 nothing failed but -k left checks out, 130 interrupted.
Interrupted, or ended by SIGTERM, it still says and writes what it found.
A check that is known to fail goes into gasp-conformance.toml in the
engine's package; core checks cannot be excused.
"""
)
@click.argument("engine", required=False)
@click.option("--quick", is_flag=True, help="Leave out the checks that take long.")
@click.option(
    "--json",
    "report_file",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write what was found there, too.",
)
@click.option(
    "--precision",
    type=click.Choice(["float32", "float64"]),
    help="Precision to run the engine in.  [default: the first it declares]",
)
@click.option("--device", metavar="DEVICE", help="Device to run the engine on.  [default: the first it declares]")
@click.option("--oracle", metavar="NAME", help="An engine of the same method, to compare it with point by point.")
@click.option("--isolate", is_flag=True, help="Open every session in a process of its own, as gasp run --isolate does.")
@click.option(
    "--write-scene",
    "written",
    metavar="CHECK",
    help="Run that check alone, and write what it gives to the engine into a folder here: a script a session, which"
    " does the same without the suite.",
)
@click.option("-k", "expression", metavar="EXPR", help="Only checks whose names match; the verdict is then partial.")
@click.option("--list", "listing", is_flag=True, help="List the checks and run none.")
@click.pass_context
def conformance(
    context: click.Context,
    engine: str | None,
    quick: bool,
    report_file: Path | None,
    precision: str | None,
    device: str | None,
    oracle: str | None,
    isolate: bool,
    written: str | None,
    expression: str | None,
    listing: bool,
) -> None:
    """Put an engine through the checks that every engine has to pass.

    ENGINE is its name as "gasp engines" lists it. The checks run in a process of their own, in an empty folder: no
    file of yours changes what they do.
    """
    from gasp_conformance.process import NOTHING_MATCHED, USAGE, SuiteInterrupted, run_suite
    from gasp_core.processes.scratch import scratch_folder

    if engine is None and not listing:
        raise click.UsageError("name the engine to look at, or --list the checks")
    if report_file is not None and not os.access(report_file.absolute().parent, os.W_OK):
        # Not minutes later.
        raise click.UsageError(f"{report_file} cannot be written: name a file in a folder that may be written to")
    options = [
        f"--gasp-{option}={value}"
        for option, value in (("engine", engine), ("precision", precision), ("device", device), ("oracle", oracle))
        if value is not None
    ]
    if isolate:
        options.append("--gasp-isolate")
    if quick:
        options.append("--gasp-quick")
    if written is not None:
        where = Path.cwd() / "-".join(re.findall(r"[a-z0-9]+", written.casefold()))
        if where.exists():
            raise click.UsageError(f"{where.name} is there already: move it away")
        options += [f"--gasp-write-scene={written}", f"--gasp-scenes={where}"]
    if expression is not None:
        options += ["-k", expression]
    with scratch_folder("gasp-conformance-") as folder:
        if listing:
            status = run_suite([*options, "--gasp-list", "-q"], folder)
            context.exit(USAGE_ERROR if status == USAGE else 0)
        found = folder / "report.json"
        try:
            status = run_suite([*options, f"--gasp-report={found}"], folder)
        except SuiteInterrupted as interrupted:
            if found.exists():
                _conclude(interrupted.status, found, report_file, interrupted=True)
            raise
        if status == USAGE:
            context.exit(USAGE_ERROR)
        if status == NOTHING_MATCHED:
            raise click.UsageError(f'no check matches -k "{expression}"; --list shows their names')
        context.exit(_conclude(status, found, report_file))


def _conclude(status: int, found: Path, wanted: Path | None, *, interrupted: bool = False) -> int:
    """Read what the process left, say what it could not say itself, and return the exit status."""
    from gasp_conformance.process import is_orderly
    from gasp_conformance.report import Verdict, VerdictOutcome, read_report, write_report
    from gasp_conformance.table import report_lines
    from gasp_core.processes.exit_report import ending

    if not found.exists():
        click.secho(f"fails: the process {ending(status)} before any check", fg="red")
        return FAILS
    report = read_report(found)
    if not (report.finished and is_orderly(status)):
        where = "after the last check" if report.finished else f"in check {report.running}"
        # What did not end when it was interrupted was killed by us, and not for a fault of its own.
        how = "was interrupted" if interrupted else ending(status)
        reasons = *(report.verdict.reasons if report.finished else ()), f"the process {how} {where}"
        report = replace(report, verdict=Verdict(outcome=VerdictOutcome.FAILS, reasons=reasons))
        click.echo()
        for line in report_lines(report, _terminal_width()):
            click.secho(line.text, fg=line.colour)
    if wanted is not None:
        write_report(report, wanted)
    return {VerdictOutcome.PASSES: PASSES, VerdictOutcome.FAILS: FAILS, VerdictOutcome.PARTIAL: PARTIAL}[
        report.verdict.outcome
    ]


def _terminal_width() -> int | None:
    """Of stdout; None where that is no terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None
