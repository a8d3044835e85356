"""What is said of a file that cannot be read or written: one line, with the file, the fault and the remedy."""

from __future__ import annotations

from os import PathLike, fspath

from gasp_core.errors import SplatFormatError

__all__ = ["malformed", "quoted", "shown"]

_LONGEST_QUOTE = 60


def shown(text: object) -> str:
    """Text from outside made fit for one line of a terminal: control characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))


def quoted(text: object) -> str:
    """A name found in a file, in quotes and shortened."""
    line = shown(text)
    return repr(line if len(line) <= _LONGEST_QUOTE else line[:_LONGEST_QUOTE] + "...")


def malformed(
    path: str | PathLike[str], what: str, remedy: str = "the file is damaged or not what its name says: fetch it again"
) -> SplatFormatError:
    """The error for a file: where, what is wrong, what to do."""
    return SplatFormatError(f"{shown(fspath(path))}: {what}; {remedy}")
