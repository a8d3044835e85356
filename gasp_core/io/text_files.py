"""Short texts that come from outside: read up to a length, whatever they claim to be."""

from __future__ import annotations

from pathlib import Path

__all__ = ["LONGEST_TEXT", "read_text"]

LONGEST_TEXT = 1 << 24
"""Bytes: a list of cameras has a kilobyte for each."""


def read_text(path: Path, most: int = LONGEST_TEXT) -> str:
    """The text of a file in UTF-8.

    Parameters
    ----------
    path
        A file, or a pipe that ends; of a device without an end no more than `most` is read.
    most
        Bytes.

    Raises
    ------
    OSError
        Where it cannot be read.
    UnicodeDecodeError
        Where it is no text.
    ValueError
        Where it is longer, or the path holds a null character.
    """
    with path.open("rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"is longer than the {most:,} bytes it may have")
    return content.decode("utf-8")
