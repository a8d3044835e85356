"""``gasp track``: the Gaussians of a first frame, in frames that were made one by one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.endings import SUFFIXES, refuse_a_file
from gasp_core.cli.losses import say_losses
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.printing import print_json, print_table
from gasp_core.cli.run_path import PathHere

if TYPE_CHECKING:
    from gasp_core.tracking import Tracked

__all__ = ["track"]

_FORMATS = [name for name in SUFFIXES if name not in ("glb", "usd")]
"""Those that frames are read from."""
_LOST = 0.05
"""Share of a frame in which nothing is tracked, from which on that is warned of."""
_SHOWN = 20
_COMPRESSED = ".compressed.ply"


@click.command(
    epilog="""\b
Examples:
  gasp track flipbook/                            flipbook_tracked/, a file a frame
  gasp track flipbook/ -o dancer --nodes 400      finer motion, slower
  gasp track flipbook/ --json | jq '.frames[] | {file, distance, unseen}'

\b
In a scene:  splat = "dancer/"   motion = { kind = "frames" }

\b
Some hundred nodes, each with a map of its own, are laid onto each frame in turn.
What moves must move by less than its own size from a frame to the next, and
what comes into being, or bursts, is not followed. DISTANCE is from what is
tracked to the frame and back, in percent of the frame's diagonal; in SPACINGS of
its Gaussians 1 is as near as two samples of one surface are. UNSEEN is the
share of the frame that nothing tracked is near to. How far something slides along
a surface that looks the same everywhere, none of these can tell.
"""
)
@click.argument("folder", type=PathHere())
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=PathHere(),
    help="Where the frames go. [default: FOLDER_tracked]",
)
@click.option("--format", "suffix", type=click.Choice(_FORMATS), default="ply", show_default=True)
@click.option(
    "--nodes",
    type=click.IntRange(min=8, max=800),
    default=200,
    show_default=True,
    help="Nodes that the motion is made of: time goes with their third power, memory with their second, 3 GB for 800.",
)
@most_memory_option
@click.option("--json", "as_json", is_flag=True, help="Print distances as JSON, and no progress.")
@overwrite_option("a folder of frames")
def track(folder: Path, out: Path | None, suffix: str, nodes: int, as_json: bool, overwrite: bool) -> None:
    """Follow Gaussians through frames that were made one by one.

    FOLDER has a splat for each frame, in the natural order of their names, and in none of them need a row be what it is
    in another. Written are the Gaussians of the first, as they are in each: frames that can be simulated.
    """
    from gasp_core.dynamics.frame_sequence import frame_files
    from gasp_core.io import read_splat, write_splat
    from gasp_core.io.file_sets import coming_together
    from gasp_core.progress import counting
    from gasp_core.tracking import Tracker

    files = frame_files(folder)
    if len(files) == 1:
        raise click.UsageError(
            f"{folder}: has one frame, {files[0].name}: there is nothing to track, add those after it"
        )
    target = folder.resolve().with_name(f"{folder.resolve().name}_tracked") if out is None else out
    names = _names(files, SUFFIXES[suffix])
    _refuse_target(target, folder, names, overwrite)
    first = read_splat(files[0])
    tracker = Tracker(first, nodes=nodes)
    found: list[tuple[str, Tracked]] = []
    # Half of the frames would look like all of a shorter motion: they come to their place together.
    with coming_together(target) as making:
        write_splat(making / names[0], first)
        with counting(False if as_json else None, "frames", len(files) - 1) as done:
            for file, name in zip(files[1:], names[1:]):
                tracked = tracker.follow(read_splat(file), str(file))
                write_splat(making / name, tracked.gaussians)
                found.append((file.name, tracked))
                done()
    if as_json:
        frames = [
            {"file": name, "distance": each.distance, "spacing": each.spacing, "unseen": each.unseen}
            for name, each in found
        ]
        print_json({"folder": str(_shown(target)), "gaussians": len(first), "frames": frames})
        return
    _print_for_people(found)
    say_losses(first, SUFFIXES[suffix])
    click.echo(f"\n{_shown(target)}: {len(names)} files of {len(first):,} Gaussians")


def _names(files: list[Path], suffix: str) -> list[str]:
    """Of what is written, each another one."""
    found: dict[str, Path] = {}
    for file in files:
        ending = _COMPRESSED if file.name.lower().endswith(_COMPRESSED) else file.suffix
        name = f"{file.name[: len(file.name) - len(ending)]}{suffix}"
        if name in found:
            raise click.UsageError(f"{file}: would be written as {name}, as {found[name].name} is: rename one of them")
        found[name] = file
    return [*found]


def _refuse_target(target: Path, folder: Path, names: list[str], overwrite: bool) -> None:
    """Refuse a folder that would hold something else beside the frames, or be held by those that are read."""
    from gasp_core.io.file_sets import is_in_the_making

    if target.resolve().is_relative_to(folder.resolve()):
        raise click.UsageError(
            f"{target}: holds the frames themselves, or lies among them: name another folder (--out)"
        )
    if not target.resolve().parent.is_dir() or (target.exists() and not target.is_dir()):
        raise click.UsageError(f"{target}: no folder can be made there: name another one (--out)")
    refuse_a_file(target)
    keep_what_is_there([target], overwrite)
    there = target.iterdir() if target.is_dir() else ()
    others = sorted({entry.name for entry in there if not is_in_the_making(entry)} - set(names))
    if others:
        raise click.UsageError(
            f"{target}: holds {others[0]} too, which would be played with the frames: name another folder (--out)"
        )


def _shown(path: Path) -> Path:
    """As one would write it here."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _print_for_people(found: list[tuple[str, Tracked]]) -> None:
    every = max(1, -(-len(found) // _SHOWN))
    shown = [each for index, each in enumerate(found, 1) if index % every == 0 or index == len(found)]
    print_table(
        ["FRAME", "DISTANCE %", "SPACINGS", "UNSEEN %"],
        [
            [
                name,
                f"{100 * each.distance:.2f}",
                f"{each.distance / each.spacing:.2f}" if each.spacing else "-",
                f"{100 * each.unseen:.1f}",
            ]
            for name, each in shown
        ],
    )
    lost = [(name, each) for name, each in found if each.unseen > _LOST]
    if lost:
        name, first = lost[0]
        click.echo(
            f"\nwarning: from {name} on, in {len(lost)} frames, what is tracked is nowhere near"
            f" {100 * first.unseen:.0f} % of the frame or more: what moves too far"
            " between two frames, or comes into being, is lost; with more --nodes finer motion is followed",
            err=True,
        )
