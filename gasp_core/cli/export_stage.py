"""``gasp export`` into USD: one stage of all frames."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from gasp_core.errors import RecordingError

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians
    from gasp_core.recording import Recording
    from gasp_core.scene.objects import UpAxis

__all__ = ["export_stage", "is_stage", "readable"]

_GRAINS = "grains"
"""What the grains of all objects are called, unless an object is."""


def readable(
    read: Callable[[int], Gaussians], frames: Iterable[int], damaged: list[str]
) -> Generator[tuple[int, Gaussians]]:
    """Frames that `read` can read, by their numbers; of each other one a line goes into `damaged`.

    Raises
    ------
    RecordingError
        Where no frame can be read, or one takes more memory than there is.
    """
    from gasp_core.recording.files import TooLargeError

    found = False
    for frame in frames:
        try:
            gaussians = read(frame)
        except TooLargeError:
            raise
        except RecordingError as error:
            damaged.append(str(error))
            continue
        found = True
        yield frame, gaussians
    if not found:
        raise RecordingError(f"{damaged[0]}; no frame can be read")


def is_stage(path: Path) -> bool:
    """Whether a name is that of a stage."""
    from gasp_core.io.usd import USD_SUFFIXES

    return path.suffix.lower() in USD_SUFFIXES


def export_stage(
    recording: Recording, frames: Iterable[int], path: Path, *, as_drawn: bool, up: UpAxis | None, moves: bool
) -> list[str]:
    """Write frames into one stage, an object a prim; those that are damaged are left out.

    Returns
    -------
    A line for every frame that was left out.

    Raises
    ------
    click.UsageError
        Where USD knows no such axis.
    RecordingError, SplatFormatError
        Where no frame can be read, or the stage not be written.
    """
    from gasp_core.io.usd import splat_stage
    from gasp_core.recording.drawn import DrawnFrames
    from gasp_core.scene.placement import with_up

    if up not in (None, "+y", "+z"):
        raise click.UsageError(f"--up {up} is none of USD's axes: +y or +z")
    read = DrawnFrames(recording).gaussians if as_drawn else recording.gaussians
    damaged: list[str] = []
    rate = recording.header.frame_rate if moves else None
    with splat_stage(path, up_axis="Y" if up == "+y" else "Z", frame_rate=rate) as stage:
        for frame, gaussians in readable(read, frames, damaged):
            stage.add(frame, _by_object(recording, with_up(gaussians, up) if up == "+y" else gaussians))
    return damaged


def _by_object(recording: Recording, gaussians: Gaussians) -> dict[str, Gaussians]:
    runs = [(item.name, item.first, item.last) for item in recording.header.objects]
    own = {name for name, _, _ in runs}
    grains = _GRAINS
    while grains in own:
        grains += "_"
    runs.append((grains, max(last for _, _, last in runs), len(gaussians)))
    return {name: gaussians.select(np.arange(first, last)) for name, first, last in runs if last > first}
