"""Rigid parts of objects that deform: bodies of their own to an engine, and what their surfaces are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Material, Rigid, SignedDistanceField
from gasp_core.stepping.threads import processors

__all__ = ["loose_parts", "part_shape", "rigid_groups"]

Array = NDArray[Any]

_NEAR = 3.0
"""Spacings of a field: what is farther out of all matter is out of the part, and need not be asked."""
_MARGIN = 3
"""Nodes around a part's points; twice as many where it goes on beyond them."""
_FELT = 1.0
"""Cells up to which what deforms is taken along by a rigid part: farther off nothing holds the two together."""


def rigid_groups(materials: Sequence[Material], rows: Array, parts: Array) -> Array:
    """Which points of an object are a rigid body each, (P,): 1, 2, ...; 0 for what deforms, and all where nothing does.

    Parameters
    ----------
    materials
    rows : (P,)
        Of them, for each point.
    parts : (P,)
        The part of the object that each point is in; -1 for none.
    """
    rigid = np.array([isinstance(material, Rigid) for material in materials])[rows]
    groups = np.zeros(len(rows), dtype=np.int64)
    if not rigid.all():
        _, numbers = np.unique(parts[rigid], return_inverse=True)
        groups[rigid] = 1 + numbers.reshape(-1)
    return groups


def loose_parts(groups: Array, points: Array, spacing: float) -> list[int]:
    """The rigid groups, as `rigid_groups` has them, that no matter which deforms is beside, at a grid of `spacing` [m].

    `points` (P, 3) [m].
    """
    from scipy.spatial import KDTree

    found: list[int] = []
    if groups.any():
        tree: Any = KDTree(points[groups == 0])
        for group in range(1, int(groups.max()) + 1):
            away = tree.query(points[groups == group], distance_upper_bound=_FELT * spacing, workers=processors())[0]
            if not np.isfinite(away).any():
                found.append(group)
    return found


def part_shape(whole: SignedDistanceField, own: Array, others: Array) -> SignedDistanceField | None:
    """What of a body is nearer to a part's points (M, 3) [m] than to others (N, 3) [m]; None where nothing is."""
    from scipy.spatial import KDTree

    trees: list[Any] = [KDTree(each) for each in (own, others)]
    margin = _MARGIN
    while True:
        values, first = _around(whole, own, margin)
        origin = np.asarray(whole.origin) + whole.spacing * first
        near = np.argwhere(values < _NEAR * whole.spacing)
        to_own, to_others = (tree.query(origin + whole.spacing * near, workers=processors())[0] for tree in trees)
        at = tuple(near.T)
        values[at] = np.maximum(values[at], (to_own - to_others) / 2)
        # Where points are few the body goes on beyond them, and no other is nearer: it ends with all of it at the last.
        if (values[1:-1, 1:-1, 1:-1] <= 0).sum() == (values <= 0).sum():
            break
        margin *= 2
    if not (values < 0).any():
        return None
    x, y, z = (float(each) for each in origin)
    return SignedDistanceField(origin=(x, y, z), spacing=whole.spacing, values=values, error=whole.error)


def _around(field: SignedDistanceField, points: Array, margin: int) -> tuple[Array, Array]:
    """The values of a field's nodes around points (M, 3) [m], so many to each side, and the first of these nodes."""
    low = np.floor((points.min(axis=0) - field.origin) / field.spacing).astype(int) - margin
    high = np.ceil((points.max(axis=0) - field.origin) / field.spacing).astype(int) + margin + 1
    low, high = np.maximum(low, 0), np.minimum(high, field.values.shape)
    return np.array(field.values[tuple(slice(*ends) for ends in zip(low, high))]), low
