"""``gasp export``: the frames of a run as splat files that other programs open."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.endings import SUFFIXES, frames_in, refuse_a_file, refuse_another_ending
from gasp_core.cli.export_motion import export_motion
from gasp_core.cli.export_stage import export_stage, is_stage, readable
from gasp_core.cli.losses import say_losses
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.run_path import PathHere, RunPath
from gasp_core.cli.up_axes import UP_AXES
from gasp_core.errors import RecordingError

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians
    from gasp_core.recording import Recording
    from gasp_core.scene.objects import UpAxis

__all__ = ["export", "export_frames", "leave_out"]


@click.command(
    epilog="""\b
Examples:
  gasp export plant.gasp --all --format ply       plant_frames/plant_0000.ply ...
  gasp export plant.gasp --frame 12 --format spz  plant_0012.spz
  gasp export plant.gasp --frame 12 -o still.splat
  gasp export plant.gasp --frame 12 -o still.glb  for what reads glTF with KHR_gaussian_splatting
  gasp export plant.gasp --all -o plant.usdc      for Omniverse, Houdini, Blender: USD with a sample a frame
  gasp export plant.gasp --all --up -y            lies as trained splats do: for SuperSplat, or a scene again
  gasp export water.gasp --all --as-drawn         for other viewers: no holes where it has flowed
  gasp export drop.gasp --motion bear             drop_bear.csv: where the bear is and how it is turned
