"""What somebody probably meant who wrote what is no TOML."""

from __future__ import annotations

import re

from gasp_core.io.format_errors import shown
from gasp_core.scene.changes import completed_decimals

__all__ = ["explained"]

_PLACE = re.compile(r"\(at line (\d+), column \d+\)")
_KEY = re.compile(r"\s*[\w.\-\"']+\s*=\s*")
_COMMA = re.compile(r"[+-]?\d+,\d+")
_WORD = re.compile(r"[A-Za-z~$/][^\s#\"'=\[\]{},]*")
_LONGEST_LINE, _LONGEST = 80, 200


def explained(error: ValueError, text: str) -> str:
    """The parser's message with the line that it is about, and how TOML has what seems to be meant there.

    Parameters
    ----------
    error
        Of `tomllib`.
    text
        What it read.
    """
    said = shown(error)[:_LONGEST]
    place = _PLACE.search(said)
    if place is None:
        return said
    # As TOML counts them: other signs that Python takes for a line's end are none there.
    lines = text.split("\n")
    line = lines[int(place[1]) - 1].strip() if int(place[1]) <= len(lines) else ""
    if not line:
        return said
    meant = _meant(line)
    quoted = shown(line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}...")
    return f"{said}: {quoted}{f': {meant}' if meant else ''}"


def _meant(line: str) -> str:
    value = _KEY.sub("", line, count=1)
    own = value.split("#")[0].strip()
    if _COMMA.fullmatch(own):
        return f"a number has a point, {own.replace(',', '.')}"
    if completed_decimals(value) != value:
        return "a number has digits before and after its point, 0.5 and 2.0"
    if own in ("True", "False"):
        return f"it is written {own.lower()}"
    if line.count('"') % 2:
        return "a text ends with the quote that it begins with"
    if value != line and _WORD.fullmatch(own):
        return f'a text has quotes, "{shown(own)[:_LONGEST_LINE]}"'
    return ""
