"""``gasp sweep``: one scene with many settings, and a table of what came of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.backends import Makers, makers_options
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.printing import print_json, print_table
from gasp_core.cli.run_path import PathHere, RunPath, keep_at_option
from gasp_core.cli.settings import PRECISIONS, device_option
from gasp_core.cli.trust_code import code_is_trusted, trust_code_option

if TYPE_CHECKING:
    from gasp_core.studies.sweep import Planned, Row, Sweep

__all__ = ["sweep"]

_MOST_SHOWN = 30
"""Rows of a table on the terminal."""
_MOST_REFUSED = 5
"""Settings of a preview that no scene has."""


@click.command(
    epilog="""\b
Examples:
  gasp sweep scene.toml --set object.plant.material.youngs_modulus=1e4,1e5,1e6 --preview
  gasp sweep scene.toml --set accuracy.resolution=24,48 --set engine.name=warp-mpm,taichi-mpm
  gasp sweep scene.toml --zip --set scene.gravity=[0,0,-9.81],[0,0,-1.62] --set scene.duration=1,3
  gasp sweep scene.toml --table settings.csv --reference fine.gasp --observe mine.py:tip
  gasp sweep scene.toml --table settings.csv --backend dask --scheduler tcp://head:8786

\b
A table of settings has keys of the scene in its first line, a run a line below.
A function of your own gives a number of a run, and is run where the run is:
  def tip(recording):                         # gasp.Recording
      return recording.points(recording.frame_count - 1)[:, 2].max()

