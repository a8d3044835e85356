"""``gasp bind``: a splat that goes with a mesh which another program moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.moved_frames import frame_options, paths_of_frames, write_frames
from gasp_core.cli.overwriting import overwrite_option
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.up_axes import UP_AXES

__all__ = ["bind"]


@click.command(
    epilog="""\b
Examples:
  gasp bind statue.ply cage.obj cage_bent.obj             statue_moved.ply
  gasp bind statue.ply cage.obj walk/*.obj -o walking     a splat a frame
  gasp bind duck.ply duck.glb moved.npy --mesh-up +y      of gasp convert duck.glb duck.ply

\b
MOVED is the mesh again, its vertices moved and in the same order, or a .npy of
NumPy, (vertices, 3) or (frames, vertices, 3). Of an .obj with a texture leave
that out in both: along its seams vertices count twice. A folder of frames is played by
motion = { kind = "frames" } in a scene; a physics engine moves the vertices
with reduction = { mode = "mesh" }.
"""
)
@click.argument("splat", type=PathHere())
@click.argument("mesh", type=PathHere())
@click.argument("moved", nargs=-1, required=True, metavar="MOVED...", type=PathHere())
@frame_options
@click.option(
    "--mesh-up", type=click.Choice(UP_AXES), help="The mesh's axis that is up. [default: it lies as the splat does]"
)
@click.option("--up", type=click.Choice(UP_AXES), default="-y", show_default=True, help="The splat's, with --mesh-up.")
@most_memory_option
@overwrite_option("files")
def bind(
    splat: Path, mesh: Path, moved: tuple[Path, ...], out: Path | None, suffix: str | None, mesh_up: Any, up: Any,
    overwrite: bool,
) -> None:  # fmt: skip
    """Move a splat with a mesh that another program moves.

    Writes what SPLAT becomes where MESH becomes MOVED. Each Gaussian belongs to the face nearest to it, and is moved,
    turned and stretched as that is. Meshes are .obj, .glb, .stl or .ply (takes trimesh).
    """
    import numpy as np

    from gasp_core.io import read_splat
    from gasp_core.io.mesh_splats import FAR_OFF, bind_to_mesh
    from gasp_core.io.moved_meshes import read_mesh_as_it_is, read_moved_vertices
    from gasp_core.scene.placement import upright

    gaussians, still = read_splat(splat), read_mesh_as_it_is(mesh)
    frames = {path: read_moved_vertices(path, still) for path in moved}
    paths, earlier = paths_of_frames(splat, mesh, frames, len(moved), out, suffix, overwrite)
    turn = np.eye(3) if mesh_up is None else upright(up).T @ upright(mesh_up)
    binding = bind_to_mesh(gaussians, still.vertices @ turn.T, still.faces)
    if binding.off > FAR_OFF:
        far = f"half of the Gaussians of {splat} are {100 * binding.off:.2g} % of the diagonal of {mesh} outside of it"
        click.echo(f"{far}: is it theirs, and does it lie as they do (--mesh-up)?", err=True)
    write_frames(paths, earlier, (binding.moved(each @ turn.T) for found in frames.values() for each in found))
