"""How much a packed file may unpack to."""

from __future__ import annotations

from os import PathLike

from gasp_core.io.format_errors import malformed

__all__ = ["MOST_GAUSSIANS", "refuse_bomb"]

MOST_GAUSSIANS = 1 << 26
"""67 million: some 16 GB with harmonics of degree 3, beyond which a packed file is not believed."""

_HARMLESS = 1 << 28
_STEEPEST = 100
"""Trained splats pack 2 to 4 times; a hundred, over a quarter of a gigabyte, is no splat."""


def refuse_bomb(path: str | PathLike[str], packed: int, unpacked: int, count: int) -> None:
    """Refuse a file that declares far more than its size can honestly hold, before anything is unpacked.

    Parameters
    ----------
    path
        The file, for the message.
    packed, unpacked
        Bytes as stored and bytes as declared.
    count
        Gaussians as declared.

    Raises
    ------
    SplatFormatError
        Where it is a bomb, or declares no or too many Gaussians.
    """
    if count == 0:
        raise malformed(path, "it declares 0 Gaussians", "export it again")
    if count > MOST_GAUSSIANS:
        raise malformed(path, f"it declares {count:,} Gaussians, more than the {MOST_GAUSSIANS:,} a packed file may")
    if unpacked > _HARMLESS and unpacked > _STEEPEST * packed:
        raise malformed(path, f"{packed:,} bytes would unpack to {unpacked:,}, as no real splat does")
