"""What lies inside a set of cells, for engines that fill bodies; needs NumPy alone.

A trained splat is a shell: points lie where its surface was seen, and few inside. A cell is taken to be inside where
most rays from it along the axes run into the shell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["enclosed"]

Array = NDArray[Any]

_BLOCKED = 5
"""Of the six rays. All six would call the inside of a cup outside, and that of an object that stood on a table and was
never seen from below; and holes in a trained shell let rays through. Four would fill a tube."""


def enclosed(occupied: Array) -> Array:
    """The cells inside a set of them.

    Parameters
    ----------
    occupied : (I, J, K) bool
        Which cells of a box hold something.

    Returns
    -------
    (I, J, K) bool: the empty cells from which at least five of the six rays along the axes run into occupied ones.
    """
    rays = np.zeros(occupied.shape, dtype=np.int8)
    for axis in range(3):
        for cells, counted in ((occupied, rays), (np.flip(occupied, axis), np.flip(rays, axis))):
            counted += np.logical_or.accumulate(cells, axis=axis)
    return (rays >= _BLOCKED) & ~occupied
