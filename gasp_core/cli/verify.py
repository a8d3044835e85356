"""``gasp verify``: whether a recording is whole, and what can be read where it is not."""

from __future__ import annotations

import dataclasses

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.printing import print_json

__all__ = ["DAMAGED", "verify"]

DAMAGED = 1
"""Exit status of a recording of which something is damaged, where what is good was done."""


@click.command(
    epilog="""\b
Examples:
  gasp verify plant.gasp
  gasp verify plant.gasp --json | jq .damaged

\b
Exit status: 0 all is whole, 1 something is damaged, 2 it is no recording.
Checksums find what copying, disks and memory do to files. Anybody can compute
them: they do not tell who wrote a recording.
"""
)
@click.argument("run", type=click.Path())
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
@most_memory_option
def verify(run: str, as_json: bool) -> None:
    """Look at every file of a recording, and say what is damaged.

    Prints which files are damaged, which frames can be read, and how to go on.
    """
    from gasp_core.recording.addresses import local_copy
    from gasp_core.recording.commits import numbered
    from gasp_core.recording.verifying import verify as verified

    found = verified(local_copy(run))
    if as_json:
        print_json(dataclasses.asdict(found))
    elif found.damaged:
        click.echo(f"{run}: damaged")
        for line in (*found.damaged, *found.notes):
            click.echo(f"  {line}")
        readable = numbered(found.readable) if found.readable else "no frame"
        click.echo(f"{readable} can be read{f', {numbered(found.lost)} cannot' if found.lost else ''}")
        click.echo(found.advice)
    else:
        click.echo(f"{run}: whole, {len(found.readable)} frames")
        for line in found.notes:
            click.echo(f"  {line}")
    if found.damaged:
        click.get_current_context().exit(DAMAGED)
