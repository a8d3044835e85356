"""A page that plays a moving splat: one file, for any browser, without a network."""

from __future__ import annotations

import base64
import re
from html import escape
from pathlib import Path

from gasp_core.io.atomic import replacing

__all__ = ["write_page"]

_PAGE = Path(__file__).parent / "page"
_SCRIPTS = ("decoder.js", "splat.js", "ground.js", "painter.js", "player.js")
"""Each imports from those before it alone."""


def write_page(path: Path, splat: bytes, title: str) -> None:
    """Write a page that has a moving splat inside.

    Parameters
    ----------
    path
        Where to; an existing file is replaced.
    splat
        As `gasp_core.moving.packing.pack` writes it.
    title
        Of the page.

    Raises
    ------
    SplatFormatError
        Where the disk refuses.
    """
    page = (_PAGE / "page.html").read_text(encoding="utf-8")
    parts = {"title": escape(title), "splat": base64.b64encode(splat).decode("ascii"), "script": _script()}
    # In one pass: what is put in may look like a place for more.
    content = re.sub(r"\{\{ (\w+) \}\}", lambda found: parts[found[1]], page)
    with replacing(path) as stream:
        stream.write(content.encode())


def _script() -> str:
    """All modules as one: names are theirs alone."""
    texts = [(_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS]
    text = "\n".join(texts)
    text = re.sub(r"^import .*;\n", "", text, flags=re.MULTILINE)
    return re.sub(r"^export ", "", text, flags=re.MULTILINE)
