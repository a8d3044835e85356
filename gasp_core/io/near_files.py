"""Which file was probably meant where a path leads to none."""

from __future__ import annotations

import contextlib
import difflib
import os
from pathlib import Path

from gasp_core.io.format_errors import shown

__all__ = ["did_you_mean_file"]

_MOST = 10_000
"""Names in a folder that are looked through."""
_NEAR = 0.8
"""How near a name with another ending has to be, of 1."""


def did_you_mean_file(path: Path) -> str:
    """The end of a message, ``, did you mean ...?``, where a file of nearly that name lies in the same folder; else
    nothing."""
    names: list[str] = []
    with contextlib.suppress(OSError, ValueError), os.scandir(path.parent) as entries:
        names = [entry.name for entry, _ in zip(entries, range(_MOST))]
    # An ending is common to many, and says nothing of how near the others are.
    stems = {Path(name).stem: name for name in sorted(names) if Path(name).suffix == path.suffix}
    close = [stems[stem] for stem in difflib.get_close_matches(path.stem, stems, n=1)]
    close = close or difflib.get_close_matches(path.name, sorted(names), n=1, cutoff=_NEAR)
    return f", did you mean {shown(close[0])}?" if close else ""
