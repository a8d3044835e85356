"""``gasp convert``: from one splat format to another."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.levels import level_option
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.up_axes import UP_AXES

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians

__all__ = ["convert"]


@click.command(
    epilog="""\b
Examples:
  gasp convert bust.sog bust.ply
  gasp convert scan.ply scan.spz      a tenth of the size, small losses
  gasp convert scan.ply scan.sog      for SuperSplat and PlayCanvas
  gasp convert robot/lod-meta.json robot.ply --level 2
  gasp convert scene.glb scene.ply    splats in glTF (KHR_gaussian_splatting) or USD
  gasp convert duck.glb duck.ply --gaussians 100000     a mesh, as Gaussians on its faces
"""
)
@click.argument("source", metavar="IN", type=PathHere())
@click.argument("target", metavar="OUT", type=PathHere())
@level_option
@click.option(
    "--gaussians",
    "count",
    metavar="N",
    type=click.IntRange(min=1),
    help="Of a mesh: about how many are to cover it. [default: 200000]",
)
@click.option("--up", type=click.Choice(UP_AXES), help="Of a mesh: its axis that is up. [default: +y; of .stl +z]")
@overwrite_option("a file")
@most_memory_option
def convert(source: Path, target: Path, level: int, count: int | None, up: Any, overwrite: bool) -> None:
    """Turn a splat file into another format, which the suffix of OUT chooses: .ply, .splat, .spz, .sog,
    .glb (glTF) or .usdc (USD; takes usd-core).

    What a format cannot hold is said. A mesh (.obj, .glb, .stl, .ply; takes trimesh) becomes flat Gaussians on its
    faces, in the colours of its textures, vertices or faces; they lie as trained ones do, -y up.
    """
    from gasp_core.io import read_splat, write_splat
    from gasp_core.io.convert import losses
    from gasp_core.io.painted_meshes import is_mesh

    keep_what_is_there([target], overwrite, "OUT", read=[source])
    notes: tuple[str, ...] = ()
    if is_mesh(source):
        gaussians, notes = _splat_of(source, 200_000 if count is None else count, up)
    elif count is not None or up is not None:
        raise click.UsageError("--gaussians and --up are of meshes: a splat has Gaussians, and is written as it lies")
    else:
        gaussians = read_splat(source, level=level)
    write_splat(target, gaussians)
    click.echo(f"{target}: {len(gaussians):,} Gaussians")
    for loss in (*notes, *losses(gaussians, target.suffix.lower())):
        click.echo(f"  {loss}")


def _splat_of(path: Path, count: int, up: Any) -> tuple[Gaussians, tuple[str, ...]]:
    """The Gaussians of a mesh, lying as trained ones do, and what there is to say of it."""
    from gasp_core.io.mesh_splats import splat_of_mesh
    from gasp_core.io.painted_meshes import read_painted_mesh
    from gasp_core.scene.placement import turned

    mesh = read_painted_mesh(path)
    lies = up or ("+z" if path.suffix.lower() == ".stl" else "+y")
    found = turned(splat_of_mesh(mesh, count).gaussians, lies, "-y")
    names = [field.name for field in dataclasses.fields(found)]
    return found.with_(**{name: getattr(found, name).astype("f4") for name in names}), mesh.notes
