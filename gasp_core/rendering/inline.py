"""Pictures and films inside a page, as notebooks show them: nothing is written that stays."""

from __future__ import annotations

import base64
import tempfile
from html import escape
from pathlib import Path

import numpy as np

from gasp_core.errors import GaspError
from gasp_core.gaussians import Gaussians
from gasp_core.recording import Recording
from gasp_core.rendering.filming import film
from gasp_core.rendering.footage import Footage, RecordedFootage, SceneFootage, Still
from gasp_core.scene.floaters import floating
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import UpAxis
from gasp_core.scene.placement import robust_box
from gasp_core.scene.standing import guess_up

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
        footage, said = _described(shown)
        picture = _drawn(footage)
    except GaspError as error:
        return f"<pre>{escape(repr(shown)[:200])}\nno picture: {escape(str(error))}</pre>"
    return f'<div>{picture}<div style="font-size: smaller">{escape(said)}</div></div>'


def _described(shown: object) -> tuple[Footage, str]:
    """What is to be drawn, and what is said of it."""
    if isinstance(shown, Recording):
        reason = f" ({shown.reason})" if shown.reason else ""
        return RecordedFootage(shown), f"{shown.path}: {shown.frame_count} frames, {shown.status}{reason}"
    if isinstance(shown, Scene):
        what = ", ".join(item.name for item in shown.objects)
        return SceneFootage(shown, Path("scene")), f"{what}: {shown.duration:g} s, {shown.engine.name}"
    assert isinstance(shown, Gaussians)
    up = _up(shown)
    return Still(shown, up, Path("gaussians")), f"{len(shown):,} Gaussians, degree {shown.sh_degree}, seen {up} up"


def _up(gaussians: Gaussians) -> UpAxis:
    """Its widest end is down, as of a file; where that says nothing, its longer side is upright."""
    seen = gaussians.select(np.isfinite(gaussians.means).all(axis=1))
    seen = seen.select(~floating(seen.means))
    up, sure = guess_up(seen)
    if sure or len(seen) == 0:
        return up
    lower, upper = robust_box(seen.means)
    return "+z" if upper[2] - lower[2] > upper[1] - lower[1] else "-y"


def _drawn(footage: Footage) -> str:
    """A picture of one frame, a film of more."""
    count = footage.frame_count
    frames = sorted(set(np.linspace(0, count - 1, min(count, _MOST_FRAMES)).round().astype(int).tolist()))
    kind = "webm" if count > 1 else "png"
    with tempfile.TemporaryDirectory(prefix="gasp-") as folder:
        path = Path(folder) / f"shown.{kind}"
        rate = footage.frame_rate * len(frames) / max(count, 1)
        film(footage, path, size=_SIZE, frames=frames, rate=rate, progress=False)
        data = base64.b64encode(path.read_bytes()).decode("ascii")
    if kind == "png":
        return f'<img src="data:image/png;base64,{data}" width="{_SIZE[0]}">'
    source = f'<source src="data:video/webm;base64,{data}" type="video/webm">'
    return f'<video width="{_SIZE[0]}" controls autoplay loop muted playsinline>{source}</video>'
