"""How much memory a splat file may take: what it holds says so, and what the machine has."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from gasp_core.errors import GaspError
from gasp_core.io.format_errors import malformed

__all__ = [
    "VARIABLE",
    "available_memory",
    "may_take",
    "memory_limit",
    "memory_of",
    "most_gaussians",
    "most_memory",
    "refuse_too_large",
    "refuse_unread",
]

VARIABLE = "GASP_MOST_MEMORY"
"""In the environment, so that threads and processes that are started for a run know it as well."""

_HARMLESS = 40 << 20
"""Any file may take it. With a palette of harmonics, 20 MB at most, a small file stays below 64 MB."""
_STEEPEST = 100
"""Bytes of memory for each byte of a packed file. Trained splats take 20 to 45 as .sog, fewer as anything else."""
_MOST_GAUSSIANS = 1 << 40
"""A tebi: beyond it a count is a mistake, and no number to print."""
_REMEDY = "if it is a true splat and the machine has room, allow it with --most-memory or gasp_core.io.memory_limit"


@contextmanager
def memory_limit(most: int) -> Generator[None]:
    """Let every splat that is read inside take so much memory, whatever its size and whatever the machine has.

    Holds for this process, all its threads, and those it starts.

    Parameters
    ----------
    most
        Bytes, > 0, for reading one file.

    Raises
    ------
    GaspError
        Where it is no positive number.
    """
    if most <= 0:
        raise GaspError(f"the most memory a splat may take must be a number of bytes > 0, found {most}")
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(most)
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def memory_of(count: int, bases: int) -> int:
    """Bytes that reading so many Gaussians with so many harmonics takes at most, what is thrown away again included.

    Their float32 are 44 + 12 * bases; steps in between are float64, and hold all of them at a time (measured over all
    formats: 3 to 5 times the float32).
    """
    return count * (240 + 36 * bases)


def may_take(held: int) -> int:
    """Bytes of memory that so many bytes of a packed file can honestly mean."""
    return max(_HARMLESS, _STEEPEST * held)


def most_memory(path: str | PathLike[str], held: int) -> int:
    """Bytes of memory, at most, that so many bytes can honestly mean, and that the machine has room for.

    Raises
    ------
    SplatFormatError
        Where what the environment allows is no number.
    """
    allowed = _allowed(path)
    return min(may_take(held), max(_HARMLESS, available_memory())) if allowed is None else allowed


def most_gaussians(path: str | PathLike[str], held: int) -> int:
    """Gaussians, at most, that so many bytes can honestly mean, and that the machine has room for.

    Raises
    ------
    SplatFormatError
        Where what the environment allows is no number.
    """
    return most_memory(path, held) // memory_of(1, 0)


def refuse_too_large(path: str | PathLike[str], held: int, count: int, bases: int) -> None:
    """Refuse a file that would take more memory than its size can honestly mean, or than there is.

    Asked before anything is unpacked, of the count that a header declares.

    Parameters
    ----------
    path
        The file, for the message.
    held
        Its bytes.
    count, bases
        Gaussians, and harmonics of each, as declared.

    Raises
    ------
    SplatFormatError
        Where it is so, or where it declares no Gaussians.
    """
    if count == 0:
        raise malformed(path, "it declares 0 Gaussians", "export it again")
    if count > _MOST_GAUSSIANS:
        raise malformed(path, "it declares more Gaussians than any file can hold")
    need, honest = memory_of(count, bases), may_take(held)
    allowed = _allowed(path)
    told = f"its {count:,} Gaussians would take {_size(need)} of memory"
    if allowed is not None:
        if need > allowed:
            raise malformed(path, f"{told}, {_size(allowed)} are allowed", "allow more with --most-memory")
        return
    if need > honest:
        raise malformed(path, f"{told}, which its {held:,} bytes cannot honestly mean", _REMEDY)
    if need > _HARMLESS and need > (there := available_memory()):
        raise malformed(path, f"{told}, the machine has {_size(there)} free", _REMEDY)


def refuse_unread(path: Path, size: int) -> None:
    """Refuse a file whose bytes alone are more than may be taken; nothing of it has been read.

    Raises
    ------
    SplatFormatError
        Where it is so.
    """
    if size <= _HARMLESS:
        return
    allowed = _allowed(path)
    most = available_memory() if allowed is None else allowed
    if size > most:
        raise malformed(path, f"is {_size(size)} large, {_size(most)} of memory may be taken", _REMEDY)


def _allowed(path: str | PathLike[str]) -> int | None:
    """What somebody has allowed, in bytes."""
    text = os.environ.get(VARIABLE)
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) > 0):
        raise malformed(
            path, f"was not read: the environment's {VARIABLE} must be a number of bytes", "set or unset it"
        )
    return int(text)


def available_memory() -> int:
    """Bytes that this process can still get: of the machine, or of the container it runs in."""
    import psutil

    free = int(psutil.virtual_memory().available)
    # Version 2 of control groups, as seen from inside a container; elsewhere there are no such files.
    group = Path("/sys/fs/cgroup")
    try:
        most, used = ((group / name).read_text().strip() for name in ("memory.max", "memory.current"))
    except OSError:
        return free
    return min(free, int(most) - int(used)) if most.isdigit() and used.isdigit() else free


def _size(count: int) -> str:
    """Bytes for people."""
    return f"{count / 1e9:,.1f} GB" if count >= 1e9 else f"{count / 1e6:,.0f} MB"
