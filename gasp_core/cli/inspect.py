"""``gasp inspect``: what is in a splat file."""

from __future__ import annotations

from pathlib import Path

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.printing import print_json

__all__ = ["inspect"]


@click.command(
    epilog="""\b
Examples:
  gasp inspect plant.splat
  gasp inspect bust.sog --json | jq .count

\b
Formats: .ply (also compressed and flat), .splat, .spz, .sog (zip or folder).
"""
)
@click.argument("file", type=click.Path(path_type=Path))
@most_memory_option
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def inspect(file: Path, as_json: bool) -> None:
    """Describe a splat file and say what is odd about it.

    Prints the number of Gaussians, the degree of the spherical harmonics, the extents, percentiles of scale, opacity
    and flatness, and everything that may give trouble.
    """
    from gasp_core.io.inspect import inspect_splat

    summary = inspect_splat(file)
    if as_json:
        print_json(summary.to_json())
    else:
        click.echo(summary.to_text())
