"""Several splats of one file as one, and what is true of their numbers in every file that has them activated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.format_errors import malformed

__all__ = ["in_unit_range", "stacked"]

Array = NDArray[Any]

_ROUNDING = 1e-4
"""By which an opacity may leave 0..1: float16 is no finer near 1."""


def in_unit_range(opacities: Array, path: Path) -> Array:
    """Opacities (N,) without what rounding has added; what is not finite stays.

    Raises
    ------
    SplatFormatError
        Where some are beyond 0..1.
    """
    outside = (opacities < -_ROUNDING) | (opacities > 1 + _ROUNDING)
    if outside.any():
        row = int(np.argmax(outside))
        raise malformed(path, f"Gaussian {row:,} has the opacity {opacities[row]:.3g}, where 0 to 1 belongs")
    return np.clip(opacities, 0, 1)


def stacked(pieces: Sequence[Gaussians]) -> Gaussians:
    """All Gaussians of some splats, one behind the other; harmonics that one has and others have not are 0 in these."""
    if len(pieces) == 1:
        return pieces[0]
    names = ("means", "quaternions", "scales", "opacities")
    harmonics = np.zeros((sum(map(len, pieces)), max(piece.harmonics.shape[1] for piece in pieces), 3), np.float32)
    start = 0
    for piece in pieces:
        harmonics[start : start + len(piece), : piece.harmonics.shape[1]] = piece.harmonics
        start += len(piece)
    return Gaussians(
        **{name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in names}, harmonics=harmonics
    )