\b
FOLDER/sweep.csv (and .parquet, with pyarrow) has a line a run: what was set,
how it ended, frames, substeps, times, memory, points; of each object the
middle of its points at the end, the lowest and the highest of them, and how
far one has gone at most; what you observe; distances from the reference, in
shares of the diagonal, and when they are first beyond 1 %. Rows that are there
stay: the same command goes on after Ctrl-C, a crash or a lost machine; those of
settings that are not named again stay in FOLDER/sweep.jsonl. Exit status: 0
where at least one run came to its end, else 2.
"""
)
@click.argument("scene", type=PathHere())
@click.option(
    "--set",
    "changes",
    metavar="KEY=V,V,..",
    multiple=True,
    help="Values of a key of the scene file; of several keys every combination.",
)
@click.option("--zip", "zipped", is_flag=True, help="The first values of all keys, the second of all, and so on.")
@click.option("--table", metavar="FILE.csv", type=PathHere(), help="Settings, a run a line, instead of --set.")
@click.option("--engine", metavar="NAME", help='Of all runs, instead of the scene\'s; "gasp engines" lists them.')
@device_option
@click.option("--precision", type=click.Choice(PRECISIONS), help="Of the engine's numbers.")
@click.option("--reference", metavar="RUN", type=RunPath(), help="A recording that distances are measured from.")
@click.option("--observe", metavar="FILE.py:FUNCTION", multiple=True, help="A number of each run, as a column.")
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=PathHere(),
    help="Where the table goes. [default: the scene's name with .sweep, in the current folder]",
)
@click.option("--keep", is_flag=True, help="Keep the recordings, in FOLDER/runs.")
@keep_at_option
@click.option(
    "--preview", "--dry-run", is_flag=True, help="Only say how many runs, points, hours and bytes it will be."
)
@makers_options("Runs at a time. [default: the processors, by --threads]")
@most_memory_option
@trust_code_option
@click.option("--overwrite", is_flag=True, help="Make all runs anew, and replace the table.")
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON, and no progress.")
def sweep(
    scene: Path, changes: tuple[str, ...], zipped: bool, table: Path | None, engine: str | None, device: str | None,
    precision: str | None, reference: Path | None, observe: tuple[str, ...], out: Path | None, keep: bool,
    keep_at: str | None, preview: bool, makers: Makers, trust_code: bool, overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Run a scene with many settings: a table with a row a run.

    SCENE is a TOML file, as for "gasp run". Each run is in a process of its own; one that crashes, diverges or is
    refused is a row with its reason, and the others go on.
    """
    from gasp_core.contract import Precision
    from gasp_core.errors import AccuracyError
    from gasp_core.recording import Recording
    from gasp_core.studies.sweep import Measures, load_observable, planned, settings_from_table, settings_of
    from gasp_core.studies.sweep import sweep as carry_out

    if (table is None) == (not changes):
        raise click.UsageError("what is to be set? --set KEY=V,V,.. or --table FILE.csv, one of the two")
    if table is not None and zipped:
        raise click.UsageError("--zip is of --set: a table says its combinations itself")
    settings = settings_of(changes, zipped=zipped) if table is None else settings_from_table(table)
    at_once = makers.at_once()
    backend, limits = makers.chosen(at_once), makers.limits(at_once)
    observables = tuple(map(load_observable, observe))
    if reference is not None:
        Recording.open(reference)
    plan = planned(
        scene, settings, engine=engine, device=device, precision=None if precision is None else Precision(precision)
    )
    trusted = _trusted(plan, trust_code)
    if preview:
        _preview(plan, at_once, trusted, keep=keep, as_json=as_json)
        return
    folder = Path(scene.stem + ".sweep") if out is None else out
    try:
        found = carry_out(
            plan,
            folder,
            measures=Measures(observables=observables, reference=None if reference is None else reference.absolute()),
            backend=backend,
            limits=limits,
            keep=keep,
            keep_at=keep_at or "",
            overwrite=overwrite,
            trust_code=trusted,
            progress=False if as_json else "log",
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; the rows so far are kept in {folder}: the same command goes on") from None
    if as_json:
        print_json({"folder": str(folder), "rows": [row.cells() for row in found.rows]})
    else:
        _print_for_people(found, [own.name for own in observables])
    if not found.completed:
        first = found.rows[0]
        raise AccuracyError(f"no run came to its end: {first.status}: {first.columns.get('reason', '')}")


def _trusted(plan: list[Planned], said: bool) -> bool:
    """Whether all code may run that the scenes name; asked once for each that names some."""
    from gasp_core.scene.named_code import code_of

    trusted, asked = said, set[str]()
    for each in plan:
        if each.scene is not None and code_of(each.scene):
            names = " ".join(own.where() for own in code_of(each.scene))
            if names not in asked:
                asked.add(names)
                trusted = code_is_trusted(each.scene, said)
    return trusted


def _preview(plan: list[Planned], at_once: int, trusted: bool, *, keep: bool, as_json: bool) -> None:
    from gasp_core.progress import duration
    from gasp_core.simulation.estimate import EITHER_WAY
    from gasp_core.studies.sweep.preview import previewed

    found = previewed(plan, at_once=at_once, trust_code=trusted)
    if as_json:
        print_json(
            {
                "runs": found.runs, "refused": [each.reason for each in found.refused], "points": list(found.points),
                "seconds": found.seconds, "memory": found.memory, "disk": found.disk if keep else 0,
            }
        )  # fmt: skip
        return
    few, most = found.points
    rows = {
        "runs": f"{found.runs:,}, {at_once} at a time; {found.tried} of them were begun to tell the rest",
        "refused": f"{len(found.refused):,}, see below" if found.refused else "none",
        "points": f"{few:,} to {most:,}" if few < most else f"{few:,}",
        "memory": f"{found.memory / 1e6:,.0f} MB each",
        "disk": f"{found.disk / 1e6:,.0f} MB"
        if keep
        else f"a table (--keep keeps recordings, {found.disk / 1e6:,.0f} MB)",
        "time": f"{duration(found.seconds)}, between {duration(found.seconds / EITHER_WAY)} and"
        f" {duration(found.seconds * EITHER_WAY)} probably, where one run takes what those take",
    }
    for name, value in rows.items():
        click.echo(f"{name:9}{value}")
    for each in found.refused[:_MOST_REFUSED]:
        click.echo(f"\nrefused: {', '.join(each.setting.changes)}\n  {each.reason}")
    if len(found.refused) > _MOST_REFUSED:
        click.echo(f"\n... and {len(found.refused) - _MOST_REFUSED:,} more are refused")


def _print_for_people(found: Sweep, observed: Collection[str]) -> None:
    keys = list(dict.fromkeys(key for row in found.rows for key in row.setting.values))
    several = [key for key in keys if len({row.setting.values.get(key) for row in found.rows}) > 1] or keys
    header = [*(key.rpartition(".")[2] for key in several), "STATUS", "SUBSTEPS", "RUN s", "MEMORY MB"]
    shown = found.rows[:_MOST_SHOWN]
    extra = [
        name
        for name in dict.fromkeys(name for row in shown for name in row.columns)
        if name in observed or name.endswith((".moved", "rms_share", "apart_at"))
    ]
    print_table([*header, *extra], [_cells(row, several, extra) for row in shown])
    if len(found.rows) > len(shown):
        click.echo(f"... and {len(found.rows) - len(shown):,} more")
    said = (row.columns.get(name) for row in found.rows for name in ("reason", "not_compared", "not_observed"))
    reasons = Counter(str(each) for each in said if each)
    for reason, count in reasons.most_common(5):
        click.echo(f"\n{count} x {reason}" if count > 1 else f"\n{reason}")
    done = Counter(row.status for row in found.rows)
    counts = ", ".join(f"{count:,} {status}" for status, count in done.items())
    was_there = f"; {found.kept:,} were there already" if found.kept else ""
    tables = "sweep.csv and sweep.parquet" if found.parquet else "sweep.csv (with pyarrow, sweep.parquet too)"
    click.echo(f"\n{counts}{was_there}\n{found.folder}: {tables}")
    if found.others:
        click.echo(
            f"rows of other settings, in sweep.jsonl alone: {found.others:,}; name their values too, and they are in"
            " the tables, and not run again"
        )


def _cells(row: Row, keys: list[str], extra: list[str]) -> list[str]:
    columns = row.columns

    def number(name: str, digits: str, unit: float | None = None) -> str:
        value: Any = columns.get(name)
        return "-" if value is None else f"{value if unit is None else value / unit:{digits}}"

    cells = [row.setting.values.get(key, "-") for key in keys]
    cells += [row.status, number("substeps", "d"), number("run_seconds", ".2f"), number("peak_bytes", ".0f", 1e6)]
    return [*cells, *(number(name, ".3g") for name in extra)]
