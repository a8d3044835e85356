"""``gasp render``: a recording, or a splat file, as a film, pictures, or a sheet of key frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.picture_size import Size
from gasp_core.cli.run_path import PathHere, RunPath
from gasp_core.errors import RenderingError

if TYPE_CHECKING:
    from gasp_core.scene.objects import UpAxis
    from gasp_core.scene.settings import CameraChoice

__all__ = ["render"]


@click.command(
    epilog="""\b
Examples:
  gasp render plant.gasp                          plant.mp4
  gasp render plant.gasp -o film.mp4 -o sheet.png
  gasp render plant.gasp -o frames/ --size 512 --background transparent
  gasp render plant.gasp -o last.png --frame 50 --camera cameras.json:12
  gasp render plant.gasp -o around.mp4 --turntable --slower 4
  gasp render thrown.gasp -o along.mp4 --follow --camera right
  gasp render plant.toml                          plant.png: a scene as it begins
  gasp render plant.splat -o look.png             a splat file, as it is

\b
A camera of its own can stand in the scene file:
  [camera]
  position = [0.8, -1.6, 0.7]
  target = [0, 0, 0.2]
"""
)
@click.argument("run", type=RunPath())
@click.option(
    "--out",
    "-o",
    "outs",
    metavar="PATH",
    multiple=True,
    type=PathHere(),
    help="film.mp4 (or .webm, .gif), sheet.png (key frames with their times) or a folder of pictures; more than one if"
    " you like. [default: named after RUN, .mp4; .png for a splat file]",
)
@click.option("--size", type=Size(), default="1280x720", show_default=True, help="Of a picture, in pixels.")
@click.option(
    "--camera",
    metavar="VIEW",
    help="three-quarter, front, right, back, left, top, three-quarter-left; or cameras.json:3, transforms.json:NAME, a"
    " .toml with a [camera] (gasp view makes one). [default: the scene's, else three-quarter, from the left where less"
    " is hidden then]",
)
@click.option("--from", "position", metavar="X Y Z", nargs=3, type=float, help="Where the camera stands instead [m].")
@click.option("--to", "target", metavar="X Y Z", nargs=3, type=float, help="What it looks at then [m].")
@click.option("--turntable", is_flag=True, help="Go around once during the film.")
@click.option(
    "--follow/--stand",
    default=None,
    help="Go along with what moves, or not. [default: where it goes several times as far as it is large]",
)
@click.option("--frame", metavar="K", type=click.IntRange(min=0), help="One frame alone, counted from 0.")
@click.option("--slower", metavar="TIMES", type=click.FloatRange(min=0.01, max=1000), default=1.0, help="Slow motion.")
@click.option(
    "--background",
    metavar="COLOUR",
    default="white",
    show_default=True,
    help="A name, #rrggbb, transparent.",
)
@click.option(
    "--colliders/--no-colliders",
    default=None,
    help="Draw floors and what else is solid, with shadows, or not. [default: but for a transparent background]",
)
@click.option("--up", metavar="AXIS", default="-y", show_default=True, help="A splat file's axis that points up.")
@overwrite_option("a film or a picture")
@most_memory_option
@click.option("--renderer", metavar="NAME", help="numba, gsplat (CUDA), reference. [default: numba]")
def render(
    run: Path,
    outs: tuple[Path, ...],
    size: tuple[int, int],
    camera: str | None,
    position: tuple[float, float, float] | None,
    target: tuple[float, float, float] | None,
    turntable: bool,
    follow: bool | None,
    frame: int | None,
    slower: float,
    background: str,
    colliders: bool | None,
    up: str,
    overwrite: bool,
    renderer: str | None,
) -> None:
    """Show a run as a film, pictures, or a sheet of key frames.

    RUN is the folder that "gasp run" wrote, finished or not; or what "gasp pack" made of it, or a scene file, which
    is shown as it begins, or a splat file. Without a camera, the whole motion is in
    the picture. Frames that are damaged are named and left out; the exit status is 1 then.
    """
    choice = _choice(camera, position, target)
    from gasp_core.cli.export import leave_out
    from gasp_core.rendering import filming

    paths = outs or (default_output(run, one=frame is not None, turns=turntable),)
    keep_what_is_there(paths, overwrite, read=[run])
    good, damaged = (None, []) if frame is not None else _whole_frames(run)
    filming.render(
        run,
        *paths,
        size=size,
        camera=choice,
        frames=good if frame is None else [frame],
        turntable=turntable,
        follow=follow,
        slower=slower,
        background=background,
        colliders=colliders,
        up=_axis(up),
        renderer=renderer,
    )
    for path in paths:
        click.echo(path)
    leave_out(damaged)


def default_output(run: Path, *, one: bool, turns: bool = False) -> Path:
    """Beside where one stands: a film of a recording or a turn, a picture of a splat file or of one frame."""
    from gasp_core.rendering.moving_footage import is_moving_splat

    moves = run.suffix == ".gasp" or (run / "zarr.json").exists() or is_moving_splat(run)
    return Path(run.resolve().stem + (".mp4" if turns or (moves and not one) else ".png"))


def _whole_frames(run: Path) -> tuple[list[int] | None, list[str]]:
    """Frames to show, and a line for every one that is damaged; None: all there are."""
    if not (run / "zarr.json").exists():
        return None, []
    from gasp_core.recording import Recording
    from gasp_core.recording.verifying import readable_frames

    recording = Recording.open(run)
    good, faults = readable_frames(recording)
    told = [f"{run}: frame {frame}: {found[0]}" for frame, found in faults.items()]
    if faults and not good:
        raise RenderingError(f"{told[0]}; no frame can be read")
    return (list(good), told) if faults else (None, [])


def _choice(
    camera: str | None, position: tuple[float, float, float] | None, target: tuple[float, float, float] | None
) -> str | CameraChoice | None:
    """The camera of the command line; None where it names none."""
    if (position is None) != (target is None):
        raise click.UsageError("--from and --to belong together: where the camera stands, and what it looks at")
    if position is None:
        return camera
    if camera is not None:
        raise click.UsageError("--camera and --from contradict each other: say one of them")
    from gasp_core.errors import SceneError
    from gasp_core.scene.settings import CameraChoice

    try:
        return CameraChoice(position=position, target=target)
    except SceneError as error:
        raise RenderingError(f"--from, --to: {error}") from None


def _axis(up: str) -> UpAxis:
    from gasp_core.scene.objects import UP_AXES

    for axis in UP_AXES:
        if up == axis:
            return axis
    raise click.UsageError(f'--up must be one of {", ".join(UP_AXES)}, found "{up}"')
