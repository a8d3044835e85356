"""Between what files store (logits, logarithms, colours) and what Gaussians are.

All are computed in float64 and rounded once, so the result depends on no library's float32 exp.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["SH_C0", "colour_to_dc", "dc_to_colour", "exponential", "logarithm", "logit", "sigmoid"]

Array = NDArray[Any]

SH_C0 = 0.28209479177387814
"""The constant real spherical harmonic, 1 / (2 sqrt(pi))."""

_NOTHING = -104.0
"""exp of it, and sigmoid of it, round to 0 in float32: how a zero is stored without an infinity."""
_EVERYTHING = 18.0
"""sigmoid of it rounds to 1 in float32."""


def sigmoid(logits: ArrayLike) -> Array:
    """Opacities 1 / (1 + exp(-l)) of logits, float32."""
    x = np.asarray(logits, dtype=np.float64)
    with np.errstate(over="ignore"):
        return (1.0 / (1.0 + np.exp(-x))).astype(np.float32)


def logit(opacities: ArrayLike) -> Array:
    """Logits of opacities, float32; 0 and 1 come back exactly from `sigmoid`, for what is beyond them as well.

    What is not finite becomes NaN: files that can hold such Gaussians keep them as what they are, none to be drawn.
    """
    a = np.asarray(opacities, dtype=np.float64)
    a = np.where(np.isfinite(a), np.clip(a, 0.0, 1.0), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        logits = np.log(a) - np.log1p(-a)
    return np.clip(logits, _NOTHING, _EVERYTHING).astype(np.float32)


def exponential(logarithms: ArrayLike) -> Array:
    """Linear scales of logarithmic ones, float32."""
    with np.errstate(over="ignore"):
        return np.exp(np.asarray(logarithms, dtype=np.float64)).astype(np.float32)


def logarithm(scales: ArrayLike) -> Array:
    """Logarithms of scales >= 0, float32, finite; a zero comes back exactly from `exponential`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(np.asarray(scales, dtype=np.float64))
    return np.maximum(logs, _NOTHING).astype(np.float32)


def colour_to_dc(colours: ArrayLike) -> Array:
    """Constant harmonics of colours in 0..1, float32."""
    return ((np.asarray(colours, dtype=np.float64) - 0.5) / SH_C0).astype(np.float32)


def dc_to_colour(dc: ArrayLike) -> Array:
    """Colours of constant harmonics, float64, 0..1 where they can be shown."""
    return np.asarray(dc, dtype=np.float64) * SH_C0 + 0.5
