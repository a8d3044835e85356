"""Numbers that vary from point to point as rows of a table: engines know materials, each of so many points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_ROWS", "rounded_rows"]

Array = NDArray[Any]

MOST_ROWS = 4096
"""Of one material: its table stays in a processor's cache."""
_STEP = math.log(1.01)


def rounded_rows(values: Mapping[str, Array], most: int = MOST_ROWS) -> tuple[Array, Array, float]:
    """Rows for values that belong together, few enough of them.

    Values of no more than so many different combinations stay what they are. Others are rounded, density and Young's
    modulus in steps of 1 %, and so is 1 - 2 nu, to which Lame's lambda goes with its inverse: all stiffnesses are off
    by half a step each. Where those are still too many rows, steps are twice as large, until they are few enough.

    Parameters
    ----------
    values
        By name, "density", "youngs_modulus", "poissons_ratio", (M,) each.
    most
        Rows.

    Returns
    -------
    table : (R, F)
        The rows, a column for each name.
    rows : (M,)
        Of each point.
    off : float
        By how much a value, of Poisson's ratio 1 - 2 nu, is off at most, relative.
    """
    exact = np.stack(list(values.values()), axis=1)
    table, rows = np.unique(exact, axis=0, return_inverse=True)
    if len(table) <= most:
        return table, rows.reshape(-1), 0.0
    maps = [_MAPS[name] for name in values]
    logarithms = np.stack([there(column) for (there, _), column in zip(maps, exact.T)], axis=1)
    step = _STEP
    while True:
        codes, rows = np.unique(np.round(logarithms / step).astype(np.int64), axis=0, return_inverse=True)
        if len(codes) <= most:
            break
        step *= 2
    rows = rows.reshape(-1)
    table = np.stack([back(step * column) for (_, back), column in zip(maps, codes.T)], axis=1)
    off = float(np.expm1(np.abs(step * codes[rows] - logarithms).max()))
    return table, rows, off


Map = Callable[[Array], Array]
_MAPS: dict[str, tuple[Map, Map]] = {
    "density": (np.log, np.exp),
    "youngs_modulus": (np.log, np.exp),
    "poissons_ratio": (lambda ratios: np.log(1 - 2 * ratios), lambda logarithms: (1 - np.exp(logarithms)) / 2),
}