"""
)
@click.argument("run", type=RunPath())
@click.option(
    "--format",
    "suffix",
    type=click.Choice(list(SUFFIXES)),
    help="ply keeps everything; splat, spz and sog are smaller; glb is glTF; usd is one stage of all frames. "
    "[default: as --out ends, else ply]",
)
@click.option("--frame", metavar="K", type=click.IntRange(min=0), help="One frame, counted from 0.")
@most_memory_option
@click.option(
    "--as-drawn",
    is_flag=True,
    help="With the grains that pictures show of sand and water that has flowed; rows are no longer those of the file.",
)
@click.option(
    "--up",
    type=click.Choice(UP_AXES),
    help="Which axis of the files is up: -y as in trained splats, +y as in Unity and Houdini. "
    "[default: +z; of glb +y, as glTF has it]",
)
@overwrite_option("files")
@click.option("--all", "every", is_flag=True, help="Every frame.")
@click.option(
    "--motion",
    "body",
    metavar="OBJECT",
    help="How an object moves as a whole, a line a frame: the rigid motion nearest to it, and what it is off by [m]. "
    "The motion of a collider reads such a file.",
)
@click.option(
    "--out",
    "-o",
    metavar="PATH",
    type=PathHere(),
    help="The file for --frame or --motion, the folder for --all. [default: named after the run, in this folder]",
)
def export(
    run: Path,
    suffix: str | None,
    frame: int | None,
    every: bool,
    body: str | None,
    as_drawn: bool,
    up: UpAxis | None,
    overwrite: bool,
    out: Path | None,
) -> None:
    """Write the frames of a run as splat files.

    RUN is the folder that "gasp run" wrote; a run that is not finished has the frames it has. Frames that are damaged
    are named and left out; the exit status is 1 then.
    """
    if every + (frame is not None) + (body is not None) != 1:
        raise click.UsageError("say one of --frame K, --all and --motion OBJECT")
    from gasp_core import Recording
    from gasp_core.recording.commits import numbered

    recording = Recording.open(run)
    if recording.frame_count == 0:
        raise RecordingError(f'{run}: holds no frame yet: go on with "gasp run --resume"')
    stem = run.resolve().stem
    if body is not None:
        if suffix is not None or as_drawn or up is not None:
            raise click.UsageError(
                "--motion writes numbers in the axes of the scene: leave --format, --as-drawn and --up out"
            )
        click.echo(export_motion(recording, body, out, overwrite=overwrite))
        return
    if frame is not None:
        if frame >= recording.frame_count:
            raise RecordingError(f"{run}: has frames 0 to {recording.frame_count - 1}, not {frame}")
        path = out if out is not None else Path(f"{stem}_{frame:04d}{SUFFIXES[suffix or 'ply']}")
        refuse_another_ending(path, suffix)
        keep_what_is_there([path], overwrite)
        if is_stage(path):
            export_stage(recording, [frame], path, as_drawn=as_drawn, up=up, moves=False)
        else:
            from gasp_core.io import write_splat

            gaussians = _read(recording, as_drawn, up, path.suffix.lower())(frame)
            write_splat(path, gaussians)
            say_losses(gaussians, path.suffix.lower())
        click.echo(path)
        return
    lost = set(recording.lost)
    frames = sorted({*range(recording.frame_count), *recording.torn} - lost)
    if suffix == "usd" or (suffix is None and out is not None and is_stage(out)):
        path = out if out is not None else Path(f"{stem}{SUFFIXES['usd']}")
        refuse_another_ending(path, suffix)
        keep_what_is_there([path], overwrite)
        damaged = export_stage(recording, frames, path, as_drawn=as_drawn, up=up, moves=True)
        click.echo(f"{path}: {len(frames) - len(damaged)} frames")
    else:
        folder, ending = out if out is not None else Path(f"{stem}_frames"), SUFFIXES[suffix or "ply"]
        refuse_a_file(folder)
        if folder.resolve().is_relative_to(run.resolve()):
            raise click.UsageError(f"--out {folder} lies in the recording itself: name another folder")
        read = _read(recording, as_drawn, up, ending)
        keep_what_is_there(frames_in(folder, stem=stem, suffix=ending), overwrite)
        paths, damaged = export_frames(read, frames, folder, stem=stem, suffix=ending)
        say_losses(recording.reference, ending)
        click.echo(f"{folder}: {len(paths)} files, {paths[0].name} to {paths[-1].name}")
    if lost:
        damaged.insert(0, f"{run}: {numbered(sorted(lost))} lost: nothing of them is there")
    leave_out(damaged)


def _read(recording: Recording, as_drawn: bool, up: UpAxis | None, suffix: str) -> Callable[[int], Gaussians]:
    """What reads frames, turned so that `up` is up in files of that format."""
    from gasp_core.recording.drawn import DrawnFrames
    from gasp_core.scene.placement import with_up

    if suffix == SUFFIXES["glb"]:
        if up not in (None, "+y"):
            raise click.UsageError(f"--up {up} contradicts .glb: in glTF +y is up, leave --up out")
        # As a trained splat lies; writing turns it.
        up = "-y"
    read = DrawnFrames(recording).gaussians if as_drawn else recording.gaussians
    return read if up in (None, "+z") else lambda frame: with_up(read(frame), up)


def export_frames(
    read: Callable[[int], Gaussians], frames: Iterable[int], folder: Path, *, stem: str, suffix: str
) -> tuple[list[Path], list[str]]:
    """Write frames, which `read` reads, as files ``stem_0000.suffix`` into a folder, which is made.

    Frames that are damaged are left out. All come together, in place of those that were there: half a film under the
    names of a whole one misleads.

    Returns
    -------
    paths, damaged
        What was written, and a line for every frame that was not.

    Raises
    ------
    RecordingError, SplatFormatError
        Where the folder cannot be made, no frame can be read, or a file cannot be written.
    """
    from gasp_core.io import write_splat
    from gasp_core.io.file_sets import coming_together

    paths: list[Path] = []
    damaged: list[str] = []
    earlier = frames_in(folder, stem=stem, suffix=suffix)
    with coming_together(folder, earlier, refused=RecordingError) as making:
        for frame, gaussians in readable(read, frames, damaged):
            name = f"{stem}_{frame:04d}{suffix}"
            write_splat(making / name, gaussians)
            paths.append(folder / name)
    return paths, damaged


def leave_out(damaged: Sequence[str]) -> None:
    """Name what was left out, on stderr, and end with the status of something damaged."""
    from gasp_core.cli.verify import DAMAGED

    for line in damaged:
        click.echo(f"gasp: {line}; left out", err=True)
    if damaged:
        click.get_current_context().exit(DAMAGED)
