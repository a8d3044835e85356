"""``gasp pack``: a run as one file that one can send."""

from __future__ import annotations

from pathlib import Path

import click

from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.run_path import PathHere, RunPath

__all__ = ["pack"]

_SUFFIX = ".moving.sog"


@click.command(
    epilog="""\b
Examples:
  gasp pack plant.gasp                           plant.moving.sog
  gasp pack plant.gasp --html                    plant.html: a page that plays it
  gasp pack plant.gasp -o p.sog --error 1e-3     a tenth as accurate, and smaller
  gasp render plant.moving.sog -o film.mp4       it is all one needs
"""
)
@click.argument("run", type=RunPath())
@click.option("--html", is_flag=True, help="A page that plays it, in any browser, without a network.")
@click.option(
    "--out",
    "-o",
    metavar="FILE",
    type=PathHere(),
    help=f"The file, .sog or .html. [default: NAME{_SUFFIX}, here]",
)
@click.option(
    "--error",
    metavar="SHARE",
    type=click.FloatRange(min=0, min_open=True),
    default=1e-4,
    show_default=True,
    help="How far a Gaussian may be from where it was recorded, of the diagonal of what moves.",
)
@overwrite_option("a file")
def pack(run: Path, html: bool, out: Path | None, error: float, overwrite: bool) -> None:
    """Write a run as a moving splat, one file that one can send: a .sog, and how its Gaussians move.

    RUN is the folder that "gasp run" wrote. Whatever reads .sog shows the splat at rest; docs/moving_splats.md says how
    the motion is written, and every frame is held against what was recorded.
    """
    from gasp_core.errors import RecordingError
    from gasp_core.moving.packing import pack as packed
    from gasp_core.progress import counting
    from gasp_core.recording import Recording
    from gasp_core.rendering.footage import RecordedFootage
    from gasp_core.rendering.player import camera_of

    path = out if out is not None else Path(f"{run.resolve().stem}{'.html' if html else _SUFFIX}")
    if path.suffix.lower() not in ((".html",) if html else (".sog", ".html")):
        raise click.UsageError(f"--out {path} does not end in {'.html' if html else '.sog or .html'}")
    keep_what_is_there([path], overwrite, read=[run])
    recording = Recording.open(run)
    if recording.frame_count == 0:
        raise RecordingError(f'{run}: holds no frame yet: go on with "gasp run --resume"')
    with counting(None, "frame", recording.frame_count) as done:
        found = packed(
            recording,
            path,
            error=error,
            camera=camera_of(recording),
            colliders=RecordedFootage(recording).colliders,
            progress=done,
        )
    each = found.motion / found.frames / 1e3
    off = 1e3 * found.largest_error
    click.echo(f"{path}: {found.frames:,} frames, {path.stat().st_size / 1e6:.1f} MB")
    click.echo(f"  the motion takes {each:.1f} kB a frame; no Gaussian is off by more than {off:.2g} mm")
