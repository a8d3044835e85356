"""``gasp run --dry-run``: what a run will take, before it is made."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.settings import Settings
from gasp_core.errors import EngineCrashedError, EngineDivergedError, GaspError
from gasp_core.progress import Shown, duration, progress_for
from gasp_core.quantities import bytes_told, length_told

if TYPE_CHECKING:
    from gasp_core.scene.model import Scene
    from gasp_core.simulation.estimate import Estimate

__all__ = ["estimated", "print_estimate"]


def estimated(
    scene: Scene,
    engine: str | None,
    settings: Settings,
    isolate: bool,
    trusted: bool,
    films: tuple[Path, ...],
    size: tuple[int, int],
    *,
    shown: Shown = "log",
) -> Estimate:
    """Run the first moments of a scene, and film them as all of it is to be filmed, where nobody looks.

    `shown`: where it is told how long that takes.
    """
    from gasp_core.processes.scratch import scratch_folder
    from gasp_core.rendering.live import LiveFilm
    from gasp_core.simulation.estimate import estimate_run, first_moments

    with scratch_folder("gasp-dry-run-") as scratch:
        folder = scratch / "run.gasp"
        # A sheet is a dozen pictures, however long the run.
        painted = [scratch / f"{number}-{path.name}" for number, path in enumerate(films) if path.suffix != ".png"]
        film = LiveFilm(folder, first_moments(scene), painted, width=size[0], height=size[1]) if painted else None
        try:
            with progress_for(shown, 0) as progress, film or nullcontext():
                progress.enter("trying its first moments")
                return estimate_run(
                    scene,
                    folder,
                    engine,
                    device=settings.device,
                    precision=settings.precision,
                    isolate=isolate or None,
                    trust_code=trusted,
                    recorded=film.recorded if film is not None else None,
                )
        except (EngineDivergedError, EngineCrashedError) as error:
            # What is kept of it is gone with the folder.
            told = re.sub(rf"; (the )?frames [^;]*kept in {re.escape(str(folder))}", "", str(error))
            raise GaspError(f"the run would stop: {told}") from error


def print_estimate(found: Estimate, scene: Scene, *, filmed: bool) -> None:
    """Say it in a few lines, the time last."""
    from gasp_core.contract import Fluid, Sand, Snow
    from gasp_core.scene.objects import laws_of
    from gasp_core.simulation.estimate import EITHER_WAY

    for note in found.notes:
        click.echo(note)
    film = " and the film" if filmed else ""
    flows = any(isinstance(law, (Fluid, Sand, Snow)) for item in scene.objects for law in laws_of(item))
    beyond = "; what flows may take several times as long" if flows else ""
    rows = {
        "engine": f"{found.engine} on {found.device}, {found.precision}",
        "points": f"{found.points:,}, which carry {found.gaussians:,} Gaussians",
        "grid": f"{found.cells} cells of {length_told(found.spacing)} along the largest object",
        "substeps": f"some {_rounded(found.substeps)}, the first of {1e6 * found.substep:.3g} us"
        if found.substeps
        else "none: the start alone is kept",
        "memory": bytes_told(found.memory),
        "disk": bytes_told(found.disk),
        "time": f"{duration(found.seconds)}: {duration(found.start_seconds)} to begin,"
        f" {duration(found.engine_seconds)} of substeps, {duration(found.frame_seconds)} for {found.frames:,}"
        f" {'frame' if found.frames == 1 else 'frames'}{film}"
        f"{', which takes this again where things go elsewhere than they would fly' if filmed else ''}",
        "": f"between {duration(found.seconds / EITHER_WAY)} and {duration(found.seconds * EITHER_WAY)} probably"
        f"{beyond}",
    }
    width = max(map(len, rows)) + 2
    for name, value in rows.items():
        click.echo(f"{name:{width}}{value}")


def _rounded(count: int) -> str:
    """To two digits: more nobody knows."""
    return f"{int(float(f'{count:.1e}')):,}"
