"""Measures of how faithful one picture is to another: PSNR, SSIM and FLIP, each by the package that is known for it."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gasp_core.accuracy.images.checks import checked_pair
from gasp_core.errors import RenderingError

__all__ = ["flip", "psnr", "ssim"]

_SSIM_WINDOW = 11
"""Pixels across the Gaussian of 1.5 px, cut at 3.5 standard deviations."""

_LARGEST_PIXELS_PER_DEGREE = 1000.0
"""No eye resolves more than about 100; the filters grow with it without end."""


def _from_extra(module: str) -> Any:
    """A module of the extra `images`; imported only when it is used, for it takes a second."""
    try:
        return import_module(module)
    except ImportError as error:
        raise RenderingError(f'this measure needs {module} ({error}): pip install "gasp-core[images]"') from error


def psnr(reference: ArrayLike, picture: ArrayLike) -> float:
    """Peak signal-to-noise ratio [dB]: -10 log10 of the mean squared difference.

    Parameters
    ----------
    reference, picture : (H, W, 3)
        Display values, 0..1.

    Returns
    -------
    float
        inf for equal pictures.

    Raises
    ------
    RenderingError
        Where either is no picture, their shapes differ, or scikit-image is not installed.
    """
    metrics = _from_extra("skimage.metrics")
    first, second = checked_pair(reference, picture)
    with np.errstate(divide="ignore"):
        return float(metrics.peak_signal_noise_ratio(first, second, data_range=1))


def ssim(reference: ArrayLike, picture: ArrayLike) -> float:
    """Structural similarity in the setting of Wang et al. 2004 (10.1109/TIP.2003.819861).

    A Gaussian window of 1.5 px, cut to 11 x 11 px. The mean is over the channels and over the pixels whose window lies
    inside the picture.

    Parameters
    ----------
    reference, picture : (H, W, 3)
        Display values, 0..1; at least 11 px a side.

    Returns
    -------
    float
        -1..1; 1 for equal pictures.

    Raises
    ------
    RenderingError
        Where either is no picture or too small, their shapes differ, or scikit-image is not installed.
    """
    metrics = _from_extra("skimage.metrics")
    first, second = checked_pair(reference, picture, smallest_side=_SSIM_WINDOW)
    return float(
        metrics.structural_similarity(
            first,
            second,
            data_range=1,
            channel_axis=2,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        )
    )


def flip(reference: ArrayLike, picture: ArrayLike, pixels_per_degree: float = 67.02) -> float:
    """Mean FLIP of pictures with a low dynamic range: Andersson et al. 2020 (10.1145/3406183).

    Parameters
    ----------
    reference, picture : (H, W, 3)
        Display values (sRGB), 0..1. The measure itself runs in float32.
    pixels_per_degree
        Of the observer's field of view. The default is the paper's: 3840 px on 0.7 m, seen from 0.7 m.

    Returns
    -------
    float
        0..1; 0 for equal pictures.

    Raises
    ------
    RenderingError
        Where either is no picture, their shapes differ, `pixels_per_degree` is impossible, or flip-evaluator is not
        installed.
    """
    evaluator = _from_extra("flip_evaluator")
    first, second = checked_pair(reference, picture)
    density = float(pixels_per_degree)
    if not (math.isfinite(density) and 0 < density <= _LARGEST_PIXELS_PER_DEGREE):
        raise RenderingError(
            f"the pixels per degree must be above 0 and at most {_LARGEST_PIXELS_PER_DEGREE:g}, found {density!r}"
        )
    errors, _, _ = evaluator.evaluate(
        np.ascontiguousarray(first, dtype=np.float32),
        np.ascontiguousarray(second, dtype=np.float32),
        "LDR",
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": density},
    )
    # The package's own mean is a running sum in float32: several per cent off for a large picture.
    return float(errors.mean(dtype=np.float64))
