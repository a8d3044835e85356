"""Pictures and films inside a page, as notebooks show them: nothing is written that stays."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from html import escape
from pathlib import Path

import numpy as np

from gasp_core.errors import GaspError
from gasp_core.gaussians import Gaussians
from gasp_core.recording import Recording
from gasp_core.rendering.filming import render
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import UpAxis
from gasp_core.scene.placement import robust_box
from gasp_core.scene.standing import guess_up, standing_part

__all__ = ["html_of"]

_SIZE = (640, 360)
"""Of a picture [px]."""
_MOST_FRAMES = 100
"""Of a film: more are thinned out, so that a cell of a notebook ends within seconds."""


def html_of(shown: object) -> str:
    """A picture of Gaussians or of a scene before its first step, a film of a recording.

    Returns
    -------
    HTML that needs no other file, a line of text below the picture; where there can be no picture, the reason.
    """
    try:
        if isinstance(shown, Recording):
            picture, said = _film(shown), f"{shown.path}: {shown.frame_count} frames, {shown.status}"
            said += f" ({shown.reason})" if shown.reason else ""
        elif isinstance(shown, Scene):
            names = ", ".join(item.name for item in shown.objects)
            picture, said = _picture(shown), f"{names}: {shown.duration:g} s, {shown.engine.name}"
        else:
            assert isinstance(shown, Gaussians)
            up = _up(shown)
            picture = _picture(shown, up)
            said = f"{len(shown):,} Gaussians, degree {shown.sh_degree}, seen {up} up"
    except GaspError as error:
        return f"<pre>{escape(repr(shown)[:200])}\nno picture: {escape(str(error))}</pre>"
    return f'<div>{picture}<div style="font-size: smaller">{escape(said)}</div></div>'


def _up(gaussians: Gaussians) -> UpAxis:
    """Its widest end is down, as of a file; where that says nothing, its longer side is upright."""
    seen = standing_part(gaussians)
    up, sure = guess_up(seen)
    if sure or len(seen) == 0:
        return up
    lower, upper = robust_box(seen.means)
    return "+z" if upper[2] - lower[2] > upper[1] - lower[1] else "-y"


def _picture(shown: Scene | Gaussians, up: UpAxis = "-y") -> str:
    with _written("png") as path:
        render(shown, path, size=_SIZE, up=up, progress=False)
        return f'<img src="{_address(path, "image/png")}" width="{_SIZE[0]}">'


def _film(recording: Recording) -> str:
    count = recording.frame_count
    shown = min(count, _MOST_FRAMES)
    frames = np.linspace(0, count - 1, shown).round().astype(int).tolist()
    with _written("webm") as path:
        render(recording, path, size=_SIZE, frames=frames, slower=max(count, 1) / max(shown, 1), progress=False)
        source = f'<source src="{_address(path, "video/webm")}" type="video/webm">'
        return f'<video width="{_SIZE[0]}" controls autoplay loop muted playsinline>{source}</video>'


@contextmanager
def _written(kind: str) -> Generator[Path]:
    """A file that is there for a moment."""
    with tempfile.TemporaryDirectory(prefix="gasp-") as folder:
        yield Path(folder) / f"shown.{kind}"


def _address(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
