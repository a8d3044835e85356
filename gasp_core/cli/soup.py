"""``gasp soup``: a splat's triangles for other programs to move, and the splats that they have become."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.moved_frames import frame_options, paths_of_frames, write_frames
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.up_axes import UP_AXES
from gasp_core.errors import SplatFormatError

__all__ = ["soup"]


@click.group(
    epilog="""\b
Examples:
  gasp soup export plant.ply                              plant.soup.ply
  blender --background --python examples/blender_soup.py -- plant.soup.ply moved.npy
  gasp soup import plant.ply plant.soup.ply moved.npy     plant_moved/moved_0000.ply ...
  gasp soup import plant.ply plant.soup.ply moved.ply -o still.ply
"""
)
def soup() -> None:
    """Lend a splat's triangles to other programs, and take them back.

    Each Gaussian is a triangle, or a tetrahedron where it is not flat. Whatever moves their vertices, by hand or by a
    script, moves the splat.
    """


@soup.command(
    "export",
    epilog="""\b
The soup is a binary .ply in float32: vertices x y z, with the numbers of their
Gaussian and of their corner, and triangles. It lies with +z up about the
splat's middle, in the splat's unit.
""",
)
@click.argument("splat", type=PathHere())
@click.option("--out", "-o", metavar="FILE", type=PathHere(), help="[default: SPLAT.soup.ply]")
@click.option(
    "--vertices",
    type=click.Choice(["auto", "3", "4"]),
    default="auto",
    show_default=True,
    help="Of each Gaussian; auto: 4 where they are not flat.",
)
@click.option(
    "--shortest-edge",
    metavar="SHARE",
    type=click.FloatRange(min=0),
    default=1e-3,
    show_default=True,
    help="Of the splat's longest side: shorter edges are lengthened to it, and shortened again when they come back.",
)
@click.option(
    "--up", type=click.Choice(UP_AXES), default="-y", show_default=True, help="The splat's axis that points up."
)
@most_memory_option
@overwrite_option("a soup")
def export_soup(splat: Path, out: Path | None, vertices: str, shortest_edge: float, up: Any, overwrite: bool) -> None:
    """Write the triangles of SPLAT."""
    from gasp_core.io import read_splat
    from gasp_core.io.atomic import replacing
    from gasp_core.io.soups import make_soup, write_soup
    from gasp_core.scene.placement import upright

    path = out if out is not None else Path(f"{splat.stem}.soup.ply")
    if path.suffix.lower() != ".ply":
        raise SplatFormatError(f"{path}: a soup is a .ply: name it so; other programs read it as a mesh")
    keep_what_is_there([path], overwrite, read=[splat])
    wanted: dict[str, Literal[3, 4, "auto"]] = {"auto": "auto", "3": 3, "4": 4}
    gaussians = read_splat(splat)
    found = make_soup(gaussians, vertices=wanted[vertices], shortest_edge=shortest_edge, turn=upright(up))
    with replacing(path) as stream:
        write_soup(stream, found)
    click.echo(f"{path}: {len(gaussians):,} Gaussians of {found.vertices} vertices")


@soup.command(
    "import",
    epilog="""\b
MOVED is a .ply, or a .npy of NumPy, (vertices, 3) or (frames, vertices, 3), in
the order of the soup. What has not moved comes back to the last bit. A folder
of frames is played by motion = { kind = "frames" } in a scene.
""",
)
@click.argument("splat", type=PathHere())
@click.argument("exported", metavar="SOUP", type=PathHere())
@click.argument("moved", nargs=-1, required=True, metavar="MOVED...", type=PathHere())
@frame_options
@most_memory_option
@overwrite_option("files")
def import_soup(
    splat: Path, exported: Path, moved: tuple[Path, ...], out: Path | None, suffix: str | None, overwrite: bool
) -> None:
    """Write what SPLAT has become, its SOUP moved to MOVED.

    SOUP is as it was exported.
    """
    from gasp_core.io import read_splat
    from gasp_core.io.soups import read_positions, read_soup, splat_of

    gaussians, known = read_splat(splat), read_soup(exported)
    frames = {path: read_positions(path, known) for path in moved}
    paths, earlier = paths_of_frames(splat, exported, frames, len(moved), out, suffix, overwrite)
    write_frames(paths, earlier, (splat_of(known, gaussians, each) for found in frames.values() for each in found))
