"""Rigid bodies that start inside each other: Bullet would throw them apart, so they do not meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError

__all__ = ["LAYERS", "collision_layers", "overlapping"]

Array = NDArray[Any]

LAYERS = 20
"""Collision collections that Blender has."""
_DEEP = 0.01
"""Of the smaller body's size: hulls that touch, or nearly, may start so."""


def overlapping(hulls: Sequence[Array], directions: Array) -> Array:
    """Which bodies start inside each other, (B, B) bool.

    Parameters
    ----------
    hulls
        Points (H, 3) of each, in one frame.
    directions : (D, 3)
        Unit vectors, along which hulls have to overlap.
    """
    highs = np.array([(hull @ directions.T).max(axis=0) for hull in hulls])
    lows = np.array([(hull @ directions.T).min(axis=0) for hull in hulls])
    sizes = (highs - lows).max(axis=1)
    found = np.zeros((len(hulls), len(hulls)), dtype=bool)
    for one in range(len(hulls)):
        depths = (np.minimum(highs[one], highs) - np.maximum(lows[one], lows)).min(axis=1)
        found[one] = depths > _DEEP * np.minimum(sizes[one], sizes)
    np.fill_diagonal(found, val=False)
    return found


def collision_layers(meeting: Array) -> Array:
    """Layers of bodies, (B, LAYERS) bool: two that meet, (B, B) bool, have one in common, and others have none.

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
        for body in range(len(meeting)):
            if body not in group and together[body, group].all():
                group.append(body)
        layers[group, layer] = True
        missing[np.ix_(group, group)] = False
    if missing.any():
        raise SceneError(
            f"so many of the {len(meeting)} rigid bodies start inside each other that Blender cannot keep them apart:"
            " move them apart, or simulate fewer"
        )
    return layers
