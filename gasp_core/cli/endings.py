"""Names of splat files by their formats, and of what is written."""

from __future__ import annotations

import re
from pathlib import Path

import click

__all__ = ["SUFFIXES", "frames_in", "refuse_a_file", "refuse_another_ending"]

SUFFIXES = {"ply": ".ply", "splat": ".splat", "spz": ".spz", "sog": ".sog", "glb": ".glb", "usd": ".usdc"}


def refuse_another_ending(path: Path, suffix: str | None) -> None:
    """Refuse a file's name that does not end as the format wants it.

    Raises
    ------
    click.UsageError
        Where it does not.
    """
    from gasp_core.io.usd import USD_SUFFIXES

    allowed = {None: (path.suffix.lower(),), "usd": USD_SUFFIXES}.get(suffix) or (SUFFIXES[str(suffix)],)
    if path.suffix.lower() not in allowed:
        raise click.UsageError(f"--out {path} does not end in {allowed[0]}, as --format {suffix} wants it")


def refuse_a_file(folder: Path) -> None:
    """Refuse a folder's name that ends as a splat file does: whoever says it wants that format, or one file.

    Raises
    ------
    click.UsageError
        Where it does.
    """
    from gasp_core.io.usd import USD_SUFFIXES

    ending = folder.suffix.lower()
    if ending in (*SUFFIXES.values(), *USD_SUFFIXES):
        raise click.UsageError(
            f"--out {folder} is to be a folder, a file a frame: name it without {ending}; --format says what they are"
        )


def frames_in(folder: Path, *, stem: str, suffix: str) -> list[Path]:
    """The frames ``stem_0000.suffix`` ... that have been written into a folder."""
    name = re.compile(rf"{re.escape(stem)}_[0-9]{{4,}}{re.escape(suffix)}")
    return [path for path in sorted(folder.glob("*")) if name.fullmatch(path.name)]
