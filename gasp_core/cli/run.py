"""``gasp run``: a scene file in, a recording out."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.dry_run import estimated, print_estimate
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.picture_size import Size
from gasp_core.cli.printing import print_json
from gasp_core.cli.rehearsing import rehearsed
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.settings import Settings, settings_options
from gasp_core.cli.trust_code import code_is_trusted, trust_code_option

if TYPE_CHECKING:
    from gasp_core.recording import Recording
    from gasp_core.rendering.live import LiveFilm
    from gasp_core.scene.model import Scene

__all__ = ["filmed", "interrupted", "previewed", "print_outcome", "resumable", "run"]

_PREVIEW_CELLS = 12
_PREVIEW_SECONDS = 2.0
_PREVIEW_RATE = 12.5
_PREVIEW_SIZE = (640, 360)


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
  [object.material]
  model = "elastic"
  density = 400                       # kg/m^3
  youngs_modulus = 5e4                # Pa
  poissons_ratio = 0.3
  [[collider]]
  shape = "plane"
  height = 0.0
  friction = 0.4

\b
Examples:
  gasp run scene.toml
  gasp run scene.toml --engine reference-mpm --out slow.gasp --frames 5
  gasp run scene.toml --preview                       a first look, coarse
  gasp run scene.toml --set object.plant.height=0.3 --set scene.duration=4
  gasp run scene.toml --render film.mp4 --dry-run     how long it would take, and what memory
  gasp run scene.toml --render film.mp4
  gasp run scene.toml --resume        go on after Ctrl-C, a crash or a power cut
"""
)
@click.argument("scene", type=PathHere())
@click.option("--engine", metavar="NAME", help='Engine to use instead of the scene\'s; "gasp engines" lists them.')
@settings_options
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=click.Path(path_type=Path),
    help="Where to keep the frames: a folder, or s3://bucket/run.gasp and the like. [default: the scene's name with"
    " .gasp, in the current folder]",
)
@click.option("--resume", is_flag=True, help="Go on with a run that was stopped, from its last checkpoint.")
@click.option("--frames", metavar="N", type=click.IntRange(min=1), help="Stop after N frames.")
@click.option("--isolate", is_flag=True, help="Run the engine in a process of its own: its crash is an error.")
@overwrite_option("a run, and a film of it,")
@click.option(
    "--render",
    "films",
    metavar="PATH",
    multiple=True,
    type=PathHere(),
    help="Film it while it runs: film.mp4 (or .webm, .gif), sheet.png or a folder of pictures; more than one if you"
    " like.",
)
@click.option("--size", type=Size(), default="1280x720", show_default=True, help="Of a picture, in pixels.")
@click.option(
    "--preview",
    is_flag=True,
    help="A first look: the first two seconds on a coarse grid, filmed, in some 20 s of processor time; what hardly"
    " gives in volume, such as rubber, takes more, and so does the first run, which compiles."
    " SCENE.preview.gasp and .mp4 are made anew.",
)
@click.option(
    "--dry-run", is_flag=True, help="Keep nothing; print points, substeps, memory and how long it would take."
)
@most_memory_option
@trust_code_option
@click.option("--quiet", "-q", is_flag=True, help="No progress and no notes: errors alone.")
@click.option("--verbose", "-v", is_flag=True, help="A line for every frame: substeps, energy, what is odd.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON, and no progress.")
def run(
    scene: Path,
    engine: str | None,
    settings: Settings,
    out: Path | None,
    resume: bool,
    frames: int | None,
    isolate: bool,
    overwrite: bool,
    trust_code: bool,
    films: tuple[Path, ...],
    size: tuple[int, int],
    preview: bool,
    dry_run: bool,
    quiet: bool,
    verbose: bool,
    as_json: bool,
) -> None:
    """Simulate a scene and keep its frames.

    SCENE is a TOML file: which splats, what they are made of, what they meet. Every frame is safe on disk once it is
    written; Ctrl-C and SIGTERM stop cleanly and say how to go on.
    """
    if quiet and verbose:
        raise click.UsageError("--quiet and --verbose contradict each other: say one of them")
    if resume and overwrite:
        raise click.UsageError("--resume goes on with a run, --overwrite throws it away: say one of them")
    if preview and (resume or out is not None or dry_run):
        raise click.UsageError("--preview has a place of its own: leave --resume, --out and --dry-run out")
    if dry_run and (resume or frames is not None):
        raise click.UsageError("--dry-run is about the whole run: leave --resume and --frames out")
    from gasp_core import simulate
    from gasp_core.recording.address_names import address_of, path_here
    from gasp_core.rendering.video import FILMS

    if out is not None and out.suffix.lower() in (*FILMS, ".png"):
        raise click.UsageError(f"--out {out} is where frames are kept, a folder: --render {out.name} films them")

    folder = path_here(out) if out is not None else Path(scene.stem + ".gasp")
    command = ["gasp", "run", str(scene), "--resume", *(["--engine", engine] if engine else [])]
    command += settings.words()
    if isolate:
        command.append("--isolate")
    if out is not None:
        command += ["--out", str(out)]
    if trust_code:
        command.append("--trust-code")
    for path in films:
        command += ["--render", str(path)]
    loaded = settings.load(scene)
    # What was filmed of it so far is part of a run that goes on. What a preview makes where nobody has said where is
    # made anew.
    named_films, replaced = films, overwrite or resume
    if preview:
        loaded, folder, overwrite = previewed(loaded), Path(scene.stem + ".preview.gasp"), True
        films, size = films or (Path(scene.stem + ".preview.mp4"),), _PREVIEW_SIZE
    trusted = code_is_trusted(loaded, trust_code)
    if dry_run:
        shown = False if as_json or quiet else "log"
        found = estimated(loaded, engine, settings, isolate, trusted, films, size, shown=shown)
        if as_json:
            print_json({**dataclasses.asdict(found), "seconds": found.seconds})
        else:
            print_estimate(found, loaded, filmed=bool(films))
        return
    keep_what_is_there(named_films, replaced, "--render")
    from gasp_core.recording.addresses import made_here

    address = address_of(folder)
    # Whoever looks at it while it is made looks at what is on this machine.
    here = folder if address is None else made_here(address)
    with resumable(here, command), rehearsed() if films else contextlib.nullcontext():
        with filmed(here, loaded, films, size, frames, False if as_json or quiet else None) as film:
            # A preview is over before anybody would look at what there is of its film, and then it is known how all
            # of it moves.
            recorded = None if film is None or preview else film.recorded
            recording = simulate(
                loaded,
                engine=engine,
                out=address or folder,
                device=settings.device,
                precision=settings.precision,
                resume=resume,
                frames=frames,
                overwrite=overwrite,
                isolate=isolate or None,
                trust_code=trusted,
                progress=False if as_json or quiet else "log",
                recorded=_told(here, recorded) if verbose else recorded,
            )
            if film is not None and recording.frame_count:
                # A run that was gone on with may have had all its frames already.
                film.recorded(recording.frame_count - 1)
        if as_json:
            print_json(_outcome(recording))
        elif quiet:
            pass
        else:
            print_outcome(recording, address)
            made = "" if film is None or film.problem else ", ".join(shlex.quote(str(path)) for path in films)
            named = shlex.quote(address or str(folder))
            if preview:
                seen = f"a first look, coarse: {made}; " if made else ""
                click.echo(f"{seen}all of it: gasp run {shlex.quote(str(scene))}")
            else:
                click.echo(f"a film of it: {made or 'gasp render ' + named}")
                click.echo(f"splat files of it: gasp export {named} --all --format ply")
        if interrupted(recording):
            raise KeyboardInterrupt


