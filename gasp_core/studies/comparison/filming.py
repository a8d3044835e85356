"""Films of all runs from one camera, and how like their pictures are."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.accuracy.images import psnr, ssim
from gasp_core.errors import GaspError, RenderingError
from gasp_core.progress import counting
from gasp_core.recording import Recording
from gasp_core.rendering.footage import RecordedFootage
from gasp_core.rendering.framing import Motion, motion_of
from gasp_core.rendering.painting import FramePainter
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.sides import with_side
from gasp_core.rendering.video import FilmFile
from gasp_core.rendering.viewpoints import cameras_for
from gasp_core.scene.settings import CameraChoice
from gasp_core.studies.comparison.measures import Likeness

__all__ = ["Filmed", "film_all"]

Array = NDArray[Any]

_PICTURES = 16
"""Frames whose pictures are compared."""
_WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Filmed:
    """What filming left.

    Parameters
    ----------
    films
        By the name of the engine.
    likenesses
        By the names of two.
    notes
        What could not be done, and why.
    """

    films: Mapping[str, Path]
    likenesses: Mapping[tuple[str, str], Likeness]
    notes: tuple[str, ...]


def film_all(recordings: Mapping[str, Recording], folder: Path, size: tuple[int, int], progress: bool | None) -> Filmed:
    """Film recordings of the same scene, each as long as it is, from the scene's camera or one that sees them all.

    Parameters
    ----------
    recordings
        By the name of the engine, each with at least one frame.
    folder
        For the films.
    size [px]
        Width and height of a picture.
    progress
        Show a bar; None: where stderr is a terminal.
    """
    if not recordings:
        return Filmed(films={}, likenesses={}, notes=())
    tallies = {pair: _Tally() for pair in itertools.combinations(recordings, 2)}
    try:
        notes = _painted(recordings, {name: folder / f"{name}.mp4" for name in recordings}, size, tallies, progress)
    except GaspError as error:
        # What the runs were is worth a page without pictures too.
        return Filmed(films={}, likenesses={}, notes=(f"not filmed: {error}",))
    return Filmed(
        films={name: folder / f"{name}.mp4" for name in recordings},
        likenesses={pair: tally.likeness() for pair, tally in tallies.items() if tally.frames},
        notes=notes,
    )


def _painted(
    recordings: Mapping[str, Recording],
    films: Mapping[str, Path],
    size: tuple[int, int],
    tallies: Mapping[tuple[str, str], _Tally],
    progress: bool | None,
) -> tuple[str, ...]:
    """Paint every frame once, for the films and the tallies; why there are no tallies, where there are none."""
    footages = {name: RecordedFootage(recording) for name, recording in recordings.items()}
    counts = {name: footage.frame_count for name, footage in footages.items()}
    longest = max(counts.values())
    # The frames of all runs, one after the other; where the camera goes, it goes with the longest, which is the first.
    inline = sorted(footages, key=lambda name: -counts[name])
    shown = [(footages[name], frame) for name in inline for frame in range(counts[name])]
    before = np.cumsum([0] + [counts[name] for name in inline])
    motion = Motion.joined([motion_of(footages[name]).later(int(k)) for name, k in zip(inline, before)])
    first, renderer = footages[inline[0]], open_renderer()
    choice = with_side(first.camera or CameraChoice(), motion, first.colliders, width=size[0], height=size[1])
    cameras = cameras_for(
        first,
        choice,
        motion=motion,
        subject=lambda number: shown[number][0].subject(shown[number][1]),
        numbers=range(longest),
        renderer=renderer,
        width=size[0],
        height=size[1],
    )
    painters = {
        name: FramePainter(footage, renderer, motion=motion, background=_WHITE) for name, footage in footages.items()
    }
    compared = {round(frame) for frame in np.linspace(1, longest - 1, _PICTURES)} - {0}
    trouble = ""
    with ExitStack() as stack, counting(progress, "picture", sum(counts.values())) as painted:
        outputs = {name: stack.enter_context(FilmFile(path, first.frame_rate)) for name, path in films.items()}
        for frame in range(longest):
            pictures = {name: painters[name].paint(frame, cameras[frame]) for name in films if frame < counts[name]}
            for name, picture in pictures.items():
                outputs[name].take(picture, frame / first.frame_rate)
                painted()
            if frame in compared and not trouble:
                trouble = _compared(pictures, tallies, frame)
    return (trouble,) if trouble else ()


class _Tally:
    """Gathers the pictures of a pair."""

    def __init__(self) -> None:
        self.frames: list[int] = []
        self._squares: list[float] = []
        self._ssims: list[float] = []

    def add(self, frame: int, first: Array, second: Array) -> None:
        self._squares.append(10.0 ** (-psnr(first, second) / 10))
        self._ssims.append(ssim(first, second))
        self.frames.append(frame)

    def likeness(self) -> Likeness:
        with np.errstate(divide="ignore"):
            decibels = float(-10 * np.log10(np.mean(self._squares)))
        return Likeness(frames=tuple(self.frames), psnr=decibels, ssim=float(np.mean(self._ssims)))


def _compared(pictures: Mapping[str, Array], tallies: Mapping[tuple[str, str], _Tally], frame: int) -> str:
    """Compare pictures of a frame; why that cannot be done, where it cannot."""
    shown = {name: picture / 255 for name, picture in pictures.items()}
    try:
        for (first, second), tally in tallies.items():
            if first in shown and second in shown:
                tally.add(frame, shown[first], shown[second])
    except RenderingError as error:
        return f"pictures not compared: {error}"
    return ""
