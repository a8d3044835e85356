"""Where matter is held that no simple shape is around: the places nearer to it than to any other of its body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import SignedDistanceField
from gasp_core.errors import SceneError
from gasp_core.stepping.threads import processors

__all__ = ["held_region"]

Array = NDArray[Any]

_REACH = 1.5
"""Cells from the matter up to which a place is its own: points feel nodes as far away. What is loose there falls, and
takes the matter with it, however slowly."""
_FINER = 2
"""Nodes of the field to a cell, as points of a filled body are."""
_MOST_NODES = 2**22
"""Beyond, as many as cells have."""


def held_region(own: Array, others: Array, spacing: float) -> SignedDistanceField:
    """The region around points (M, 3) [m] that ends half way to the others (N, 3) [m] of their body.

    Parameters
    ----------
    own, others
        In the world.
    spacing
        Of the engine [m].

    Raises
    ------
    SceneError
        Where the points lie so scattered among the others that none has a place of its own.
    """
    from scipy.spatial import KDTree

    reach = _REACH * spacing
    step = spacing / _FINER
    if float(np.prod(np.ptp(own, axis=0) / step + 2 * _FINER * (_REACH + 1) + 1)) > _MOST_NODES:
        step = spacing
    lower, upper = own.min(axis=0) - reach, own.max(axis=0) + reach
    counts = np.ceil((upper - lower) / step).astype(int) + 5
    origin = (lower + upper - step * (counts - 1)) / 2
    nodes = origin + step * np.indices(counts).reshape(3, -1).T
    tree: Any = KDTree(own)
    to_own = np.minimum(tree.query(nodes, distance_upper_bound=reach + 2 * step, workers=processors())[0], 2 * reach)
    values = to_own - reach
    near = np.flatnonzero(to_own < 2 * reach)
    if len(others):
        tree = KDTree(others)
        to_others = tree.query(nodes[near], workers=processors())[0]
        values[near] = np.maximum(values[near], (to_own[near] - to_others) / 2)
    if not (values < 0).any():
        raise SceneError("its points are too scattered among others to be held: use labels that hang together")
    x, y, z = (float(each) for each in origin)
    return SignedDistanceField(origin=(x, y, z), spacing=step, values=values.reshape(counts))
