"""The splats that one has become, a file or a folder of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.endings import SUFFIXES, frames_in, refuse_a_file, refuse_another_ending
from gasp_core.cli.losses import say_losses
from gasp_core.cli.overwriting import keep_what_is_there
from gasp_core.cli.run_path import PathHere

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians

__all__ = ["frame_options", "paths_of_frames", "write_frames"]

_FORMATS = [name for name in SUFFIXES if name != "usd"]


def paths_of_frames(
    splat: Path,
    still: Path,
    frames: Mapping[Path, Sized],
    given: int,
    out: Path | None,
    suffix: str | None,
    overwrite: bool,
) -> tuple[list[Path], list[Path]]:
    """Where each frame goes: named after what it was read from, one alone as `out` says.

    Parameters
    ----------
    splat
        That was moved.
    still
        What moved with it, before it did.
    frames
        By the files that they are from, of which `given` were named.
    given, out, suffix, overwrite
        As on the command line.

    Returns
    -------
    paths, earlier
        Of the frames, and of those of an earlier motion, which go when these come.

    Raises
    ------
    click.UsageError
        Where two would have one name, or `out` is none for them.
    """
    ending = SUFFIXES[suffix or "ply"]
    names = [
        path.stem if len(each) == 1 else f"{path.stem}_{k:04d}"
        for path, each in frames.items()
        for k in range(len(each))
    ]
    earlier: list[Path] = []
    if len(names) == 1 and (out is None or out.suffix):
        paths = [out if out is not None else Path(f"{splat.stem}_moved{ending}")]
        refuse_another_ending(paths[0], suffix)
    else:
        folder = out if out is not None else Path(f"{splat.stem}_moved")
        refuse_a_file(folder)
        paths = [folder / f"{name}{ending}" for name in names]
        # No other file has more frames than one.
        motions = [path.stem for path in frames if path.suffix.lower() == ".npy"]
        earlier = [path for stem in motions for path in frames_in(folder, stem=stem, suffix=ending)]
    if len(set(paths)) < len(names) or len(frames) < given:
        raise click.UsageError("two of MOVED have one name: their frames would have too")
    keep_what_is_there([*paths, *earlier], overwrite, read=[splat, still, *frames])
    return paths, earlier


def write_frames(paths: list[Path], earlier: list[Path], splats: Iterable[Gaussians]) -> None:
    """Write them, in place of those of an earlier motion, and say where they are."""
    from gasp_core.io import write_splat
    from gasp_core.io.file_sets import coming_together
    from gasp_core.progress import counting

    if len(paths) == 1 and not earlier:
        paths[0].parent.mkdir(parents=True, exist_ok=True)
        (alone,) = splats
        write_splat(paths[0], alone)
        say_losses(alone, paths[0].suffix.lower())
        click.echo(paths[0])
        return
    first, last = paths[0], paths[-1]
    with counting(None, "frames", len(paths)) as done, coming_together(first.parent, earlier) as making:
        for path, splat in zip(paths, splats):
            write_splat(making / path.name, splat)
            if path == first:
                say_losses(splat, path.suffix.lower())
            done()
    click.echo(f"{first.parent}: {len(paths)} files, {first.name} to {last.name}")


def frame_options(command: Any) -> Any:
    """The options --out and --format."""
    for option in (
        click.option(
            "--format",
            "suffix",
            type=click.Choice(_FORMATS),
            help="[default: as --out ends for one frame, else ply]",
        ),
        click.option(
            "--out",
            "-o",
            metavar="PATH",
            type=PathHere(),
            help="The file for one frame, the folder for more. [default: SPLAT_moved.ply, SPLAT_moved]",
        ),
    ):
        command = option(command)
    return command
