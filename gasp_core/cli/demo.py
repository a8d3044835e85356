"""``gasp demo``: the whole way from a splat to splats, with a toy made on the spot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.run_path import PathHere
from gasp_core.errors import RecordingError, UnknownEngineError

if TYPE_CHECKING:
    from gasp_core.discovery.registry import Registry
    from gasp_core.recording import Recording

__all__ = ["Setting", "demo", "scene_text", "setting_for"]

_FOLDER = "gasp-demo"


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """How finely the demo is simulated, which is a matter of how fast the engine is."""

    gaussians: int
    resolution: int
    duration: float


_FAST = Setting(gaussians=10_000, resolution=24, duration=1.2)
# The reference engine is written to be read, not to be quick: the same fall in minutes, not hours.
_SLOW = Setting(gaussians=1_000, resolution=10, duration=0.8)

_PREFERRED = {"warp-mpm": _FAST, "taichi-mpm": _FAST, "reference-mpm": _SLOW}
"""In this order, where installed; any other engine that is ready comes after them."""


@click.command(
    epilog="""\b
Examples:
  gasp demo
  gasp demo --out bear --frames 10
  gasp demo --engine reference-mpm
"""
)
@click.option("--engine", metavar="NAME", help="Engine to use. [default: the fastest that is installed]")
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=PathHere(),
    help=f"Folder to make. [default: {_FOLDER}, or {_FOLDER}-2 and so on where that is taken]",
)
@click.option("--frames", metavar="N", type=click.IntRange(min=1), help="Stop after N frames.")
def demo(engine: str | None, out: Path | None, frames: int | None) -> None:
    """Drop a soft toy, without any data of your own.

    Makes a toy bear of flat Gaussians, drops it on a floor, films that, and writes every frame as a splat file. What it
    makes is an ordinary scene to play with.
    """
    from gasp_core.discovery.registry import discover

    name, setting = setting_for(engine, discover())
    folder = _new_folder(out)

    from gasp_core import load_scene, simulate
    from gasp_core.cli.export import export_frames
    from gasp_core.cli.run import interrupted, print_outcome, resumable
    from gasp_core.io import write_splat
    from gasp_core.io.atomic import replacing
    from gasp_core.toy import make_toy

    click.echo(f"making a toy of {setting.gaussians:,} Gaussians: {folder / 'toy.ply'}")
    write_splat(folder / "toy.ply", make_toy(setting.gaussians))
    scene = folder / "scene.toml"
    with replacing(scene) as stream:
        stream.write(scene_text(name, setting).encode())
    click.echo(f"dropping it, with {name}: {scene}")
    run = folder / "toy.gasp"
    with resumable(run, ["gasp", "run", str(scene), "--resume", "--out", str(run)]):
        recording = simulate(load_scene(scene), out=run, frames=frames, progress="log")
        print_outcome(recording)
        if interrupted(recording):
            raise KeyboardInterrupt
    films = _film(recording, folder)
    paths, _ = export_frames(
        recording.gaussians, range(recording.frame_count), folder / "frames", stem="toy", suffix=".ply"
    )
    click.echo(
        f"{films}splat files: {paths[0]} to {paths[-1].name}\n"
        "\n"
        "What next:\n"
        f"  look:    gasp view {run}, or drag {paths[len(paths) // 2]} into any viewer of splats\n"
        f"  change:  edit {scene} (stiffer? heavier? from higher up?), then\n"
        f"           gasp run {scene} --out {folder / 'mine.gasp'} --render {folder / 'mine.mp4'}\n"
        f"  export:  gasp export {run} --all --format spz\n"
        "  yours:   put the path of your own splat file into the scene; gasp inspect FILE tells what is in it"
    )


def _film(recording: Recording, folder: Path) -> str:
    """Make a film and a sheet of key frames; lines that say where they are, or why there is none."""
    from gasp_core.errors import PluginLoadError, RenderingError
    from gasp_core.rendering.filming import render

    film, sheet = folder / "film.mp4", folder / "sheet.png"
    click.echo("filming it")
    try:
        render(recording, film, sheet, size=(960, 540))
    except (RenderingError, PluginLoadError) as error:
        return f"no film:     {error}\n"
    return f"film:        {film}\nkey frames:  {sheet}\n"


def setting_for(engine: str | None, registry: Registry) -> tuple[str, Setting]:
    """The engine to use and how finely to simulate with it.

    Raises
    ------
    UnknownEngineError
        Where no engine is ready.
    """
    from gasp_core.discovery.status import engine_rows

    if engine is not None:
        registry.offer(engine)
        return engine, _PREFERRED.get(engine, _FAST)
    ready = [row.name for row in engine_rows(registry) if row.status == "ready"]
    for name in [*_PREFERRED, *ready]:
        if name in ready:
            return name, _PREFERRED.get(name, _FAST)
    raise UnknownEngineError('no engine is ready: "gasp engines" says why; or pip install gasp-warp-mpm')


def scene_text(engine: str, setting: Setting) -> str:
    """The demo's scene file."""
    return f"""\
# A soft toy falls on a floor. Change a number and run it again: gasp run scene.toml --out mine.gasp

[scene]
duration = {setting.duration}          # seconds
frame_rate = 25
gravity = [0, 0, -9.81]

[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"               # the axis of the file that points up; 3DGS captures mostly have "-y"
height = 0.3            # metres
position = [0, 0, 0.2]  # where its lowest point starts
rotation = [6, 15, 0]   # degrees about x, y, z: it lands on one foot

[object.material]
model = "elastic"
density = 200           # kg/m^3
youngs_modulus = 6e4    # Pa: less is softer
poissons_ratio = 0.3

[[collider]]
shape = "plane"
height = 0.0
contact = "separate"    # or "stick", "slip"
friction = 0.5

[engine]
name = "{engine}"

[accuracy]
resolution = {setting.resolution}         # grid cells along the toy: more is finer and slower
"""


def _new_folder(out: Path | None) -> Path:
    """Make the folder asked for, or the first of the default's names that is free."""
    if out is None:
        number = 1
        out = Path(_FOLDER)
        while out.exists():
            number += 1
            out = Path(f"{_FOLDER}-{number}")
    try:
        out.mkdir(parents=True, exist_ok=True)
        taken = next(out.iterdir(), None)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be made a folder ({error.strerror}): choose another --out") from error
    if taken is not None:
        raise RecordingError(f"{out}: is not empty: choose another --out, or remove it")
    return out
