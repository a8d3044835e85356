"""How far apart two sets of features are, each seen as a Gaussian."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gasp_core.accuracy.images.checks import real_array
from gasp_core.errors import RenderingError

__all__ = ["frechet_distance"]

Array = NDArray[Any]

_LARGEST = 1e100
"""Far above any float32, far below where sums of squares overflow."""


def frechet_distance(features_a: ArrayLike, features_b: ArrayLike) -> float:
    """Frechet distance of the Gaussians fitted to two sets of features: Heusel et al. 2017 (arXiv:1706.08500), eq. 6.

    |m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2)), m the means and C the sample covariances (over N - 1). It is a
    squared length, as the figure is always given. FID is this with features of the Inception network, which the user
    brings; `alexnet_features` are a ready set, whose figures compare only among themselves. Few pictures bias it
    upwards: compare sets of equal sizes.

    With C = R^T R it equals |m_a - m_b|^2 + min |R_a - Q R_b|^2 over orthogonal Q (Bhatia et al. 2019,
    arXiv:1712.01504, theorem 1). That sum of squares is never negative and takes singular covariances, hence fewer
    pictures than features, without a special case.

    Parameters
    ----------
    features_a, features_b : (N, D), (M, D)
        One row a picture; two rows or more.

    Returns
    -------
    float
        >= 0, in the features' unit squared. Rounding is about D 1e-16 (tr C_a + tr C_b).

    Raises
    ------
    RenderingError
        Where the features are no such arrays.
    """
    first, second = _checked("first", features_a), _checked("second", features_b)
    if first.shape[1] != second.shape[1]:
        raise RenderingError(
            f"the first set has {first.shape[1]} features a picture, the second {second.shape[1]}:"
            " take both from the same network"
        )
    mean_a, root_a = _gaussian(first)
    mean_b, root_b = _gaussian(second)
    rows = max(len(root_a), len(root_b))
    root_a, root_b = _filled(root_a, rows), _filled(root_b, rows)
    left, _, right = np.linalg.svd(root_a @ root_b.T)
    apart = mean_a - mean_b
    spread = root_a - left @ right @ root_b
    return float(np.sum(apart * apart) + np.sum(spread * spread))


def _checked(name: str, features: ArrayLike) -> Array:
    array = real_array(f"{name} set of features", features)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] < 1:
        raise RenderingError(
            f"the {name} set of features has shape {array.shape}, expected (pictures, features) with 2 pictures or more"
        )
    largest = float(np.abs(array).max())
    if largest > _LARGEST:
        raise RenderingError(
            f"the {name} set of features holds {largest:g}, whose square is beyond floats: scale both sets alike"
        )
    return array


def _gaussian(features: Array) -> tuple[Array, Array]:
    """Mean (D,) and R (min(N, D), D) with covariance R^T R, never squared: small variances keep their digits."""
    mean = features.mean(axis=0)
    return mean, cast("Array", np.linalg.qr((features - mean) / np.sqrt(len(features) - 1), mode="r"))


def _filled(root: Array, rows: int) -> Array:
    """R with rows of zeros, which change no covariance, up to a number of them."""
    return np.pad(root, ((0, rows - len(root)), (0, 0)))
