"""Rigid bodies that start inside each other, or inside a wall: Bullet would throw them apart.

Bodies that do so do not meet. A wall that a body starts in is another one for that body, moved back until they touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError

__all__ = ["LAYERS", "Pieces", "collision_layers", "depths_between", "overlapping"]

Array = NDArray[Any]
Pieces = Sequence[Array]
"""Points (H, 3) that span each convex piece of a thing."""

LAYERS = 20
"""Collision collections that Blender has."""
_DEEP = 0.01
"""Of the smaller body's size: hulls that touch, or nearly, may start so."""


def depths_between(bodies: Sequence[Pieces], others: Sequence[Pieces], directions: Array) -> tuple[Array, Array]:
    """How deep bodies are in other ones, (B, W), <= 0 where they are apart; and the rows of `directions` to leave by.

    Parameters
    ----------
    bodies, others
        Convex pieces of each, in one frame; of two that meet it is their deepest pieces that count.
    directions : (D, 3)
        Unit vectors, along one of which pieces are taken to be the least deep in each other.
    """
    depths, ways = np.full((len(bodies), len(others)), -np.inf), np.zeros((len(bodies), len(others)), np.int64)
    lows = [np.array([(piece @ directions.T).min(axis=0) for piece in other]) for other in others]
    for number, body in enumerate(bodies):
        for piece in body:
            high = (piece @ directions.T).max(axis=0)
            for other, low in enumerate(lows):
                into = high - low
                depth = into.min(axis=1)
                deepest = int(depth.argmax())
                if depth[deepest] > depths[number, other]:
                    depths[number, other], ways[number, other] = depth[deepest], into[deepest].argmin()
    return depths, ways


def overlapping(bodies: Sequence[Pieces], directions: Array) -> Array:
    """Which bodies start inside each other, (B, B) bool; parameters as of `depths_between`."""
    depths, _ = depths_between(bodies, bodies, directions)
    sizes = np.array([np.ptp(np.concatenate(body), axis=0).max() for body in bodies])
    found = np.minimum(depths, depths.T) > _DEEP * np.minimum(sizes, sizes[:, None])
    np.fill_diagonal(found, val=False)
    return found


def collision_layers(meeting: Array) -> Array:
    """Layers of things, (T, LAYERS) bool: two that meet, (T, T) bool, have one in common, and others have none.

    Raises
    ------
    SceneError
        Where Blender's layers are too few.
    """
    together = meeting | np.eye(len(meeting), dtype=bool)
    missing = together.copy()
    layers = np.zeros((len(meeting), LAYERS), dtype=bool)
    for layer in range(LAYERS):
        if not missing.any():
            break
        group = list(dict.fromkeys(np.argwhere(missing)[0].tolist()))
        for thing in range(len(meeting)):
            if thing not in group and together[thing, group].all():
                group.append(thing)
        layers[group, layer] = True
        missing[np.ix_(group, group)] = False
    if missing.any():
        raise SceneError(
            "so many rigid bodies start inside each other, or inside colliders, that Blender cannot keep them apart:"
            " move them apart, or simulate fewer"
        )
    return layers