def previewed(scene: Scene) -> Scene:
    """The beginning of a scene on a coarse grid, with few frames."""
    accuracy = scene.accuracy
    if accuracy.spacing is not None or accuracy.resolution == "auto" or accuracy.resolution > _PREVIEW_CELLS:
        scene = scene.with_resolution(_PREVIEW_CELLS)
    scene = dataclasses.replace(scene, duration=min(scene.duration, _PREVIEW_SECONDS))
    coarse = dataclasses.replace(scene, frame_rate=min(scene.frame_rate, _PREVIEW_RATE))
    if coarse.frame_count == 1:
        return scene
    # Of whole frames: what a first look leaves out is nothing that the scene's author has to be told.
    return dataclasses.replace(coarse, duration=coarse.time_of(coarse.frame_count - 1))


def print_outcome(recording: Recording, where: str | None = None) -> None:
    """Say in a line what a run came to; `where` it is, unless it is where its path says."""
    reason = f" ({recording.reason})" if recording.reason else ""
    click.echo(f"{where or recording.path}: {recording.frame_count} frames, {recording.status}{reason}")


@contextmanager
def filmed(
    folder: Path,
    scene: Scene,
    films: tuple[Path, ...],
    size: tuple[int, int],
    frames: int | None,
    progress: bool | None,
) -> Generator[LiveFilm | None]:
    """Something to tell each new frame to; the films are there in the end, or a line on stderr that says why not."""
    if not films:
        yield None
        return
    from gasp_core.rendering.live import LiveFilm

    film = LiveFilm(folder, scene, films, width=size[0], height=size[1], frames=frames, progress=progress)
    try:
        with film:
            yield film
    finally:
        if film.problem:
            click.echo(f"not filmed: {film.problem}; the run is not harmed by that: gasp render films it", err=True)
        elif film.side and progress is not False:
            click.echo(f"the film is {film.side}", err=True)


@contextmanager
def resumable(folder: Path, command: Sequence[str]) -> Generator[None]:
    """Make Ctrl-C say how to go on, where there is something to go on from."""
    try:
        yield
    except KeyboardInterrupt:
        if (folder / "zarr.json").exists():
            raise KeyboardInterrupt(f"stopped; the frames so far are kept, to go on: {shlex.join(command)}") from None
        raise


def _told(folder: Path, recorded: Callable[[int], None] | None) -> Callable[[int], None]:
    """Also a line on stderr of every frame that there was a step to."""

    opened: list[Recording] = []

    def tell(frame: int) -> None:
        from gasp_core.recording import Recording

        if not opened:
            opened.append(Recording.open(folder))
        if frame > 0:
            step = opened[0].diagnostics(frame)
            told = f"frame {frame}: {step['time']:.4g} s, {step['substeps']} substeps"
            told += f", the smallest of {step['smallest_substep']:.3g} s"
            energy = step.get("kinetic_energy")
            told += "" if energy is None else f", kinetic energy {energy:.4g} J"
            odd = {name: step.get(name) for name in ("degenerate", "clipped", "inverted", "stretched")}
            told += "".join(f", {count} {name}" for name, count in odd.items() if count)
            click.echo(told, err=True)
        if recorded is not None:
            recorded(frame)

    return tell


def interrupted(recording: Recording) -> bool:
    """Whether Ctrl-C or SIGTERM ended the run; the driver stops cleanly then and returns what there is."""
    return recording.status == "incomplete" and recording.reason.startswith("interrupted after frame")


def _outcome(recording: Recording) -> dict[str, object]:
    """What programs want to know of a run."""
    return {
        "recording": str(recording.path),
        "status": recording.status,
        "reason": recording.reason,
        "engine": recording.engine.name,
        "frame_count": recording.frame_count,
        "frames_wanted": recording.frames_wanted,
        "times": [float(time) for time in recording.times],
        "notes": list(recording.notes),
    }
