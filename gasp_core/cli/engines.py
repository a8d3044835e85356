"""``gasp engines``: what is installed, what it can do, what failed to load and why; and environments of their own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.printing import print_json, print_table

if TYPE_CHECKING:
    from gasp_core.discovery.status import EngineRow

__all__ = ["engines", "install", "remove"]


@click.group(
    invoke_without_command=True,
    epilog="""\b
Examples:
  gasp engines
  gasp engines --json | jq '.engines[] | select(.status == "ready") | .name'
  gasp engines install blender

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

    rows = engine_rows(discover())
    if as_json:
        print_json({"engines": [row.to_json() for row in rows]})
    elif rows:
        _print_for_people(rows)
    else:
        click.echo("No engine is installed. To get one: pip install gasp-warp-mpm")


@engines.command()
@click.argument("name")
@click.option(
    "--python",
    metavar="PATH",
    type=click.Path(path_type=Path),
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
