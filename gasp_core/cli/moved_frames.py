"""The splats that one has become, a file or a folder of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.export import SUFFIXES
from gasp_core.cli.overwriting import keep_what_is_there

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians

__all__ = ["frame_options", "paths_of_frames", "write_frames"]

_FORMATS = [name for name in SUFFIXES if name != "usd"]


def paths_of_frames(
    splat: Path, frames: Mapping[Path, Sized], given: int, out: Path | None, suffix: str | None, overwrite: bool
) -> list[Path]:
    """Where each frame goes: named after what it was read from, one alone as `out` says.

    Parameters
    ----------
    splat
        That was moved.
    frames
        By the files that they are from, of which `given` were named.
    given, out, suffix, overwrite
        As on the command line.

    Raises
    ------
    click.UsageError
        Where two would have one name.
    """
    ending = SUFFIXES[suffix or "ply"]
    names = [
        path.stem if len(each) == 1 else f"{path.stem}_{k:04d}"
        for path, each in frames.items()
        for k in range(len(each))
    ]
    if len(names) == 1 and (out is None or out.suffix):
        paths = [out if out is not None else Path(f"{splat.stem}_moved{ending}")]
    else:
        folder = out if out is not None else Path(f"{splat.stem}_moved")
        paths = [folder / f"{name}{ending}" for name in names]
    if len(set(paths)) < len(names) or len(frames) < given:
        raise click.UsageError("two of MOVED have one name: their frames would have too")
    keep_what_is_there(paths, overwrite)
    return paths


def write_frames(paths: list[Path], splats: Iterable[Gaussians]) -> None:
    """Write them, and say where they are."""
    from gasp_core.io import write_splat
    from gasp_core.progress import counting

    with counting(None, "frames", len(paths)) as done:
        for path, splat in zip(paths, splats):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_splat(path, splat)
            done()
    first, last = paths[0], paths[-1]
    click.echo(f"{first.parent}: {len(paths)} files, {first.name} to {last.name}" if len(paths) > 1 else str(first))


def frame_options(command: Any) -> Any:
    """The options --out and --format."""
    for option in (
        click.option("--format", "suffix", type=click.Choice(_FORMATS), help="[default: ply]"),
        click.option(
            "--out",
            "-o",
            metavar="PATH",
            type=click.Path(path_type=Path),
            help="The file for one frame, the folder for more. [default: SPLAT_moved.ply, SPLAT_moved]",
        ),
    ):
        command = option(command)
    return command
