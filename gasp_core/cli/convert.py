"""``gasp convert``: from one splat format to another."""

from __future__ import annotations

from pathlib import Path

import click

from gasp_core.cli.levels import level_option
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.errors import SplatFormatError

__all__ = ["convert"]


@click.command(
    epilog="""\b
Examples:
  gasp convert bust.sog bust.ply
  gasp convert scan.ply scan.spz      a tenth of the size, small losses
  gasp convert scan.ply scan.sog      for SuperSplat and PlayCanvas
  gasp convert robot/lod-meta.json robot.ply --level 2
"""
)
@click.argument("source", metavar="IN", type=click.Path(path_type=Path))
@click.argument("target", metavar="OUT", type=click.Path(path_type=Path))
@level_option
@overwrite_option("a file")
@most_memory_option
def convert(source: Path, target: Path, level: int, overwrite: bool) -> None:
    """Turn a splat file into another format, which the suffix of OUT chooses: .ply, .splat, .spz, .sog,
    .glb (glTF) or .usdc (USD; takes usd-core).

    What a format cannot hold is said.
    """
    from gasp_core.io import read_splat, write_splat
    from gasp_core.io.convert import losses

    if source.exists() and target.exists() and source.samefile(target):
        raise SplatFormatError(f"{target}: is the input itself: give the output another name")
    keep_what_is_there([target], overwrite, "OUT")
    gaussians = read_splat(source, level=level)
    write_splat(target, gaussians)
    click.echo(f"{target}: {len(gaussians):,} Gaussians")
    for loss in losses(gaussians, target.suffix.lower()):
        click.echo(f"  {loss}")
