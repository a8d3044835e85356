"""``gasp engines``: what is installed, what it can do, and what failed to load and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gasp_core.cli.printing import print_json, print_table

if TYPE_CHECKING:
    from gasp_core.engine.listing import EngineRow

__all__ = ["engines"]


@click.command(
    epilog="""\b
Examples:
  gasp engines
  gasp engines --json | jq '.engines[] | select(.status == "ready") | .name'

\b
An engine is a plugin: "pip install" it and it is listed here. One that is
broken is listed with the reason, and the others go on working.
"""
)
@click.option("--json", "as_json", is_flag=True, help="Print everything each engine declares, as JSON.")
def engines(as_json: bool) -> None:
    """List the engines: what they can do, and which are broken."""
    from gasp_core.engine.listing import engine_rows
    from gasp_core.engine.registry import discover

    rows = engine_rows(discover())
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
