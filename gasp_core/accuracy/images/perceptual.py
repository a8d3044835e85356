"""What a network trained on photographs makes of pictures."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.accuracy.images.alexnet import SMALLEST_SIDE, LpipsWeights, layers
from gasp_core.accuracy.images.checks import checked_pair, checked_picture
from gasp_core.errors import RenderingError

__all__ = ["alexnet_features", "lpips"]

Array = NDArray[Any]

_FLOOR = 1e-10
"""Added to a norm before dividing by it, as in the authors' code."""


def lpips(reference: ArrayLike, picture: ArrayLike, weights: LpipsWeights) -> float:
    """Learned perceptual distance, LPIPS v0.1 with the AlexNet backbone: Zhang et al. 2018 (arXiv:1801.03924), eq. 1.

    Symmetric in the two pictures, bit for bit. Memory grows with the pixels: about 0.3 kB for each.

    Parameters
    ----------
    reference, picture : (H, W, 3)
        Display values, 0..1; at least 31 px a side.
    weights
        From `load_lpips_weights`.

    Returns
    -------
    float
        >= 0; 0 for equal pictures.

    Raises
    ------
    RenderingError
        Where either is no picture or too small, or their shapes differ.
    """
    first, second = checked_pair(reference, picture, smallest_side=SMALLEST_SIDE)
    total = 0.0
    for one, other, head in zip(layers(first, weights), layers(second, weights), weights.heads):
        difference = _normalised(one) - _normalised(other)
        total += float(np.mean((difference * difference) @ head))
    return total


def _normalised(features: Array) -> Array:
    """Features (H, W, C) of unit length in every pixel."""
    return features / (np.linalg.norm(features, axis=2, keepdims=True) + _FLOOR)


def alexnet_features(pictures: Iterable[ArrayLike], weights: LpipsWeights) -> Array:
    """One vector of features a picture: the mean of AlexNet's last layer over the picture.

    They are meant for `frechet_distance`.

    Parameters
    ----------
    pictures : N of (H, W, 3)
        Display values, 0..1; at least 31 px a side. They may differ in size, and are taken one at a time.
    weights
        From `load_lpips_weights`.

    Returns
    -------
    (N, 256) float64

    Raises
    ------
    RenderingError
        Where one is no picture or too small, or there is none.
    """
    rows: list[Array] = []
    for index, picture in enumerate(pictures):
        array = checked_picture(f"picture {index}", picture, smallest_side=SMALLEST_SIDE)
        *_, last = layers(array, weights)
        rows.append(last.mean(axis=(0, 1)))
    if not rows:
        raise RenderingError("there is no picture to take features of: give one or more")
    return np.stack(rows)
