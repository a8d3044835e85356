"""``gasp engines``: what is installed, what it can do, what does not load and why; environments; a new engine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.printing import print_json, print_table
from gasp_core.cli.run_path import PathHere

if TYPE_CHECKING:
    from gasp_core.discovery.registry import Registry
    from gasp_core.discovery.status import EngineRow

__all__ = ["check", "engines", "install", "new", "remove"]


@click.group(
    invoke_without_command=True,
    epilog="""\b
Examples:
  gasp engines
  gasp engines --json | jq '.engines[] | select(.status == "ready") | .name'
  gasp engines check                   really load each one
  gasp engines install blender
  gasp engines new my-engine           begin to write one

\b
An engine is a plugin: "pip install" it and it is listed here. One that is
broken is listed with the reason, and the others go on working. One whose
backend cannot live beside the others has an environment of its own, which
"gasp engines install" builds.
""",
)
@click.option("--json", "as_json", is_flag=True, help="Print everything each engine declares, as JSON.")
@click.pass_context
def engines(context: click.Context, as_json: bool) -> None:
    """List the engines: what they can do, and which are broken."""
    if context.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError("--json is of the list alone: leave it out")
        return
    from gasp_core.discovery.registry import discover
    from gasp_core.discovery.status import engine_rows

    _print(engine_rows(discover()), as_json)


@engines.command(
    epilog="""\b
Examples:
  gasp engines check
  gasp engines check my-engine
  gasp engines check my-engine --limit 600

\b
Exit status: 0 where every engine shown is ready, 1 where one is not.
"""
)
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "--limit",
    type=click.FloatRange(min=0, min_open=True),
    default=120.0,
    show_default=True,
    metavar="SECONDS",
    help="How long one engine may take to load before it is given up.",
)
@click.option("--json", "as_json", is_flag=True, help="Print everything each engine declares, as JSON.")
@click.pass_context
def check(context: click.Context, names: tuple[str, ...], limit: float, as_json: bool) -> None:
    """Load each engine, and say which ones fail.

    The list alone tells "ready" from what is installed, and imports no engine. Here the code behind each one that is
    listed as ready is imported and its engine made, backend and all, each in a process of its own. Nothing is
    simulated: that is for "gasp-conformance NAME --quick".
    """
    from gasp_core.discovery.registry import discover
    from gasp_core.discovery.status import engine_rows

    registry = discover()
    rows = engine_rows(registry)
    for name in names:
        if all(row.name != name for row in rows):
            registry.offer(name)
    rows = [_tried(registry, row, limit) for row in rows if not names or row.name in names]
    _print(rows, as_json)
    context.exit(0 if all(row.status == "ready" for row in rows) else 1)


@engines.command(
    epilog="""\b
What is written:
  my-engine/pyproject.toml             tells GASP of the engine
  my-engine/my_engine/plugin.py        its name, and what it can do
  my-engine/my_engine/engine.py        opens sessions, and steps them
  my-engine/my_engine/motion.py        the physics, to be replaced by yours
  my-engine/tests/test_my_engine.py
  my-engine/README.md                  what to do next

\b
Then:
  cd my-engine
  pip install -e .
  gasp engines check my-engine
  gasp-conformance my-engine --quick
"""
)
@click.argument("name")
def new(name: str) -> None:
    """Begin to write an engine of your own.

    NAME is the engine's name as users will write it, in small letters, with hyphens between words; the folder NAME is
    made in the current one. What is in it is an engine already: rigid bodies in free flight, which pass every check of
    what they declare. Put your own physics in the place of theirs, one function at a time, and let gasp-conformance
    say what broke.
    """
    from gasp_core.cli.new_engine import write_engine

    home = write_engine(name, Path())
    click.echo(f"{home} is written. Next:\n")
    for command in (f"cd {home}", "pip install -e .", f"gasp engines check {name}", f"gasp-conformance {name} --quick"):
        click.echo(f"  {command}")
    click.echo("\nREADME.md there says what to change.")


@engines.command()
@click.argument("name")
@click.option(
    "--python",
    metavar="PATH",
    type=PathHere(),
    help="Interpreter to build it with.  [default: this one if it fits, else one on the PATH or of uv]",
)
def install(name: str, python: Path | None) -> None:
    """Build the environment that an engine runs in.

    NAME is an engine that "gasp engines" lists as "not installed" or "outdated". Its packages are installed into a
    folder of its own under your data folder, or under GASP_ENVIRONMENTS. Ctrl-C stops it; the same command begins anew.
    """
    from gasp_core.discovery.registry import discover
    from gasp_core.engines.installation import install as build

    build(discover().descriptor(name), click.echo, python)


@engines.command()
@click.argument("name")
def remove(name: str) -> None:
    """Remove the environment that an engine runs in."""
    from gasp_core.discovery.registry import discover
    from gasp_core.engines.installation import remove as take_away

    gone = take_away(discover().descriptor(name))
    click.echo(f"the environment of {name} is removed" if gone else f"{name} has no environment here")


def _tried(registry: Registry, row: EngineRow, limit: float) -> EngineRow:
    """The row of an engine that is listed as ready, once it has been loaded; any other as it is."""
    from gasp_core.engines.trial import loading_fault

    if row.status != "ready":
        return row
    fault = loading_fault(registry.offer(row.name), limit)
    return row if fault is None else replace(row, status="failed", error=fault)


def _print(rows: list[EngineRow], as_json: bool) -> None:
    if as_json:
        print_json({"engines": [row.to_json() for row in rows]})
    elif rows:
        _print_for_people(rows)
    else:
        click.echo("No engine is installed. To get one: pip install gasp-warp-mpm")


def _print_for_people(rows: list[EngineRow]) -> None:
    table: list[list[str]] = []
    for row in rows:
        said = row.to_json()
        table.append(
            [
                row.name,
                row.status,
                " ".join(said.get("devices", [])) or "-",
                " ".join(said.get("precisions", [])) or "-",
                " ".join(said.get("materials", [])) or "-",
            ]
        )
    print_table(["ENGINE", "STATUS", "DEVICES", "PRECISION", "MATERIALS"], table)
    troubled = [row for row in rows if row.error is not None]
    for row in troubled:
        click.echo(f"\n{row.name} (of {row.distribution}): {row.error}")
