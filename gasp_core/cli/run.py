"""``gasp run``: a scene file in, a recording out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.printing import print_json

if TYPE_CHECKING:
    from gasp_core.recording import Recording

__all__ = ["recording_json", "run"]


@click.command(
    epilog="""\b
A scene:
  [scene]
  duration = 2.0                      # seconds
  frame_rate = 25
  [[object]]
  name = "plant"
  splat = "plant.splat"               # beside the scene file
  height = 0.4                        # metres
  position = [0, 0, 0.3]              # its lowest point starts here; +z is up
  material = { model = "elastic", density = 400, youngs_modulus = 5e4,
               poissons_ratio = 0.3 }
  [[collider]]
  shape = "plane"
  height = 0.0
  friction = 0.4

\b
(A TOML table in braces stands on one line; it is broken here to fit.)

\b
Examples:
  gasp run scene.toml
  gasp run scene.toml --engine reference-mpm --out slow.gasp --frames 5
  gasp run scene.toml --resume        go on after Ctrl-C, a crash or a power cut
"""
)
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--engine", metavar="NAME", help='Engine to use instead of the scene\'s; "gasp engines" lists them.')
@click.option(
    "--out",
    metavar="FOLDER",
    type=click.Path(path_type=Path),
    help="Where to keep the frames. [default: the scene's name with .gasp, in the current folder]",
)
@click.option("--resume", is_flag=True, help="Go on with a run that was stopped, from its last checkpoint.")
@click.option("--frames", metavar="N", type=click.IntRange(min=1), help="Stop after N frames.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON, and no progress.")
def run(scene: Path, engine: str | None, out: Path | None, resume: bool, frames: int | None, as_json: bool) -> None:
    """Simulate a scene and keep its frames.

    SCENE is a TOML file: which splats, what they are made of, what they meet. Every frame is safe on disk once it is
    written; Ctrl-C stops cleanly and says how to go on.
    """
    from gasp_core import load_scene, simulate

    folder = out if out is not None else Path(scene.stem + ".gasp")
    recording = simulate(
        load_scene(scene), engine=engine, out=folder, resume=resume, frames=frames, progress=False if as_json else None
    )
    if as_json:
        print_json(recording_json(recording, folder))
    else:
        click.echo(f"{folder}: {recording.frame_count} frames, {recording.status}")
        click.echo(f"to get splat files: gasp export {folder} --all --format ply")


def recording_json(recording: Recording, folder: Path) -> dict[str, object]:
    """What programs want to know of a run."""
    return {
        "recording": str(folder),
        "status": str(recording.status),
        "frame_count": recording.frame_count,
        "times": [float(time) for time in recording.times],
    }
